"""Excitations of the axis: references of the position, and common-mode commands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.axis import VirtualAxis


@dataclass(frozen=True, slots=True)
class Excitation:
    """What drives one record.

    Parameters
    ----------
    x_ref : (N,) array
        Reference of the position [m].
    common : (N,) array
        Command added to both valves alike [V]; it moves the mean pressure. With `x_ref`, which
        drives the valves apart, it makes any two commands.
    """

    x_ref: FloatArray
    common: FloatArray

    def excitation(self, axis: VirtualAxis, fs: float, duration: float, seed: int) -> "Excitation":
        """Return itself, as an `Experiment` returns what it draws.

        Raises
        ------
        ModelError
            If it does not last `duration` [s] at `fs` [Hz], or leaves the stroke.
        """
        del seed
        if not self.x_ref.shape == self.common.shape == (round(duration * fs),):
            raise ModelError(
                f"an excitation of {self.x_ref.size} references and {self.common.size} common-mode "
                f"commands for {duration:g} s at {fs:g} Hz; give {round(duration * fs)} of each"
            )
        if not float(np.abs(self.x_ref).max()) <= axis.stroke / 2:
            raise ModelError(f"a reference beyond the end stops at ±{axis.stroke / 2:g} m")
        return self


@dataclass(frozen=True, slots=True)
class Experiment:
    """Parts one after another.

    Parameters
    ----------
    parts : tuple of (str, float)
        Kind, one of `KINDS`, and its share of the duration.

    Raises
    ------
    ModelError
        If a kind is unknown or a share is not positive.

    Examples
    --------
    >>> from pneumo_casadi.virtual_bench import random_axis
    >>> drive = Experiment.of("creep").excitation(random_axis(1), 1000.0, 2.0, seed=1)
    >>> drive.x_ref.size, bool(abs(drive.x_ref).max() < 0.25), drive.common.any()
    (2000, True, np.False_)
    """

    parts: tuple[tuple[str, float], ...]

    def __post_init__(self) -> None:
        for kind, share in self.parts:
            if kind not in KINDS:
                raise ModelError(f"no experiment {kind!r}; there are {', '.join(KINDS)}")
            if not share > 0:
                raise ModelError(f"experiment {kind}: its share {share:g} is not positive")
        if not self.parts:
            raise ModelError(f"an experiment without parts; choose from {', '.join(KINDS)}")

    @staticmethod
    def of(*kinds: str) -> "Experiment":
        """Return an experiment of equally long parts."""
        return Experiment(tuple((kind, 1.0) for kind in kinds))

    def excitation(self, axis: VirtualAxis, fs: float, duration: float, seed: int) -> Excitation:
        """Return reference and common-mode command for `duration` [s] at `fs` [Hz]."""
        rng = np.random.default_rng([seed, 3])
        N = round(duration * fs)
        ends = np.cumsum([share for _, share in self.parts])
        edges = np.round(np.concatenate([[0.0], ends / ends[-1]]) * N).astype(int)
        x_ref, common = np.zeros(N), np.zeros(N)
        for (kind, _), first, last in zip(self.parts, edges[:-1], edges[1:], strict=True):
            t = np.arange(last - first) / fs
            x_ref[first:last], common[first:last] = KINDS[kind](axis, t, rng)
        reach = 0.36 * axis.stroke
        within = np.asarray(np.round(np.clip(x_ref, -reach, reach), 6), dtype=float)
        return Excitation(within, np.round(common, 4))


Drawn = tuple[FloatArray, FloatArray]


def _still(t: FloatArray) -> FloatArray:
    return np.zeros(t.size)


def _chirp(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Sweep from rest to 2 Hz, as the paper does."""
    end = max(t[-1], 1e-9)
    A = axis.stroke * rng.uniform(0.14, 0.2)
    return A * np.sin(np.pi * 2.0 * t**2 / end), _still(t)


def _squares(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Jump every second between both sides of mid-stroke, with random amplitudes."""
    jumps = int(t[-1]) + 1
    side = np.where(np.arange(jumps) % 2 == 0, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    levels = axis.stroke * rng.uniform(0.06, 0.28, jumps) * side
    return levels[t.astype(int)], _still(t)


def _chirp_and_squares(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    half = t.size // 2
    chirp, _ = _chirp(axis, t[:half], rng)
    squares, _ = _squares(axis, t[: t.size - half], rng)
    return np.concatenate([chirp, squares]), _still(t)


def _multisine(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Sum nine tones from 0.1 to 2.2 Hz of random phase, begun softly."""
    f = np.linspace(0.1, 2.2, 9) * rng.uniform(0.95, 1.05, 9)
    phase = rng.uniform(0, 2 * np.pi, 9)
    wave = np.sin(2 * np.pi * f[:, None] * t + phase[:, None]).sum(axis=0)
    largest = max(float(np.abs(wave).max()), 1e-9)
    A = axis.stroke * rng.uniform(0.2, 0.26)
    return A * wave / largest * np.minimum(t / 0.5, 1.0), _still(t)


def _steps(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Jump every 1.3 s to anywhere."""
    levels = axis.stroke * rng.uniform(-0.28, 0.28, int(t[-1] / 1.3) + 1)
    return levels[(t / 1.3).astype(int)], _still(t)


def _multisine_and_steps(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    cut = round(0.6 * t.size)
    multisine, _ = _multisine(axis, t[:cut], rng)
    levels, _ = _steps(axis, t[: t.size - cut], rng)
    return np.concatenate([multisine, levels]), _still(t)


def _creep(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Ramp up and down at 5, 15, 40 and 80 mm/s, each way at each of them.

    All are reduced by one factor where the way would be longer than a quarter of the stroke.
    """
    speeds = rng.permutation([0.005, 0.015, 0.04, 0.08])
    way = np.repeat(speeds, 2) * np.tile([1.0, -1.0], 4)
    leg = np.minimum((t / max(t[-1], 1e-9) * 8).astype(int), 7)
    x = np.cumsum(way[leg]) * (t[1] - t[0] if t.size > 1 else 0.0)
    reach = float(np.abs(x).max())
    return x * min(1.0, 0.25 * axis.stroke / max(reach, 1e-9)), _still(t)


def _holds(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Go fast to five places and stay there: pressures settle, leaks and heat show."""
    levels = axis.stroke * rng.permutation([-0.3, -0.15, 0.0, 0.15, 0.3])
    return levels[np.minimum((t / max(t[-1], 1e-9) * 5).astype(int), 4)], _still(t)


def _common_mode_steps(axis: VirtualAxis, t: FloatArray, rng: np.random.Generator) -> Drawn:
    """Sweep slowly while both valves are opened alike in steps: the mean pressure changes."""
    leak = axis.valve.leak_supply / axis.valve.k_supply + axis.valve.clearance
    levels = leak * rng.permutation([-1.0, -0.5, 0.0, 0.5, 1.0, 1.5])
    common = levels[np.minimum((t / max(t[-1], 1e-9) * 6).astype(int), 5)]
    A = axis.stroke * rng.uniform(0.1, 0.16)
    return A * np.sin(2 * np.pi * 0.6 * t), common


#: Kinds of experiment, by name.
KINDS: Mapping[str, Callable[[VirtualAxis, FloatArray, np.random.Generator], Drawn]] = (
    MappingProxyType(
        {
            "chirp_and_squares": _chirp_and_squares,
            "multisine_and_steps": _multisine_and_steps,
            "chirp": _chirp,
            "squares": _squares,
            "multisine": _multisine,
            "steps": _steps,
            "creep": _creep,
            "holds": _holds,
            "common_mode_steps": _common_mode_steps,
        }
    )
)
