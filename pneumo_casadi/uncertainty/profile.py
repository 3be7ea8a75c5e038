"""Profile likelihood: the cost of holding one quantity away from its estimate."""

import logging
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.output_error.derived import Quantity
from pneumo_casadi.output_error.problem import Unknowns
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.statistics import interval_factor
from pneumo_casadi.uncertainty.optimum import Optimum, solve
from pneumo_casadi.uncertainty.pull import held_at

logger = logging.getLogger(__name__)

#: Points that a side of a profile takes to its threshold where the cost is a parabola.
POINTS = 4
#: A side ends after so many points, or so many sizes of the quantity away.
MOST_POINTS, REACH = 30, 10.0
#: Steps grow at most by this, and are halved at most so often where a refit fails.
GROWTH, HALVINGS = 3.0, 3
#: Refits nearer to each other than this share of the first step tell nothing new.
NEAR = 0.2
#: Width at which a quantity is held, relative to the first step.
HELD = 1e-3
#: Decrease of twice the cost from which the fit was not at its optimum.
LOWER = 0.05


class End(Enum):
    """Why a side of a profile ends."""

    THRESHOLD = "the cost has risen to the threshold"
    BOUND = "a bound is reached below the threshold"
    FLAT = "the cost does not rise to the threshold within reach"
    FAILED = "no refit converged any further"


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """The least cost as a function of one quantity, all else fitted again at every value.

    Parameters
    ----------
    name, unit : str
        The quantity.
    values, costs : (n,) arrays
        Ascending; the estimate itself is among them. Costs are ½ Σ (residual/σ)².
    statuses : tuple of str
        Of each refit; those that failed have an infinite cost.
    estimate : float
        Where the cost is least.
    ends : (End, End)
        Why it goes no further down, and up.
    level : float
        The threshold was taken for this level.
    std, std_robust : float
        By the Gauss-Newton covariance, for white and for correlated residuals.
    """

    name: str
    unit: str
    values: FloatArray
    costs: FloatArray
    statuses: tuple[str, ...]
    estimate: float
    ends: tuple[End, End]
    level: float
    std: float
    std_robust: float

    @property
    def root(self) -> FloatArray:
        """±√(2 (cost - least cost)), shape (n,): a straight line where Gauss-Newton is exact."""
        rise = np.maximum(0.0, self.costs - float(self.costs[self.values == self.estimate][0]))
        found: FloatArray = np.where(self.values < self.estimate, -1.0, 1.0) * np.sqrt(2 * rise)
        return found

    def interval(self, level: float | None = None, robust: bool = False) -> tuple[float, float]:
        """Return where twice the cost has risen by the quantile of χ² with one degree of freedom.

        A side that does not rise so far is infinite.

        Parameters
        ----------
        level : float, optional
            At most that of the profile, which is the default.
        robust : bool, optional
            Whether the rise is measured against correlated residuals. The cost takes residuals
            for white: where they are not, twice its rise follows λ χ² with
            λ = (std_robust/std)² (Kent 1982), and the threshold is multiplied by that.

        Raises
        ------
        ModelError
            If the level is higher than that of the profile.
        """
        level = self.level if level is None else level
        if not 0 < level <= self.level:
            raise ModelError(f"the profile of {self.name} was taken for levels up to {self.level}")
        z = interval_factor(level) * (_inflation(self.std, self.std_robust) if robust else 1.0)
        low, high = (_crossing(self.values - self.estimate, self.root, side) for side in (-z, z))
        return self.estimate + low, self.estimate + high

    def gauss_newton(self, level: float | None = None, robust: bool = False) -> tuple[float, float]:
        """Return the symmetric interval of the Gauss-Newton covariance."""
        level = self.level if level is None else level
        half = interval_factor(level) * (self.std_robust if robust else self.std)
        return self.estimate - half, self.estimate + half

    @property
    def ratio(self) -> tuple[float, float]:
        """Length of each side of the interval over that of the Gauss-Newton one.

        (1, 1) says that the covariance tells all; NaN never: a side that is infinite in both
        counts as 1.
        """
        found = []
        for own, other in zip(self.interval(), self.gauss_newton(), strict=True):
            both = np.isinf(own) and np.isinf(other)
            ratio = 1.0 if both else abs(own - self.estimate) / abs(other - self.estimate)
            found.append(float(ratio))
        return found[0], found[1]


def profile_likelihood(optimum: Optimum, name: str, level: float = 0.95) -> Profile:
    """Profile the cost over a parameter or a derived quantity.

    From the estimate outwards the quantity is held at a value and everything else is fitted
    again, from its neighbour's solution, until twice the cost has risen by χ²₁ at `level` (by
    more where residuals are correlated, so that the robust interval is there too). Steps adapt
    to the slope of √(2 Δcost).

    Parameters
    ----------
    optimum : Optimum
        The fit and its data. Its noise is held, so that costs compare.
    name : str
        ``"M"``, say, or one of ``result.derived``, ``"k_P"``.
    level : float, optional
        Of confidence.

    Returns
    -------
    Profile

    Raises
    ------
    ModelError
        If there is no such quantity, or the parameter was not fitted.
    FitError
        If some value costs less than the estimate: the fit was not at its optimum. ``.partial``
        holds the profile.
    """
    walk = _Walk.begin(optimum, optimum.quantity(name), level)
    downwards, first = walk.side(-1.0)
    upwards, last = walk.side(1.0)
    points = [*reversed(downwards), _Point(walk.estimate, walk.cost, "converged"), *upwards]
    found = Profile(
        name,
        walk.item.unit,
        np.array([point.value for point in points]),
        np.array([point.cost for point in points]),
        tuple(point.status for point in points),
        walk.estimate,
        (first, last),
        level,
        walk.std,
        walk.std_robust,
    )
    at = int(np.argmin(found.costs))
    if 2 * (walk.cost - found.costs[at]) > LOWER:
        raise FitError(
            f"profile of {name}: cost {found.costs[at]:.8g} at {found.values[at]:g} is below "
            f"{walk.cost:.8g} at the estimate; fit again from there",
            found,
        )
    return found


def profile_likelihoods(
    optimum: Optimum,
    names: Sequence[str] | None = None,
    level: float = 0.95,
    executor: Executor | None = None,
) -> dict[str, Profile]:
    """Profile several quantities, by default all fitted parameters.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Profiles run in it side by side; processes should be spawned, not forked.
    """
    chosen = optimum.names if names is None else tuple(names)
    for name in chosen:
        optimum.quantity(name)
    task = partial(profile_likelihood, optimum, level=level)
    run = map if executor is None else executor.map
    return dict(zip(chosen, run(task, chosen), strict=True))


@dataclass(frozen=True, slots=True)
class _Point:
    value: float
    cost: float
    status: str


@dataclass(frozen=True, slots=True, eq=False)
class _Walk:
    """From the estimate outwards.

    Parameters
    ----------
    z, end : float
        Root of twice the rise of the cost at the level, and where a side ends: further out
        where residuals are correlated.
    first : float
        Length of the first step.
    size : float
        Of the quantity.
    bounds : (float, float)
        Of a parameter; infinite for derived quantities, whose parameters are bounded.
    direction : (n_free,) array
        How the fitted parameters go along with the quantity, to first order.
    """

    optimum: Optimum
    item: Quantity
    estimate: float
    cost: float
    std: float
    std_robust: float
    z: float
    end: float
    first: float
    size: float
    bounds: tuple[float, float]
    direction: FloatArray

    @classmethod
    def begin(cls, optimum: Optimum, item: Quantity, level: float) -> "_Walk":
        theta, parameters = optimum.point.theta, optimum.result.parameters
        std, std_robust = optimum.std(item), optimum.std(item, robust=True)
        z = interval_factor(level)
        end = z * max(1.0, _inflation(std, std_robust))
        gradient = item.gradient(theta)[optimum.columns]
        size = float(np.abs(gradient) @ optimum.sizes)
        bounds = (-np.inf, np.inf)
        if item.name in parameters:
            bounds = parameters[item.name].lower, parameters[item.name].upper
        first = end / POINTS * std if np.isfinite(std) else 0.1 * size
        cost = optimum.cost(optimum.problem, optimum.solution)
        direction = _direction(optimum, gradient)
        return cls(
            *(optimum, item, item(theta), cost, std, std_robust),
            *(z, end, first, size, bounds, direction),
        )

    def side(self, sign: float) -> tuple[list[_Point], End]:
        """Return the points of one side, from the estimate outwards, and why it ends."""
        points: list[_Point] = []
        at, value, root = self.optimum.point, self.estimate, 0.0
        step, halvings = self.first, 0
        bound = self.bounds[1 if sign > 0 else 0]
        while len(points) < MOST_POINTS:
            if value == bound:
                return _outwards(points, sign), End.BOUND
            if abs(value - self.estimate) >= REACH * self.size:
                return _outwards(points, sign), End.FLAT
            target = sign * min(sign * (value + sign * step), sign * bound)
            point, found = self.refit(at, target)
            points.append(point)
            if found is None:
                logger.warning("profile of %s at %g: %s", self.item.name, target, point.status)
                halvings, step = halvings + 1, abs(target - value) / 2
                if halvings > HALVINGS:
                    return _outwards(points, sign), End.FAILED
                continue
            rise = float(np.sqrt(2 * max(0.0, point.cost - self.cost)))
            if rise >= self.end:
                points += self.sharpened(at, [_Point(self.estimate, self.cost, ""), *points], sign)
                return _outwards(points, sign), End.THRESHOLD
            gain, moved = rise - root, abs(target - value)
            wanted = moved * (self.end / POINTS) / gain if gain > 0 else np.inf
            step = float(np.clip(wanted, moved / GROWTH, GROWTH * moved))
            at, value, root = found, target, rise
        return _outwards(points, sign), End.FLAT

    def sharpened(self, at: Unknowns, points: list[_Point], sign: float) -> list[_Point]:
        """Return refits where the points say that the thresholds are crossed."""
        found = []
        for z in sorted({self.z, self.end}):
            moved = np.array([point.value - self.estimate for point in points])
            rise = np.array([point.cost - self.cost for point in points])
            roots = sign * np.sqrt(2 * np.maximum(rise, 0.0))
            crossing = _crossing(moved, roots, sign * z)
            # A point very near says as much, and noise of two costs is no slope.
            if np.abs(moved - crossing).min() > NEAR * self.first:
                found.append(self.refit(at, self.estimate + crossing)[0])
        return [point for point in found if point.status == "converged"]

    def refit(self, at: Unknowns, target: float) -> tuple[_Point, Unknowns | None]:
        """Hold the quantity at a value and fit the rest, from a neighbour's solution."""
        optimum, width = self.optimum, HELD * self.first
        theta = at.theta.copy()
        free = optimum.columns
        moved = theta[free] + (target - self.item(theta)) * self.direction
        lower, upper = optimum.result.parameters.lower, optimum.result.parameters.upper
        theta[free] = np.clip(moved, lower[free], upper[free])
        problem = optimum.refined(optimum.problem, theta)
        held = held_at(problem, self.item, target, width)
        solution = solve(optimum, held, replace(at, theta=theta))
        if solution.status != "converged":
            return _Point(target, np.inf, solution.status), None
        if abs(self.item(solution.point.theta) - target) > 10 * width:
            return _Point(target, np.inf, "out of reach within the bounds"), None
        cost = optimum.cost(problem, solution)
        return _Point(target, cost, "converged"), solution.point


def _outwards(points: list[_Point], sign: float) -> list[_Point]:
    """Sort the points of a side: after a failed refit shorter steps were taken."""
    return sorted(points, key=lambda point: sign * point.value)


def _direction(optimum: Optimum, gradient: FloatArray) -> FloatArray:
    """Return dθ/dg along the profile, from the covariance where there is one."""
    covariance = optimum.result.estimate.covariance
    known = np.isfinite(np.diag(covariance))
    if np.all(known[gradient != 0]):
        along: FloatArray = np.where(known[:, None] & known, covariance, 0.0) @ gradient
    else:
        along = gradient * optimum.sizes**2
    found: FloatArray = along / float(gradient @ along)
    return found


def _inflation(std: float, robust: float) -> float:
    """Return how much wider correlated residuals make an interval; 1 without an interval."""
    return robust / std if 0 < std < np.inf and np.isfinite(robust) else 1.0


def _crossing(moved: FloatArray, roots: FloatArray, z: float) -> float:
    """Return how far from the estimate the root is z, infinite if it never is."""
    sign = float(np.sign(z))
    good = np.isfinite(roots) & (sign * moved >= 0)
    order = np.argsort(sign * moved[good])
    moved, roots = moved[good][order], sign * roots[good][order]
    above = np.flatnonzero(roots >= abs(z))
    if above.size == 0:
        return sign * np.inf
    # As far as the first crossing and one point beyond, as far as the root rises.
    moved, roots = moved[: above[0] + 2], roots[: above[0] + 2]
    rising = np.concatenate([[True], roots[1:] > np.maximum.accumulate(roots)[:-1]])
    return float(PchipInterpolator(roots[rising], moved[rising])(abs(z)))
