"""The points of a profile: one quantity held at values ever further from its estimate."""

import logging
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from scipy.interpolate import PchipInterpolator

from pneumo_casadi.estimation.output_error.derived import Quantity
from pneumo_casadi.estimation.output_error.shooting.problem import Unknowns
from pneumo_casadi.estimation.statistics import interval_factor
from pneumo_casadi.estimation.uncertainty.added_residuals import hold_quantity
from pneumo_casadi.estimation.uncertainty.optimum import Optimum, solve_from
from pneumo_casadi.parameters import FloatArray

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


class ProfileEnd(Enum):
    """Why a side of a profile ends."""

    THRESHOLD = "the cost has risen to the threshold"
    BOUND = "a bound is reached below the threshold"
    FLAT = "the cost does not rise to the threshold within reach"
    FAILED = "no refit converged any further"


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """One refit: the value held, the cost (infinite if it failed) and the status."""

    value: float
    cost: float
    status: str


@dataclass(frozen=True, slots=True, eq=False)
class ProfileTrace:
    """Traces a profile from the estimate outwards, on either side.

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
        Change of the fitted parameters with the quantity, to first order.
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
    def begin(cls, optimum: Optimum, item: Quantity, level: float) -> "ProfileTrace":
        """Return the trace of a quantity, as far as a level needs."""
        theta, parameters = optimum.point.theta, optimum.result.parameters
        std, std_robust = optimum.std(item), optimum.std(item, robust=True)
        z = interval_factor(level)
        end = z * max(1.0, robust_ratio(std, std_robust))
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

    def trace_side(self, sign: float) -> tuple[list[ProfilePoint], ProfileEnd]:
        """Return the points of one side, from the estimate outwards, and why it ends."""
        points: list[ProfilePoint] = []
        at, value, root = self.optimum.point, self.estimate, 0.0
        step, halvings = self.first, 0
        bound = self.bounds[1 if sign > 0 else 0]
        while len(points) < MOST_POINTS:
            if value == bound:
                return _outwards(points, sign), ProfileEnd.BOUND
            if abs(value - self.estimate) >= REACH * self.size:
                return _outwards(points, sign), ProfileEnd.FLAT
            target = sign * min(sign * (value + sign * step), sign * bound)
            point, refitted = self.refit(at, target)
            points.append(point)
            if refitted is None:
                logger.warning("profile of %s at %g: %s", self.item.name, target, point.status)
                halvings, step = halvings + 1, abs(target - value) / 2
                if halvings > HALVINGS:
                    return _outwards(points, sign), ProfileEnd.FAILED
                continue
            rise = float(np.sqrt(2 * max(0.0, point.cost - self.cost)))
            if rise >= self.end:
                points += self.refine_crossings(
                    at, [ProfilePoint(self.estimate, self.cost, ""), *points], sign
                )
                return _outwards(points, sign), ProfileEnd.THRESHOLD
            gain, moved = rise - root, abs(target - value)
            wanted = moved * (self.end / POINTS) / gain if gain > 0 else np.inf
            step = float(np.clip(wanted, moved / GROWTH, GROWTH * moved))
            at, value, root = refitted, target, rise
        return _outwards(points, sign), ProfileEnd.FLAT

    def refine_crossings(
        self, at: Unknowns, points: list[ProfilePoint], sign: float
    ) -> list[ProfilePoint]:
        """Return refits at the values where the thresholds are crossed by interpolation."""
        refits = []
        for z in sorted({self.z, self.end}):
            moved = np.array([point.value - self.estimate for point in points])
            rise = np.array([point.cost - self.cost for point in points])
            roots = sign * np.sqrt(2 * np.maximum(rise, 0.0))
            distance = find_crossing(moved, roots, sign * z)
            # A point very near is as good, and two costs that close give no slope.
            if np.abs(moved - distance).min() > NEAR * self.first:
                refits.append(self.refit(at, self.estimate + distance)[0])
        return [point for point in refits if point.status == "converged"]

    def refit(self, at: Unknowns, target: float) -> tuple[ProfilePoint, Unknowns | None]:
        """Hold the quantity at a value and fit the rest, from a neighbour's solution."""
        optimum, width = self.optimum, HELD * self.first
        theta = at.theta.copy()
        free = optimum.columns
        moved = theta[free] + (target - self.item(theta)) * self.direction
        lower, upper = optimum.result.parameters.lower, optimum.result.parameters.upper
        theta[free] = np.clip(moved, lower[free], upper[free])
        problem = optimum.refined(optimum.problem, theta)
        held = hold_quantity(problem, self.item, target, width)
        solution = solve_from(optimum, held, replace(at, theta=theta))
        if solution.status != "converged":
            return ProfilePoint(target, np.inf, solution.status), None
        if abs(self.item(solution.point.theta) - target) > 10 * width:
            return ProfilePoint(target, np.inf, "out of reach within the bounds"), None
        cost = optimum.cost(problem, solution)
        return ProfilePoint(target, cost, "converged"), solution.point


def _outwards(points: list[ProfilePoint], sign: float) -> list[ProfilePoint]:
    """Sort the points of a side: after a failed refit shorter steps were taken."""
    return sorted(points, key=lambda point: sign * point.value)


def _direction(optimum: Optimum, gradient: FloatArray) -> FloatArray:
    """Return dθ/dg along the profile, from the covariance where there is one."""
    covariance = optimum.result.uncertainty.covariance
    known = np.isfinite(np.diag(covariance))
    if np.all(known[gradient != 0]):
        change: FloatArray = np.where(known[:, None] & known, covariance, 0.0) @ gradient
    else:
        change = gradient * optimum.sizes**2
    direction: FloatArray = change / float(gradient @ change)
    return direction


def robust_ratio(std: float, robust: float) -> float:
    """Return how much wider correlated residuals make an interval; 1 without an interval."""
    return robust / std if 0 < std < np.inf and np.isfinite(robust) else 1.0


def find_crossing(moved: FloatArray, roots: FloatArray, z: float) -> float:
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
