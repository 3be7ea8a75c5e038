"""Groups of parameters that do nearly the same to the data."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pneumo_casadi.parameters import FloatArray

#: A third parameter belongs to a group if the index grows at least by this with it.
ADDS = 2.0


@dataclass(frozen=True, slots=True)
class CollinearGroup:
    """Parameters of which one can make up for the others.

    Parameters
    ----------
    names : tuple of str
        Two or three.
    index : float
        γ = 1/√λ with the smallest eigenvalue λ of their normalised information (Brun, Reichert
        and Künsch 2001): a change of one of them can be made up for by the others to a share 1/γ.
    """

    names: tuple[str, ...]
    index: float


def collinear_groups(
    information: FloatArray, names: Sequence[str], limit: float = 10.0
) -> tuple[CollinearGroup, ...]:
    """Return pairs and triples whose collinearity index exceeds a limit, worst first.

    Parameters
    ----------
    information : (n, n) array
        Positive semidefinite; its scale does not matter. Parameters without information of
        their own are left out.
    names : sequence of str
        Parameters, in order.
    limit : float, optional
        Brun, Reichert and Künsch take 5 to 20 for critical. All other parameters count as
        known here.

    Returns
    -------
    tuple of CollinearGroup
        A triple only where none of its pairs explains it: its index is `ADDS` times theirs.

    Examples
    --------
    >>> J = np.array([[1.0, 1.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 1.0]])
    >>> [(g.names, round(g.index)) for g in collinear_groups(J.T @ J, ["a", "b", "c"])]
    [(('a', 'b'), 141)]
    """
    size = np.sqrt(np.maximum(np.diag(information), 0.0))
    known = [int(i) for i in np.flatnonzero(size > 0)]
    pairs = _indices(information, size, list(combinations(known, 2)))
    groups = [(pair, index) for pair, index in pairs.items() if index > limit]
    for members, index in _indices(information, size, list(combinations(known, 3))).items():
        if index > max(limit, ADDS * max(pairs[pair] for pair in combinations(members, 2))):
            groups.append((members, index))
    groups.sort(key=lambda item: -item[1])
    return tuple(CollinearGroup(tuple(names[i] for i in at), value) for at, value in groups)


def _indices(
    information: FloatArray, size: FloatArray, sets: list[tuple[int, ...]]
) -> dict[tuple[int, ...], float]:
    """Return the collinearity index of each set of equally many parameters."""
    if not sets:
        return {}
    at = np.array(sets)
    scale = size[at]
    N = information[at[:, :, None], at[:, None, :]] / (scale[:, :, None] * scale[:, None, :])
    smallest = np.maximum(np.linalg.eigvalsh(N)[:, 0], np.finfo(float).eps)
    return dict(zip(sets, (1 / np.sqrt(smallest)).tolist(), strict=True))


def correlated_clusters(
    correlation: FloatArray, names: Sequence[str], limit: float = 0.95
) -> tuple[tuple[str, ...], ...]:
    """Return clusters joined by correlations of the estimates beyond a limit, largest first.

    Unlike the collinearity index, correlation knows that all other parameters were estimated
    too.

    Parameters
    ----------
    correlation : (n, n) array
        Of the estimates [1].
    names : sequence of str
        Of the n parameters.
    limit : float, optional
        Magnitude above which two of them are joined [1].

    Examples
    --------
    >>> C = np.array([[1.0, 0.99, 0.0], [0.99, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> correlated_clusters(C, ["a", "b", "c"])
    (('a', 'b'),)
    """
    joined = np.abs(correlation) > limit
    left, clusters = set(range(len(names))), []
    while left:
        cluster, new = set(), {min(left)}
        while new:
            cluster |= new
            new = {int(j) for i in new for j in np.flatnonzero(joined[i])} - cluster
        left -= cluster
        if len(cluster) > 1:
            clusters.append(tuple(names[i] for i in sorted(cluster)))
    return tuple(sorted(clusters, key=lambda cluster: -len(cluster)))
