"""Sensors of velocity and acceleration against the position: gain, zero, unit, a wrong channel."""

from collections.abc import Iterator

import numpy as np

from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.bench.load import GRAVITY
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.smoothed import SmoothedRecord
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.parameters import FloatArray

#: Gain against the derivative of the position beyond which a sensor contradicts it: calibration
#: certificates of such sensors state 1 to 5 %.
GAIN_ERROR = 0.1
#: Zero over the largest value shown, from which it is odd. The same certificates state 1 % and more
#: of the range, which is at least what the record shows.
ZERO_ERROR = 0.01
#: Standard deviations of the mean beyond which a zero is none of noise, and the parts of a record
#: whose means tell that deviation: noise and lags of some blocks are independent between tenths.
SIGMAS_OF_ZERO = 4.0
PARTS = 10
#: Correlation below which a sensor does not follow the motion. Within the pass-band of the
#: smoothing both signals are far above their noise wherever an axis moves.
LEAST_CORRELATION = 0.9
#: Factors between units in use: mm/s, cm/s, g.
UNIT_FACTORS = (1e3, 1e2, 1 / GRAVITY)
#: How near to such a factor the gain must be.
NEAR = 0.05
_DERIVATIVES = {"v": "derivative", "a": "second derivative"}


def check_motion_sensors(
    record: SmoothedRecord, bench: AnyBench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield what contradicts the position among the sensors of velocity and acceleration.

    Parameters
    ----------
    record : SmoothedRecord
        The record.
    bench : Bench, ForceBench or PressureBench
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
    whole, motion = shown, expected
    shown, expected = shown - shown.mean(), expected - expected.mean()
    size = float(np.linalg.norm(shown) * np.linalg.norm(expected))
    if size == 0.0:
        return
    correlation = float(shown @ expected) / size
    gain = float(shown @ expected) / float(expected @ expected)
    what = _DERIVATIVES[channel]
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
    zero, grade = _zero(whole, motion, gain)
    if abs(gain - 1) > GAIN_ERROR:
        yield _wrong_gain(record, channel, gain, 0.0 if grade is None else zero, entries)
    elif grade is not None:
        rounded = float(f"{zero:.3g}")
        yield Finding(
            grade,
            f"zero of {channel}",
            channel,
            f"`{channel}` shows {rounded:+g} {UNITS[channel]} at rest, by the mean {what} of `x`; "
            "subtract it"
            + (" (an accelerometer on an inclined axis shows gravity)." if channel == "a" else "."),
            "columns.json",
            entries.corrected(channel, offset=-rounded),
            source,
        )


def _zero(shown: FloatArray, expected: FloatArray, gain: float) -> tuple[float, Grade | None]:
    """Return what a sensor shows at rest, and how grave that is; None where it is no finding.

    A sensor is as wrong by its zero as by its gain where both displace it as far.
    """
    rest = shown - gain * expected
    means = [part.mean() for part in np.array_split(rest, PARTS)]
    zero, deviation = float(rest.mean()), float(np.std(means, ddof=1)) / np.sqrt(PARTS)
    certain = abs(zero) > SIGMAS_OF_ZERO * deviation
    if not certain or abs(zero) <= ZERO_ERROR * float(np.abs(shown - zero).max()):
        return zero, None
    grave = abs(zero) > GAIN_ERROR * abs(gain) * float(np.sqrt(np.mean(expected**2)))
    return zero, Grade.SEVERE if grave else Grade.CAUTION


def _wrong_gain(
    record: SmoothedRecord, channel: str, gain: float, zero: float, entries: ColumnEntries
) -> Finding:
    """Return the finding of a gain; its remedy takes the zero off as well."""
    what = _DERIVATIVES[channel]
    unit = next((f for f in UNIT_FACTORS if abs(abs(gain) / f - 1) < NEAR), None)
    cause = "its unit" if unit else "its sign" if abs(gain + 1) <= GAIN_ERROR else "its gain"
    factor = np.sign(gain) / (unit or (1.0 if cause == "its sign" else float(f"{abs(gain):.4g}")))
    offset = float(f"{-factor * zero:.3g}")
    return Finding(
        Grade.SEVERE,
        f"sensor of {channel}",
        channel,
        f"`{channel}` is {gain:.3g} times the {what} of `x`; correct {cause} "
        f"(expected {UNITS[channel]}, positive in +x).",
        "columns.json",
        entries.corrected(channel, factor=float(factor), offset=offset),
        record.recording.source,
    )
