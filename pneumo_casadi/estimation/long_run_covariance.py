"""Covariance of a sum of correlated vectors, from the scatter of their sums over batches.

The vectors are scores of the residuals that a fit has left. Summed over batches longer than their
correlation they scatter as the noise does, but for what the fit has taken from it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from pneumo_casadi.parameters import FloatArray

#: At least so many batches tell how a sum scatters.
BATCHES = 20
#: Chance of finding correlation in white noise, over all lengths compared.
FALSE_ALARM = 0.05
#: No variance is given fewer degrees of freedom: Student's variance has none at 2.
FEWEST = 4.0
#: Eigenvalues below this share of the largest are rounding.
RANK_TOLERANCE = 1e-13
#: Of a Gaussian fourth moment, 3 σ⁴, that is more than the square of the variance.
OWN = 2 / 3


def long_run_covariance(kinds: Sequence[Sequence[FloatArray]]) -> FloatArray:
    """Return the covariance of the sum of all vectors, ready for normal quantiles.

    Parameters
    ----------
    kinds : sequence of sequences of (K, p) array
        Data of one kind (all records, the points of a flow map) share a noise and how long it
        correlates. One array a record, in the order of time; records are independent.

    Returns
    -------
    (p, p) array

    Notes
    -----
    How long correlation lasts is not known beforehand. Batches of L = 1, 2, 4, ... rows are tried
    and the shortest taken whose variance no longer ones clearly exceed (Lepski's rule; all
    comparisons together err in 5 % of white noises): first for all directions of a kind at once,
    because noise is common to them and many directions know it well, then longer ones for each
    component that asks for them, because misfit need not be common. Four things count beside:

    - Batches differ. With shares v_b of a component's variance they scatter like 1 / Σ v_b² equal
      ones.
    - The fit has taken its part. In units in which the whole information is 1, a batch of
      information G_b under noise c times as strong as white noise has lost 2 c G_b² - G_b W G_b,
      with W the covariance of the whole sum; this is added (for c = 1 the correction of Bell and
      McCaffrey 2002). Outer products of the rows stand for G_b.
    - Batches cut correlation at their ends, in proportion to 1 / L. Where L > 1, twice the
      variance of batches of 2 L less that of L is free of that (lugsail, Vats and Flegal 2022).
    - A variance of ν degrees of freedom is multiplied by ν / (ν - 2), as Student's is.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white = rng.normal(size=4000)
    >>> slow = np.repeat(rng.normal(size=80), 50)
    >>> [round(float(np.sqrt(long_run_covariance([[e[:, None]]])[0, 0] / 4000)), 1) for e in
    ...  (white, slow)]
    [1.0, 7.6]
    """
    root, inverse = _roots(np.concatenate([part for kind in kinds for part in kind]))
    found = [_batch([part @ inverse for part in kind], root) for kind in kinds]
    whole = np.asarray(sum(one.inflation * one.information for one in found))
    covariance, scatter = np.zeros((root.shape[1],) * 2), np.zeros(root.shape[1])
    for one in found:
        own, own_scatter = _covariance(one, whole)
        covariance += own
        scatter += own_scatter
    size = np.diag(covariance) ** 2
    dof = np.divide(size, scatter, out=np.full(size.size, np.inf), where=scatter > 0)
    widening = 1 / np.sqrt(1 - 2 / np.maximum(dof, FEWEST))
    widened: FloatArray = covariance * np.outer(widening, widening)
    return widened


def _roots(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return R (r, p) with RᵀR = rowsᵀ rows, and its pseudo-inverse; r is the rank."""
    total = rows.T @ rows
    size = np.sqrt(np.diag(total))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(total / np.outer(size, size))
    strong = values > RANK_TOLERANCE * max(float(values.max(initial=0.0)), 1e-300)
    stretch, directions = np.sqrt(values[strong]), vectors[:, strong]
    return (directions * stretch).T * size, directions / stretch / size[:, None]


@dataclass(frozen=True, slots=True)
class _Batches:
    """Vectors of one kind in batches of 1, 2, 4, ... rows, in r whitened directions.

    Parameters
    ----------
    parts : list of (K, r) array
        The vectors.
    root : (r, p) array
        Back to components.
    lengths : tuple of int
        Rows a batch.
    sums : list of (n, r) array
        Sums over batches, for each length.
    squares : list of (r, r) array
        Σ G_b², for each length.
    shares : (lengths, p) array
        Σ v_b² of each component, v_b its share in batch b.
    level : int
        Which length suffices for all directions together.
    inflation : float
        Variance of the sum over that of white noise.
    """

    parts: list[FloatArray]
    root: FloatArray
    lengths: tuple[int, ...]
    sums: list[FloatArray]
    squares: list[FloatArray]
    shares: FloatArray
    level: int
    inflation: float

    @property
    def information(self) -> FloatArray:
        """What this kind adds to the whole information, (r, r)."""
        return self.sums[0].T @ self.sums[0]


def _batch(parts: list[FloatArray], root: FloatArray) -> _Batches:
    rows = sum(len(part) for part in parts)
    lengths = [1]
    while rows // (2 * lengths[-1]) >= BATCHES:
        lengths.append(2 * lengths[-1])
    sums = [_sums(parts, length) for length in lengths]
    squares = _squares(parts, lengths)
    own = [(part @ root) ** 2 for part in parts]
    fourth = OWN * sum((part**2).sum(axis=0) for part in own)
    shares = np.array([(_sums(own, length) ** 2).sum(axis=0) for length in lengths]) - fourth
    whole = np.asarray(sum(part.sum(axis=0) for part in own)) ** 2
    shares = np.divide(shares, whole, out=np.zeros_like(shares), where=whole > 0)
    white = max(float((sums[0] ** 2).sum()), 1e-300)
    taken = np.array([np.trace(square) for square in squares]) / white
    variances = np.array([(one**2).sum() for one in sums]) / white / (1 - np.minimum(taken, 0.9))
    level = int(_shortest(variances[:, None], (taken / white)[:, None])[0])
    inflation = float(_without_ends(variances[:, None], np.array([level]))[0])
    return _Batches(parts, root, tuple(lengths), sums, squares, shares, level, inflation)


def _sums(parts: list[FloatArray], length: int) -> FloatArray:
    """Return sums over successive rows; the last batch of a part may be shorter."""
    return np.concatenate(
        [np.add.reduceat(part, np.arange(0, len(part), length), axis=0) for part in parts]
    )


def _squares(
    parts: list[FloatArray], lengths: Sequence[int], weight: FloatArray | None = None
) -> list[FloatArray]:
    """Return Σ G_b W G_b over batches of each length, (r, r), G_b from outer products of rows.

    A row's square by itself holds e⁴, three times what is wanted.
    """
    r = parts[0].shape[1]
    W = np.eye(r) if weight is None else weight
    found = [np.zeros((r, r)) for _ in lengths]
    for part in parts:
        weighted = part if weight is None else part @ weight
        own = OWN * part.T @ (part * np.sum(weighted * part, axis=1)[:, None])
        for total, length in zip(found, lengths, strict=True):
            z = _padded(part, length)
            if length <= r:  # the rows' products are fewer than those of the directions
                products = _padded(weighted, length) @ z.transpose(0, 2, 1)
                total += z.reshape(-1, r).T @ (products @ z).reshape(-1, r)
            else:
                G = z.transpose(0, 2, 1) @ z
                total += (G @ W @ G).sum(axis=0)
            total -= own
    return found


def _padded(part: FloatArray, length: int) -> FloatArray:
    """Return rows by batches, (n, length, r), the last filled up with zeros."""
    n = -(-len(part) // length)
    padded = np.zeros((n * length, part.shape[1]))
    padded[: len(part)] = part
    return padded.reshape(n, length, -1)


def _shortest(variances: FloatArray, shares: FloatArray) -> NDArray[np.intp]:
    """Return, per column, the first row that no later one clearly exceeds, the last left out.

    The last is kept for `_without_ends`.
    """
    rows = max(1, len(variances) - 1)
    doubt = stats.norm.ppf(1 - FALSE_ALARM / max(1, rows * (rows - 1) // 2))
    chosen = np.full(variances.shape[1], rows - 1, dtype=np.intp)
    for i in range(rows - 2, -1, -1):
        # Batches are nested: their variances differ by the scatter of the longer ones alone.
        scatter = np.sqrt(2 * np.maximum(shares[i + 1 : rows] - shares[i], 0.0))
        exceeds = variances[i + 1 : rows] > variances[i] * (1 + doubt * scatter)
        chosen[~exceeds.any(axis=0)] = i
    return chosen


def _without_ends(variances: FloatArray, level: NDArray[np.intp]) -> FloatArray:
    """Return variances at a row per column, free of the ends that batches cut."""
    column = np.arange(variances.shape[1])
    short = variances[level, column]
    long = variances[np.minimum(level + 1, len(variances) - 1), column]
    return np.where(level > 0, np.maximum(2 * long - short, long / 2), short)


def _covariance(own: _Batches, whole: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a kind's covariance (p, p) and the scatter of its variances (squared over 2), (p,)."""
    R = own.root
    levels = []
    crossed = _squares(own.parts, own.lengths, whole)
    for sums, square, cross in zip(own.sums, own.squares, crossed, strict=True):
        taken = 2 * own.inflation * square - cross
        levels.append(((sums @ R) ** 2).sum(axis=0) + np.sum(R * (taken @ R), axis=0))
    # What is left of nothing may be rounding below zero.
    variances = np.maximum(np.array(levels), 0.0)
    chosen = np.maximum(own.level, _shortest(variances, own.shares))
    variance = _without_ends(variances, chosen)
    at = np.minimum(chosen + 1, len(variances) - 1)
    column = np.arange(R.shape[1])
    shares = own.shares[chosen, column]
    shares = np.where(chosen > 0, 4 * own.shares[at, column] - 3 * shares, shares)
    # Correlations come from the longest batches that a component asks for.
    longest = own.sums[int(at[chosen.argmax()] if chosen.any() else 0)] @ R
    shape = longest.T @ longest
    size = np.diag(shape)
    stretch = np.sqrt(np.divide(variance, size, out=np.zeros(size.size), where=size > 0))
    return shape * np.outer(stretch, stretch), shares * variance**2
