"""How many Runge-Kutta steps a sample takes: many where friction is steep, few where it is flat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from pneumo_casadi.data import InputHold
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.parameters import FloatArray

#: Fastest rate times sampling period up to which a sample is one step.
ONE_STEP = 0.5
#: Length of a step times the fastest rate: accurate to a millionth of laboratory noise ...
ACCURATE = 1.0
#: ... and to a hundredth of it (0.1 Pa, 0.1 µm), in half the time.
COARSE = 2.0
#: Velocity over the width v_s from which on smoothed friction is flat (tanh 10 = 1 - 4e-9), and
#: how many times as far as its rate at the beginning says it may change over a sample.
FLAT, REACH = 10.0, 2.0
#: Speeds at which the poles of a moving axis are taken, besides the least one [m/s].
SPEEDS = (0.05, 0.5)


@dataclass(frozen=True, slots=True)
class Stepping:
    """How a sampled record is integrated.

    Parameters
    ----------
    dt : float
        Sampling period [s].
    hold : InputHold
        What the commands do between two samples.
    substeps : int
        Runge-Kutta steps of order four per sample; see `substeps_for`.
    timed : bool
        Whether every sample has a length of its own: the last value that it is given, over `dt`.
    moving : int, optional
        Steps of a sample over which `keeps_moving` holds; by default as many as of the others.
    """

    dt: float
    hold: InputHold = InputHold.ZERO
    substeps: int = 1
    timed: bool = False
    moving: int | None = None


def stepping_for(
    axis: Axis,
    dt: float,
    hold: InputHold = InputHold.ZERO,
    lengths: FloatArray | None = None,
    longest_step: float = ACCURATE,
    also: Sequence[Axis] = (),
) -> Stepping:
    """Return a stepping that keeps the axis' smoothed friction stable.

    `lengths` are those of timed samples over dt, see `sample_lengths`; the longest one counts.
    `longest_step` is the length of a step times the fastest rate, see `substeps_for`. `also` are
    further axes that the steps must suit.
    """
    longest = dt if lengths is None else dt * max(1.0, float(lengths.max()))
    axes = (axis, *also)
    return Stepping(
        dt,
        hold,
        max(substeps_for(each, longest, longest_step) for each in axes),
        lengths is not None,
        max(moving_substeps_for(each, longest, longest_step) for each in axes),
    )


def substeps_for(axis: Axis, dt: float, longest: float = ACCURATE) -> int:
    """Return the Runge-Kutta steps per sample that the axis needs at standstill to stay stable.

    There smoothed friction is steepest, (F_c⁺ + F_c⁻) / (2 M v_s) on the nominal axis, and
    effects add their own (a lag, Stribeck's force). RK4 is stable up to 2.78 times the fastest
    rate and accurate below about 1 per step, the `longest` one; a whole sample is taken in one step
    only below half of that, because such a step is long compared with all other time constants
    too.
    """
    rate = _fastest_rate(axis, 0.0)
    if not np.isfinite(rate):
        raise ModelError("the axis' equations are not finite at standstill; check its parameters")
    return _steps(dt * rate, longest)


def moving_substeps_for(axis: Axis, dt: float, longest: float = ACCURATE) -> int:
    """Return the Runge-Kutta steps that a sample needs over which `keeps_moving` holds.

    There smoothed friction is flat. What else is fast remains: the poles are taken at several
    speeds, with the states of effects at rest and by their typical sizes away from it.
    """
    most = substeps_for(axis, dt, longest)
    if most == 1:
        return 1
    least = FLAT * axis.parameters["v_s"].value
    moving = max(_fastest_rate_near(axis, v) for v in (least, *SPEEDS))
    return min(most, _steps(dt * moving, longest)) if np.isfinite(moving) else most


def keeps_moving(
    axis: Axis, x: Expression, u: Expression, theta: Expression, length: Expression
) -> Expression:
    """Tell whether smoothed friction stays flat over a sample that begins with x and u.

    The velocity then keeps `FLAT` widths v_s off zero, even if it changes `REACH` times as much
    as its rate at the beginning says.
    """
    at = axis.states.index("v")
    change = REACH * length * axis.rhs.call([x, u, theta])[0][at]
    return ca.fabs(x[at]) - ca.fabs(change) > FLAT * theta[axis.parameters.index("v_s")]


def _steps(rate: float, longest: float) -> int:
    """Return the steps of a sample whose length is given as a multiple of the fastest rate's."""
    if rate <= ONE_STEP:
        return 1
    # Few different counts: a small change of friction then seldom changes the step.
    count = 2
    while count * longest < rate:
        count = count * 3 // 2 if count & (count - 1) == 0 else count * 4 // 3
    return count


@lru_cache(maxsize=16)  # a simulation of windows asks several times for each record
def _fastest_rate_near(axis: Axis, speed: float) -> float:
    """Return the fastest rate at a speed in both directions, effects at rest and off it [1/s]."""
    return max(_rates_near(axis, speed))


def _fastest_rate(axis: Axis, v: float, away: FloatArray | float = 0.0) -> float:
    """Return the largest magnitude of the axis' poles at mid-stroke and a velocity [1/s].

    `away` is by how much the states lie off those at rest. Infinite where the poles are.
    """
    constants, theta = axis.constants, axis.parameters.values
    pressures = [(constants["p_supply"] + constants["p_ext"]) / 2 for _ in axis.kind.gas_chambers]
    u = axis.inputs_at_rest
    at_rest = axis.rest([*pressures, 0.0, v], u, theta).full().ravel()
    A = axis.slopes(at_rest + away, u, theta).full()
    return float(np.abs(np.linalg.eigvals(A)).max()) if np.isfinite(A).all() else float("inf")


def _rates_near(axis: Axis, speed: float) -> Iterator[float]:
    """Yield the fastest rates at a speed in both directions, effects at rest and off it."""
    own = len(axis.motion_states)
    shifts = np.diag(axis.state_scales)[own:]
    for v in (-speed, speed):
        for away in (np.zeros(len(axis.states)), *shifts, *-shifts):
            yield _fastest_rate(axis, v, away)
