"""Profile likelihood: the cost of holding one quantity away from its estimate."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.statistics import interval_factor
from pneumo_casadi.estimation.uncertainty.optimum import Optimum
from pneumo_casadi.estimation.uncertainty.profile_path import (
    ProfileEnd,
    ProfilePoint,
    ProfileTrace,
    find_crossing,
    robust_ratio,
)
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.threads import one_thread

#: Decrease of twice the cost from which the fit was not at its optimum.
LOWER = 0.05


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
    ends: tuple[ProfileEnd, ProfileEnd]
    level: float
    std: float
    std_robust: float

    @property
    def root(self) -> FloatArray:
        """±√(2 (cost - least cost)), shape (n,): a straight line where Gauss-Newton is exact."""
        rise = np.maximum(0.0, self.costs - float(self.costs[self.values == self.estimate][0]))
        root: FloatArray = np.where(self.values < self.estimate, -1.0, 1.0) * np.sqrt(2 * rise)
        return root

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
        z = interval_factor(level) * (robust_ratio(self.std, self.std_robust) if robust else 1.0)
        low, high = (
            find_crossing(self.values - self.estimate, self.root, side) for side in (-z, z)
        )
        return self.estimate + low, self.estimate + high

    def gauss_newton(self, level: float | None = None, robust: bool = False) -> tuple[float, float]:
        """Return the symmetric interval of the Gauss-Newton covariance."""
        level = self.level if level is None else level
        half = interval_factor(level) * (self.std_robust if robust else self.std)
        return self.estimate - half, self.estimate + half

    @property
    def ratio(self) -> tuple[float, float]:
        """Length of each side of the interval over that of the Gauss-Newton one.

        (1, 1) where the covariance is exact. A side that is infinite in both counts as 1, so that
        it is never NaN.
        """
        ratios = []
        for own, other in zip(self.interval(), self.gauss_newton(), strict=True):
            both = np.isinf(own) and np.isinf(other)
            ratio = 1.0 if both else abs(own - self.estimate) / abs(other - self.estimate)
            ratios.append(float(ratio))
        return ratios[0], ratios[1]


@one_thread
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
    trace = ProfileTrace.begin(optimum, optimum.quantity(name), level)
    downwards, first = trace.trace_side(-1.0)
    upwards, last = trace.trace_side(1.0)
    points = [*reversed(downwards), ProfilePoint(trace.estimate, trace.cost, "converged"), *upwards]
    profile = Profile(
        name,
        trace.item.unit,
        np.array([point.value for point in points]),
        np.array([point.cost for point in points]),
        tuple(point.status for point in points),
        trace.estimate,
        (first, last),
        level,
        trace.std,
        trace.std_robust,
    )
    at = int(np.argmin(profile.costs))
    if 2 * (trace.cost - profile.costs[at]) > LOWER:
        raise FitError(
            f"profile of {name}: cost {profile.costs[at]:.8g} at {profile.values[at]:g} is below "
            f"{trace.cost:.8g} at the estimate; fit again from there",
            profile,
        )
    return profile


def profile_likelihoods(
    optimum: Optimum,
    names: Sequence[str] | None = None,
    level: float = 0.95,
    executor: Executor | None = None,
) -> dict[str, Profile]:
    """Profile several quantities, by default all fitted parameters.

    Parameters
    ----------
    optimum : Optimum
        The fit and its data.
    names : sequence of str, optional
        Parameters or derived quantities.
    level : float, optional
        Largest level of the intervals that are wanted [1].
    executor : concurrent.futures.Executor, optional
        Profiles run in it side by side; processes should be spawned, not forked.

    Returns
    -------
    dict of str to Profile
        By name, in the order asked for.
    """
    chosen = optimum.names if names is None else tuple(names)
    for name in chosen:
        optimum.quantity(name)
    task = partial(profile_likelihood, optimum, level=level)
    run = map if executor is None else executor.map
    return dict(zip(chosen, run(task, chosen), strict=True))
