"""Recordings held against the bench: what cannot be is an error, what is odd a note."""

import logging

from pneumo_casadi.errors import CaseError
from pneumo_casadi.recording.bench import AnyBench
from pneumo_casadi.recording.recording import UNITS, Recording

log = logging.getLogger(__name__)


def check_recording(recording: Recording, bench: AnyBench) -> tuple[str, ...]:
    """Check that a recording can come from the bench; see the module.

    Raises
    ------
    CaseError
        Naming file, row, value, unit and remedy.
    """
    for channel in (*bench.inputs, *bench.outputs, "x_ref"):
        if channel not in recording:
            raise CaseError(
                f"{recording.source}: no column `{channel}_{UNITS[channel]}`; it has "
                f"{', '.join(recording.names)}"
            )
    return ()
