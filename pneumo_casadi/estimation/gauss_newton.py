"""Bounded Gauss-Newton steps with Levenberg-Marquardt damping.

A step minimises the linearised cost ½ |e + A δ|² + ½ λ δᵀ diag(AᵀA) δ within the bounds of the
parameters. The damping λ falls after a step that keeps what the linearisation predicts, and rises
after a step that is rejected, so that no accepted step raises the cost.

`scipy.optimize.least_squares` is not used here, because it asks for a dense Jacobian and a fixed
sum of squares: output error has only condensed normal equations, and both estimators estimate the
noise anew at each point. It does the small dense fits of `valve`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.optimize import lsq_linear

from pneumo_casadi.parameters import FloatArray

#: Eigenvalues of the information below this share of the largest take no step.
RANK_TOLERANCE = 1e-13


@dataclass(frozen=True, slots=True)
class Damping:
    """How the damping λ follows from one step to the next.

    Parameters
    ----------
    start : float
        First λ, as a share of the diagonal of the information.
    accept : float
        Share of the predicted decrease of the cost that a step must exceed to be accepted.
    trust : float
        Share above which λ falls.
    fall, grow : float
        λ is divided by `fall` after a trusted step, and multiplied by `grow` after a rejected one.
    least, most : float
        λ never falls below `least`; beyond `most` no step helps.
    least_after_rejection : float
        λ is at least this after a rejected step.
    max_rejections : int
        Rejected steps at one point after which no step helps.
    """

    start: float
    accept: float
    trust: float
    fall: float
    grow: float
    least: float = 0.0
    most: float = np.inf
    least_after_rejection: float = 0.0
    max_rejections: int = 1000

    def after(self, damping: FloatArray, share: FloatArray) -> FloatArray:
        """Return λ after steps that kept a share of what was predicted; arrays broadcast.

        Examples
        --------
        >>> schedule = Damping(start=1e-3, accept=0.1, trust=0.5, fall=5.0, grow=5.0)
        >>> schedule.after(np.full(3, 1.0), np.array([0.9, 0.3, -2.0]))
        array([0.2, 1. , 5. ])
        """
        fallen = np.maximum(self.least, damping / self.fall)
        risen = np.maximum(damping * self.grow, self.least_after_rejection)
        rejected = ~(np.asarray(share) > self.accept)  # a share that is no number is rejected
        return np.where(share > self.trust, fallen, np.where(rejected, risen, damping))


class HasCost(Protocol):
    """A point of the problem, or the problem linearised there."""

    @property
    def cost(self) -> float:
        """What is minimised."""


class HasGain(Protocol):
    """A step."""

    @property
    def gain(self) -> float:
        """Decrease of the cost that the linearised problem predicts."""


Point = TypeVar("Point", bound=HasCost)
Linear = TypeVar("Linear", bound=HasCost)
Step = TypeVar("Step", bound=HasGain)


class LeastSquaresProblem(Protocol[Point, Linear, Step]):
    """What `minimise` asks of a problem."""

    def linearise(self, point: Point) -> Linear:
        """Linearise the problem at a point."""

    def step(self, linear: Linear, damping: float) -> Step | None:
        """Return the bounded, damped step; None where the linearisation is not finite."""

    def settled(self, linear: Linear, step: Step, damping: float, costs: Sequence[float]) -> bool:
        """Tell whether a step is too small to matter; `costs` are those of all points so far."""

    def take(self, linear: Linear, step: Step, iteration: int) -> Point:
        """Return the point at the end of a step."""


class Status(Enum):
    """Why the iteration ended."""

    CONVERGED = "converged"
    NO_STEP_HELPS = "no step helps"
    NOT_FINITE = "the model ran away from the data"
    EXHAUSTED = "iterations exhausted"


@dataclass(frozen=True, slots=True)
class Minimum(Generic[Point, Linear]):
    """Where the iteration ended.

    Parameters
    ----------
    point : Point
        The best point.
    linear : Linear or None
        The last linearisation, at `point` unless iterations were exhausted; None without any.
    status : Status
        Why it ended.
    trials : int
        Steps computed, rejected ones included.
    costs : tuple of float
        Cost of every point that was linearised.
    """

    point: Point
    linear: Linear | None
    status: Status
    trials: int
    costs: tuple[float, ...]


def minimise(
    problem: LeastSquaresProblem[Point, Linear, Step],
    start: Point,
    damping: Damping,
    max_iterations: int,
    max_trials: int,
) -> Minimum[Point, Linear]:
    """Minimise a sum of squares by damped Gauss-Newton steps.

    Parameters
    ----------
    problem : LeastSquaresProblem
        Linearises the problem and computes its steps.
    start : Point
        First point.
    damping : Damping
        Schedule of λ.
    max_iterations : int
        Accepted steps before giving up.
    max_trials : int
        Accepted and rejected steps before giving up.

    Returns
    -------
    Minimum
    """
    point, value, costs = start, damping.start, list[float]()
    linear: Linear | None = None
    last: Linear | None = None
    rejections = 0
    for trial in range(1, max_trials + 1):
        if linear is None:
            if len(costs) == max_iterations:
                return Minimum(point, last, Status.EXHAUSTED, trial - 1, tuple(costs))
            last = linear = problem.linearise(point)
            costs.append(linear.cost)
            rejections = 0
        step = problem.step(linear, value)
        if step is None:
            return Minimum(point, linear, Status.NOT_FINITE, trial, tuple(costs))
        if problem.settled(linear, step, value, costs):
            return Minimum(point, linear, Status.CONVERGED, trial, tuple(costs))
        ahead = problem.take(linear, step, len(costs))
        share = (linear.cost - ahead.cost) / max(step.gain, 1e-300)
        value = float(damping.after(np.asarray(value), np.asarray(share)))
        if share > damping.accept:
            point, linear = ahead, None
            continue
        rejections += 1
        if value > damping.most or rejections >= damping.max_rejections:
            return Minimum(point, linear, Status.NO_STEP_HELPS, trial, tuple(costs))
    return Minimum(point, last, Status.EXHAUSTED, max_trials, tuple(costs))


def minimise_in_box(
    H: FloatArray, g: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """Minimise ½ δᵀHδ - gᵀδ within a box.

    Directions without information in H take no step.

    Parameters
    ----------
    H : (n, n) array
        Positive semidefinite.
    g, lower, upper : (n,) array
        Negative gradient at δ = 0, and bounds of δ; 0 lies between them.

    Returns
    -------
    (n,) array

    Examples
    --------
    >>> minimise_in_box(np.eye(2), np.array([2.0, 0.5]), -np.ones(2), np.ones(2))
    array([1. , 0.5])
    """
    if g.size == 0:
        return g
    diagonal = np.diag(H)
    # What is left of a parameter without information is rounding: it takes no step.
    informed = diagonal > RANK_TOLERANCE**2 * diagonal.max()
    size = np.sqrt(np.where(informed, diagonal, 1.0))
    values, vectors = np.linalg.eigh(H * np.outer(informed, informed) / np.outer(size, size))
    good = values > RANK_TOLERANCE * values[-1]
    root = np.sqrt(values[good])
    basis = vectors[:, good]
    unbounded: FloatArray = basis @ ((basis.T @ (g / size)) / root**2) / size
    if np.all(unbounded >= lower) and np.all(unbounded <= upper):
        return unbounded
    A = (basis * root).T * size
    b = (basis.T @ (g / size)) / root
    # lsq_linear needs a box with an inside: a parameter at its bound gets a width of 1e-12.
    width = 1e-12
    box = (np.minimum(lower, -width), np.maximum(upper, width))
    bounded: FloatArray = np.clip(lsq_linear(A, b, box, method="bvls").x, lower, upper)
    return bounded
