"""Simulations of a case's records, written as CSV in the columns of a case folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import pandas as pd

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.data.recording.channels import column_name
from pneumo_casadi.errors import CaseError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.model.validity.physical_range import require_physical
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.validation.simulations import free_run, loop_run


class RecordSet(Enum):
    """Which records of a case."""

    IDENTIFY = "identify"
    VALIDATE = "validate"


@dataclass(frozen=True, eq=False)
class RecordSimulation:
    """A record beside its simulation."""

    record: Recording
    trajectory: Trajectory


def simulate_case(
    axis: Axis,
    case: Case,
    records: RecordSet = RecordSet.VALIDATE,
    closed_loop: bool = True,
    progress: Progress | None = None,
) -> tuple[RecordSimulation, ...]:
    """Simulate an axis for the records of a case.

    Parameters
    ----------
    axis : Axis
        The axis, with the values of its parameters.
    case : Case
        Supplies references or inputs, and the initial states.
    records : RecordSet
        Which of its records.
    closed_loop : bool
        Under the bench's controller on the recorded reference; otherwise with the recorded
        inputs.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Raises
    ------
    CaseError
        If the case has no such record, or a record no reference.
    ModelError
        If a simulation leaves what the axis can be: the end of the stroke, or no pressure.
    """
    chosen = case.validate if records is RecordSet.VALIDATE else case.identify
    if not chosen:
        raise CaseError(f"{case.folder}: no record {records.value}.csv to simulate")
    report = progress or no_progress
    simulations = []
    for i, record in enumerate(chosen):
        report(f"simulating {record.name}", i / len(chosen))
        run = loop_run(axis, record) if closed_loop else free_run(axis, record)
        of_record = f"the simulation of {record.name}"
        if not closed_loop:
            of_record += ", which drifts in open loop,"
        require_physical(axis.kind, axis.parameters, run.t, run.x, run.u, of_record)
        simulations.append(RecordSimulation(record, run))
    return tuple(simulations)


def trajectory_frame(simulated: RecordSimulation) -> pd.DataFrame:
    """Return a simulation in the columns of a case folder, SI units, without noise."""
    record, run = simulated.record, simulated.trajectory
    columns = {"t_s": np.round(record.t, 10) + 0.0}  # no -0
    columns |= {column_name(name): run[name] for name in (*run.inputs, *run.outputs)}
    if "x_ref" in record:
        columns["x_ref_m"] = record["x_ref"]
    return pd.DataFrame(columns)


def write_frames(frames: Sequence[tuple[str, pd.DataFrame]], folder: Path) -> tuple[Path, ...]:
    """Write one CSV file a simulation into a folder that is there."""
    paths = []
    for name, frame in frames:
        path = folder / f"{name}.csv"
        frame.to_csv(path, index=False, float_format="%.10g", lineterminator="\n")
        paths.append(path)
    return tuple(paths)
