"""Identifiability: which combinations of parameters the data fix, and which record does it."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.estimation.statistics import invert_information
from pneumo_casadi.estimation.uncertainty.collinearity import (
    CollinearGroup,
    collinear_groups,
    correlated_clusters,
)
from pneumo_casadi.estimation.uncertainty.optimum import Optimum
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.threads import one_thread

#: Share of the largest weight from which a parameter is named in a direction.
NAMED = 0.2
#: Directions up to rounding: their singular value over the largest.
NOTHING = 1e-7
#: The source beside the records.
FLOW_MAP = "flow map"


@dataclass(frozen=True, slots=True)
class Direction:
    """A combination of parameters, of unit length in units of their sizes.

    Parameters
    ----------
    relative_std : float
        How far the data leave it open, relative to the sizes; infinite without information.
    weights : dict of str to float
        The parameters with a part in it, largest first.
    """

    relative_std: float
    weights: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Identifiability:
    """What the data fix, and what fixes it. All relative to the size of each parameter.

    Parameters
    ----------
    names : tuple of str
        Fitted parameters, n of them.
    sizes : (n,) array
        Value or scale of each, whichever is larger, SI units.
    std : (n,) array
        Standard deviations, SI units: infinite without information and at a bound.
    at_bound, uninformed : tuple of str
        Parameters with an infinite interval, and why.
    singular_values : (m,) array
        Of the sensitivities of all weighted residuals to the parameters not at a bound, initial
        states projected out, largest first. A direction of unit length is known to 1/s.
    directions : tuple of Direction
        One for each singular value.
    correlation : (n, n) array
        Of the estimates; zero for infinite variances.
    collinear : tuple of CollinearGroup
        Pairs and triples that do nearly the same to the data, worst first.
    clusters : tuple of tuple of str
        Estimates joined by correlations beyond 0.95.
    sources : tuple of str
        Records by name, then ``"flow map"`` where its coefficients were fitted.
    share : (n_sources, n) array
        Of the information on each parameter, all others known, from each source; columns add up
        to 1 (to 0 without information).
    std_without : (n_sources, n) array
        Factor by which the standard deviation of each parameter grows, all others estimated,
        when a source is left out; infinite where no other source informs it. 1 where there is no
        standard deviation to begin with.
    """

    names: tuple[str, ...]
    sizes: FloatArray
    std: FloatArray
    at_bound: tuple[str, ...]
    uninformed: tuple[str, ...]
    singular_values: FloatArray
    directions: tuple[Direction, ...]
    correlation: FloatArray
    collinear: tuple[CollinearGroup, ...]
    clusters: tuple[tuple[str, ...], ...]
    sources: tuple[str, ...]
    share: FloatArray
    std_without: FloatArray

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        largest, smallest = float(self.singular_values[0]), float(self.singular_values[-1])
        return largest / smallest if smallest > 0 else float("inf")

    def weak(self, limit: float = 0.1) -> tuple[Direction, ...]:
        """Return the directions known no better than `limit` times their size, worst first."""
        return tuple(d for d in reversed(self.directions) if d.relative_std > limit)

    def informing(self, name: str) -> dict[str, float]:
        """Return the share of each source in the information on a parameter, largest first."""
        column = self.share[:, self.names.index(name)]
        order = np.argsort(-column, kind="stable")
        return {self.sources[i]: float(column[i]) for i in order}


@one_thread
def analyse_identifiability(
    optimum: Optimum, collinearity: float = 10.0, correlation: float = 0.95
) -> Identifiability:
    """Tell which parameters, and which combinations of them, the data of a fit fix.

    Parameters
    ----------
    optimum : Optimum
        The fit and its data.
    collinearity : float, optional
        Index from which a group is called collinear (Brun, Reichert and Künsch 2001: 5 to 20).
    correlation : float, optional
        From which two estimates belong to one cluster.

    Returns
    -------
    Identifiability

    Notes
    -----
    With the matrix S of sensitivities ∂m/∂θ · size/σ, initial states projected out, S = U Σ Vᵀ:
    the rows of Vᵀ are the directions. What a record informs counts its own initial states as
    unknown.
    """
    names, uncertainty = optimum.names, optimum.result.uncertainty
    inside = [i for i, name in enumerate(names) if name not in uncertainty.at_bound]
    H = optimum.information
    singular_values, directions = _directions(H[np.ix_(inside, inside)], [names[i] for i in inside])
    sources, parts = _sources(optimum)
    total = np.sum([np.diag(part) for part in parts], axis=0)
    share = np.array([np.diag(part) for part in parts]) / np.where(total > 0, total, 1.0)
    return Identifiability(
        names,
        optimum.sizes,
        uncertainty.std,
        uncertainty.at_bound,
        uncertainty.uninformed,
        singular_values,
        directions,
        uncertainty.correlation,
        collinear_groups(H[np.ix_(inside, inside)], [names[i] for i in inside], collinearity),
        correlated_clusters(uncertainty.correlation, names, correlation),
        sources,
        share,
        np.array([_growth(optimum, parts, i) for i in range(len(parts))]),
    )


def _directions(
    information: FloatArray, names: list[str]
) -> tuple[FloatArray, tuple[Direction, ...]]:
    """Return singular values and directions, best known first."""
    values, vectors = np.linalg.eigh(information)
    s = np.sqrt(np.maximum(values[::-1], 0.0))
    s = np.where(s > NOTHING * s.max(initial=0.0), s, 0.0)
    directions = []
    for value, vector in zip(s, vectors[:, ::-1].T, strict=True):
        order = np.argsort(-np.abs(vector), kind="stable")
        signed = vector * np.sign(vector[order[0]])
        large = [i for i in order if abs(vector[i]) >= NAMED * abs(vector[order[0]])]
        weights = {names[i]: float(signed[i]) for i in large}
        directions.append(Direction(float(1 / value) if value > 0 else float("inf"), weights))
    return s, tuple(directions)


def _sources(optimum: Optimum) -> tuple[tuple[str, ...], list[FloatArray]]:
    """Return what informs, and the information of each, in units of the sizes."""
    parts = [optimum.information_of(i) for i in range(len(optimum.records))]
    names = [record.name for record in optimum.records]
    if optimum.problem.anchor is not None:
        parts.append(optimum.information_of_map())
        names.append(FLOW_MAP)
    return tuple(names), parts


def _growth(optimum: Optimum, parts: list[FloatArray], left_out: int) -> FloatArray:
    """Return std without one source over std with all of them."""
    at_bound = optimum.result.uncertainty.at_bound
    rest = np.sum([part for i, part in enumerate(parts) if i != left_out], axis=0)
    rest = rest + np.zeros_like(parts[0])  # with one source nothing is left
    without = invert_information(rest, optimum.sizes, optimum.names, at_bound).std
    std = optimum.result.uncertainty.std
    finite = np.isfinite(std)
    growth: FloatArray = np.where(finite, without / np.where(finite, std, 1.0), 1.0)
    return growth
