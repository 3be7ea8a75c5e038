"""The electro-mechanical positioning system (EMPS) of Janot, Gautier and Brunot (2019).

A published benchmark: a force-driven axis under nested position and velocity loops, 1 kHz.
The data are the authors'; cite A. Janot, M. Gautier and M. Brunot, "Data set and reference
models of EMPS", Workshop on Nonlinear System Identification Benchmarks, Eindhoven, 2019.
"""

from pathlib import Path

import numpy as np

from pneumo_casadi.data.bench.controllers import NestedController
from pneumo_casadi.data.bench.driven_bench import ForceBench
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.readers.columns import COLUMNS, Column
from pneumo_casadi.data.readers.recordings import recording_of_table
from pneumo_casadi.data.readers.tables import Table, read_table
from pneumo_casadi.data.record_checks import check_records
from pneumo_casadi.data.recording.channels import InputHold
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

IDENTIFY = "DATA_EMPS.mat"
VALIDATE = "DATA_EMPS_PULSES.mat"
SAMPLING_FREQUENCY = 1000.0
U_MAX = 10.0
#: Signals of both files, and of the second one.
SIGNALS, PULSES = ("t", "qm", "qg", "vir"), "pulses_N"
CONSTANTS = {"kp": "k_p", "kv": "k_v", "gtau": "gain"}


def read_emps(folder: str | Path) -> Case:
    """Read the EMPS benchmark as a case of a force-driven axis.

    Channels: ``x`` (qm) and ``x_ref`` (qg) [m], ``F`` = gtau · vir [N]; the pulse record also
    has ``F_pulse`` = gtau · pulses_N [N]. ``F`` is the sum of controller and pulses already: a
    closed-loop simulation adds ``F_pulse`` to what its controller sets, an open-loop one does
    not. (The authors' description gives newtons for vir and pulses_N; both are volts: with
    gtau · pulses_N added the simulated position is forty times nearer to the measured one.)

    Parameters
    ----------
    folder : str or Path
        Folder with the authors' ``DATA_EMPS.mat`` (to identify on) and
        ``DATA_EMPS_PULSES.mat`` (to validate on).

    Returns
    -------
    Case
        With a `ForceBench` under a `NestedController`; the stroke and the sensor noise are
        not published and hence None.

    Raises
    ------
    CaseError
        If a file is missing or is not the one expected.
    """
    folder = Path(folder)
    tables = {name: _read_table(folder / name) for name in (IDENTIFY, VALIDATE)}
    constants = _constants(tables[IDENTIFY])
    if _constants(tables[VALIDATE]) != constants:
        raise CaseError(
            f"{folder / VALIDATE}: gains differ from those of {IDENTIFY}; use the authors' files"
        )
    bench = ForceBench(SAMPLING_FREQUENCY, None, NestedController(**constants, u_max=U_MAX))
    columns = {
        "t": Column("t"),
        "qm": Column("x"),
        "qg": Column("x_ref"),
        "vir": Column("F", scale=constants["gain"]),
    }
    identify = _recording(tables[IDENTIFY], columns)
    pulses = {PULSES: Column("F_pulse", scale=constants["gain"])}
    validate = _recording(tables[VALIDATE], columns | pulses)
    findings = check_records((identify, validate), bench)
    return Case(folder, bench, (identify,), (validate,), None, findings)


def _read_table(path: Path) -> Table:
    return read_table(path, {*COLUMNS, *CONSTANTS, *SIGNALS, PULSES})


def _recording(table: Table, columns: dict[str, Column]) -> Recording:
    return recording_of_table(table, InputHold.ZERO, columns, name=table.path.stem)


def _constants(table: Table) -> dict[str, float]:
    values = table.columns
    missing = [name for name in CONSTANTS if name not in values or np.size(values[name]) != 1]
    if missing:
        raise CaseError(
            f"{table.path}: no constant {', '.join(missing)}; is it the benchmark's own MAT file?"
        )
    return {symbol: float(values[name][0]) for name, symbol in CONSTANTS.items()}
