"""What an axis can be asked to do: kinds of motion described by a few numbers each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pneumo_casadi.parameters import FloatArray

#: Name of the part that is laid over all others: equal steps of both valves.
COMMON = "common_mode_steps"
#: Tones of a multisine, places of holds, speeds of a creep.
TONES, PLACES, SPEEDS = 7, 5, 3


@dataclass(frozen=True, slots=True)
class Number:
    """One number that describes a motion.

    Parameters
    ----------
    name : str
        What it is.
    unit : str
        SI unit; ``"1"`` for shares of what the limits allow.
    lower, upper : float
        Range that a search goes through.
    start : float
        Value in the paper's experiment, or where it has none, in the middle.
    ratio : bool
        Whether the range is gone through by ratios rather than by differences.
    """

    name: str
    unit: str
    lower: float
    upper: float
    start: float
    ratio: bool = False

    def at(self, share: float) -> float:
        """Return the value at a share of the range, 0 ... 1."""
        if self.ratio:
            return float(self.lower * (self.upper / self.lower) ** share)
        return self.lower + share * (self.upper - self.lower)

    def share(self, value: float) -> float:
        """Return the share of the range at which a value lies."""
        if self.ratio:
            return float(np.log(value / self.lower) / np.log(self.upper / self.lower))
        return (value - self.lower) / (self.upper - self.lower)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of motion.

    Parameters
    ----------
    text : str
        What it is, for readers of a report.
    numbers : tuple of Number
        What describes one.
    draw : callable
        ``draw(t, *values)`` returns the motion in shares of the reach allowed, or for a creep in
        metres, at the times t from 0 on.
    metres : bool
        Whether `draw` returns metres, to be folded into the reach.
    """

    text: str
    numbers: tuple[Number, ...]
    draw: Callable[..., FloatArray]
    metres: bool = False


@dataclass(frozen=True, slots=True)
class Part:
    """A stretch of one kind.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    share : float
        Of the duration.
    values : tuple of float
        The kind's numbers, in order.
    """

    kind: str
    share: float
    values: tuple[float, ...]

    def as_dict(self) -> dict[str, object]:
        """Return the part as plain data."""
        numbers = KINDS[self.kind].numbers
        named = {
            number.name: {"value": value, "unit": number.unit}
            for number, value in zip(numbers, self.values, strict=True)
        }
        return {"kind": self.kind, "share": self.share, "numbers": named}


@dataclass(frozen=True, slots=True)
class Reference:
    """What the axis is given, sample by sample.

    x_ref and `common` are equivalent to separate commands of the two valves: under proportional
    feedback u_P = gain (x_ref − x) + common and u_N = −gain (x_ref − x) + common, so that x_ref
    sets their difference and `common` their sum.

    Parameters
    ----------
    dt : float
        Sampling period [s].
    x_ref : (N,) array
        Reference of the position [m].
    common : (N,) array
        Command added to both valves [V]; it moves the mean pressure.
    start : (x, p_P, p_N), optional
        Where it was begun, at rest [m, Pa, Pa]; by default the axis settles on the first values.
    """

    dt: float
    x_ref: FloatArray
    common: FloatArray
    start: tuple[float, float, float] | None = None

    @property
    def t(self) -> FloatArray:
        """Time [s], shape (N,)."""
        t: FloatArray = self.dt * np.arange(self.x_ref.size, dtype=float)
        return t

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.x_ref.size * self.dt


def chirp(t: FloatArray, amplitude: float, f_end: float) -> FloatArray:
    """Sweep from rest to `f_end` [Hz]."""
    return np.asarray(amplitude * np.sin(np.pi * f_end * t**2 / max(t[-1], 1e-9)), dtype=float)


def squares(t: FloatArray, largest: float, smallest: float, period: float) -> FloatArray:
    """Jump between both sides of the middle twice a `period` [s], at falling amplitudes."""
    jump = (2 * t / period).astype(int)
    last = max(int(jump[-1]), 1)
    amplitude = largest + (smallest - largest) * jump / last
    return np.asarray(amplitude * np.where(jump % 2 == 0, 1.0, -1.0), dtype=float)


def multisine(
    t: FloatArray, amplitude: float, f_low: float, f_high: float, phase: float
) -> FloatArray:
    """Add tones from `f_low` to `f_high` [Hz], their phases π · `phase` k²/tones, begun softly."""
    k = np.arange(TONES)
    f = np.linspace(f_low, max(f_high, f_low), TONES)
    angle = 2 * np.pi * f[:, None] * t + (np.pi * phase * k**2 / TONES)[:, None]
    wave = np.sin(angle).sum(axis=0)
    largest = max(float(np.abs(wave).max()), 1e-9)
    return np.asarray(amplitude * wave / largest * np.minimum(t / 0.3, 1.0), dtype=float)


def creep(t: FloatArray, slowest: float, fastest: float) -> FloatArray:
    """Ramp up and down at speeds from `slowest` to `fastest` [m/s]; return metres."""
    speeds = np.geomspace(slowest, max(fastest, slowest), SPEEDS)
    way = np.repeat(speeds, 2) * np.tile([1.0, -1.0], SPEEDS)
    legs = way.size
    length = max(t[-1], 1e-9) / legs
    leg = np.minimum((t / length).astype(int), legs - 1)
    gone = np.concatenate([[0.0], np.cumsum(way * length)])
    return np.asarray(gone[leg] + way[leg] * (t - leg * length), dtype=float)


def holds(t: FloatArray, spread: float) -> FloatArray:
    """Move to several positions on both sides of mid-stroke and hold each."""
    levels = spread * np.array([0.0, 1.0, -0.5, 0.5, -1.0])
    index = np.minimum((t / max(t[-1], 1e-9) * PLACES).astype(int), PLACES - 1)
    return np.asarray(levels[index], dtype=float)


def common_mode_steps(t: FloatArray, step: float, offset: float, period: float) -> FloatArray:
    """Command both valves equally, alternately above and below an offset."""
    side = np.where((2 * t / period).astype(int) % 2 == 0, 1.0, -1.0)
    return np.clip(offset + step * side, -1.0, 1.0)


#: Kinds of motion by name, the paper's two first.
KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "chirp": Kind(
            "sweep from rest",
            (
                Number("amplitude", "1", 0.05, 1.0, 0.45),
                Number("f_end", "Hz", 0.5, 4.0, 2.0, ratio=True),
            ),
            chirp,
        ),
        "squares": Kind(
            "squares of several amplitudes",
            (
                Number("largest", "1", 0.05, 1.0, 0.65),
                Number("smallest", "1", 0.02, 1.0, 0.15),
                Number("period", "s", 0.5, 6.0, 2.0, ratio=True),
            ),
            squares,
        ),
        "multisine": Kind(
            "tones from low to high",
            (
                Number("amplitude", "1", 0.05, 1.0, 0.6),
                Number("f_low", "Hz", 0.1, 2.0, 0.2, ratio=True),
                Number("f_high", "Hz", 0.5, 5.0, 2.0, ratio=True),
                Number("phase", "1", 0.0, 2.0, 1.0),
            ),
            multisine,
        ),
        "creep": Kind(
            "ramps up and down at three speeds",
            (
                Number("slowest", "m/s", 0.002, 0.1, 0.005, ratio=True),
                Number("fastest", "m/s", 0.005, 0.3, 0.08, ratio=True),
            ),
            creep,
            metres=True,
        ),
        "holds": Kind("five places to stay", (Number("spread", "1", 0.05, 1.0, 0.6),), holds),
        COMMON: Kind(
            "equal steps of both valves",
            (
                Number("step", "1", 0.0, 1.0, 0.0),
                Number("offset", "1", -1.0, 1.0, 0.0),
                Number("period", "s", 0.5, 8.0, 2.0, ratio=True),
            ),
            common_mode_steps,
        ),
    }
)


def make_reference(
    parts: tuple[Part, ...], dt: float, N: int, reach: float, common: float
) -> Reference:
    """Draw parts one after another, `common_mode_steps` over all of them.

    Parameters
    ----------
    parts : tuple of Part
        At least one of them a motion; shares are taken of their sum.
    dt, N : float, int
        Sampling period [s] and number of samples.
    reach : float
        Largest position [m].
    common : float
        Largest command to both valves [V].

    Examples
    --------
    >>> reference = make_reference((Part("squares", 1.0, (0.5, 0.5, 2.0)),), 0.5, 6, 0.2, 0.0)
    >>> reference.x_ref
    array([ 0.1,  0.1, -0.1, -0.1,  0.1,  0.1])
    """
    motions = [part for part in parts if part.kind != COMMON]
    ends = np.cumsum([part.share for part in motions])
    edges = np.round(np.concatenate([[0.0], ends / ends[-1]]) * N).astype(int)
    x_ref, added = np.zeros(N), np.zeros(N)
    for part, first, last in zip(motions, edges[:-1], edges[1:], strict=True):
        if last > first:
            kind = KINDS[part.kind]
            motion = kind.draw(dt * np.arange(last - first, dtype=float), *part.values)
            x_ref[first:last] = _folded(motion, reach) if kind.metres else reach * motion
    for part in parts:
        if part.kind == COMMON:
            added += common * KINDS[COMMON].draw(dt * np.arange(N, dtype=float), *part.values)
    return Reference(dt, np.round(x_ref, 6), np.round(added, 4))


def _folded(x: FloatArray, reach: float) -> FloatArray:
    """Fold a motion [m] back at the ends of the reach, its speed kept, begun in the middle."""
    centred = x - (x.max() + x.min()) / 2
    there_and_back = np.abs((centred + reach) % (4 * reach) - 2 * reach)
    return np.asarray(reach - there_and_back, dtype=float)
