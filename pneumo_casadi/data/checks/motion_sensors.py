"""Sensors of velocity and acceleration against the position: gain, sign, unit, a wrong channel."""

from collections.abc import Iterator

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import PressureBench
from pneumo_casadi.data.bench.load import GRAVITY
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.smoothed import SmoothedRecord
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.parameters import FloatArray

#: Gain against the derivative of the position beyond which a sensor contradicts it: calibration
#: certificates of such sensors state 1 to 5 %.
GAIN_ERROR = 0.1
#: Correlation below which a sensor does not follow the motion. Within the pass-band of the
#: smoothing both signals are far above their noise wherever an axis moves.
LEAST_CORRELATION = 0.9
#: Factors between units in use: mm/s, cm/s, g.
UNIT_FACTORS = (1e3, 1e2, 1 / GRAVITY)
#: How near to such a factor the gain must be.
NEAR = 0.05


def check_motion_sensors(
    record: SmoothedRecord, bench: Bench | PressureBench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield what contradicts the position among the sensors of velocity and acceleration.

    Parameters
    ----------
    record : SmoothedRecord
        The record.
    bench : Bench or PressureBench
        Names the sensors that all records have.
    entries : ColumnEntries
        The columns as they are read now.
    """
    for channel, expected in (("v", record.v), ("a", record.a)):
        if channel in bench.signals:
            shown = record.smooth(record.recording[channel])
            inner = record.inner
            yield from _compare(record, channel, shown[inner], expected[inner], entries)


def _compare(
    record: SmoothedRecord,
    channel: str,
    shown: FloatArray,
    expected: FloatArray,
    entries: ColumnEntries,
) -> Iterator[Finding]:
    shown, expected = shown - shown.mean(), expected - expected.mean()
    size = float(np.linalg.norm(shown) * np.linalg.norm(expected))
    if size == 0.0:
        return
    correlation = float(shown @ expected) / size
    gain = float(shown @ expected) / float(expected @ expected)
    what = {"v": "derivative", "a": "second derivative"}[channel]
    source = record.recording.source
    if abs(correlation) < LEAST_CORRELATION:
        yield Finding(
            Grade.SEVERE,
            f"sensor of {channel}",
            channel,
            f"`{channel}` does not follow the {what} of `x` (correlation {correlation:+.2f}); is "
            "it another channel, or on another clock? Leave the column out.",
            source=source,
        )
        return
    if abs(gain - 1) <= GAIN_ERROR:
        return
    unit = next((f for f in UNIT_FACTORS if abs(abs(gain) / f - 1) < NEAR), None)
    cause = "its unit" if unit else "its sign" if abs(gain + 1) <= GAIN_ERROR else "its gain"
    factor = np.sign(gain) / (unit or (1.0 if cause == "its sign" else float(f"{abs(gain):.4g}")))
    yield Finding(
        Grade.SEVERE,
        f"sensor of {channel}",
        channel,
        f"`{channel}` is {gain:.3g} times the {what} of `x`; correct {cause} "
        f"(expected {UNITS[channel]}, positive in +x).",
        "columns.json",
        entries.corrected(channel, factor=float(factor)),
        source,
    )
