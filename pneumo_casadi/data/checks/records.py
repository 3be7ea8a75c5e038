"""Recordings held against the bench: what cannot be is an error, what is odd a note."""

import logging

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.checks.chambers import check_chambers
from pneumo_casadi.data.checks.ranges import check_ranges
from pneumo_casadi.data.checks.sensors import check_sensors
from pneumo_casadi.data.readers.recordings import FEWEST_ROWS
from pneumo_casadi.data.recording.channels import column_name
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

log = logging.getLogger(__name__)

CLOCK_TOLERANCE = 1e-3


def check_recording(recording: Recording, bench: AnyBench) -> tuple[str, ...]:
    """Check that a recording can come from a bench.

    Channels present, enough rows, clock as the bench's, values within stroke, pressures and
    command limits and in the right unit, sensors alive, chambers not swapped.

    Parameters
    ----------
    recording : Recording
        The record; left as it is.
    bench : Bench or ForceBench
        What it is held against.

    Returns
    -------
    tuple of str
        What is odd but possible; also logged as warnings.

    Raises
    ------
    CaseError
        At the first contradiction, naming file, row, value, unit and remedy.
    """
    _check_channels(recording, bench)
    _check_clock(recording, bench)
    check_ranges(recording, bench)
    notes = check_sensors(recording, bench)
    if isinstance(bench, Bench):
        notes += check_chambers(recording, bench)
    for note in notes:
        log.warning("%s", note)
    return notes


def _check_channels(recording: Recording, bench: AnyBench) -> None:
    reference = ("x_ref",) if bench.controller.closes_loop else ()
    needed = (*bench.kind.inputs, *bench.kind.outputs, *reference)
    missing = [f"`{column_name(name)}`" for name in needed if name not in recording]
    if missing:
        raise CaseError(
            f"{recording.source}: no column {', '.join(missing)}; it has "
            f"{', '.join(f'`{name}`' for name in ('t', *recording.names))}; add the column, or "
            "name it in columns={...}"
        )
    if recording.N < FEWEST_ROWS:
        raise CaseError(
            f"{recording.source}: {recording.N} rows, fewer than {FEWEST_ROWS}: too few to learn "
            "from; was the file cut short?"
        )


def _check_clock(recording: Recording, bench: AnyBench) -> None:
    recorded, expected = recording.sampling_frequency, bench.sampling_frequency
    if abs(recorded / expected - 1) <= CLOCK_TOLERANCE:
        return
    if abs(recorded * 1e3 / expected - 1) <= CLOCK_TOLERANCE:
        remedy = "is `t` in ms?"
    else:
        remedy = "correct `t` or the bench's `sampling_frequency`"
    raise CaseError(
        f"{recording.source}: `t` steps by {recording.dt:.6g} s, that is {recorded:.6g} Hz, but "
        f"the bench samples at {expected:.6g} Hz; {remedy}"
    )
