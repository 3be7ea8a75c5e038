"""Robust covariance from batch sums, for many rows correlated for an unknown time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pneumo_casadi.parameters import FloatArray

#: Least number of batches from which a variance is estimated.
MIN_BATCHES = 20
#: Probability of finding correlation in white noise, over all batch lengths compared.
FALSE_ALARM = 0.05
#: Fewest degrees of freedom assumed for a variance: that of Student's t is infinite at 2.
MIN_DOF = 4.0
#: Eigenvalues below this share of the largest are rounding.
RANK_TOLERANCE = 1e-13
#: Share of a Gaussian fourth moment, 3 σ⁴, that exceeds the square of the variance.
EXCESS_OF_FOURTH_MOMENT = 2 / 3


def batch_sandwich(inverse: FloatArray, scores: Sequence[Sequence[FloatArray]]) -> FloatArray:
    """Return H⁻¹ S H⁻¹ with S from batch sums, for use with normal quantiles.

    Parameters
    ----------
    inverse : (p, p) array
        H⁻¹.
    scores : sequence of sequences of (K, p) array
        Scores by source of data: all records are one source, the points of a flow map another.
        Data of one source share the noise and the length of its correlation. One array per
        record, in the order of time; records are independent.

    Returns
    -------
    (p, p) array

    Notes
    -----
    The length of the correlation is unknown. Batches of L = 1, 2, 4, ... rows are compared, and
    the shortest L is taken whose variance no longer batch clearly exceeds (Lepski's rule; all
    comparisons together err for 5 % of white noises). First one L is chosen for all directions of
    a source, because they share the noise and many directions estimate its correlation well. Then
    a single component may ask for longer batches, because model error need not be shared. Four
    corrections follow:

    - Batches differ. With shares v_b of a component's variance, Σ v_b² takes the place of one
      over the number of batches in the scatter of the estimate.
    - The fit has removed a part of the residuals. In units in which the total information is 1, a
      batch of information G_b under noise c times as strong as white noise has lost
      2 c G_b² - G_b W G_b, with W the covariance of the total sum. This is added (for c = 1 the
      correction of Bell and McCaffrey 2002). Outer products of the rows stand for G_b.
    - Batches cut correlation at their ends, in proportion to 1 / L. Where L > 1, twice the
      variance of batches of 2 L less that of L is free of that (lugsail, Vats and Flegal 2022).
    - A variance with ν degrees of freedom is multiplied by ν / (ν - 2), that of Student's t.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> white = rng.normal(size=4000)
    >>> slow = np.repeat(rng.normal(size=80), 50)
    >>> [round(float(np.sqrt(batch_sandwich(np.eye(1), [[e[:, None]]])[0, 0] / 4000)), 1) for e in
    ...  (white, slow)]
    [1.0, 7.6]
    """
    influence = [[part @ inverse for part in source] for source in scores]
    root, whitening = _roots(np.concatenate([part for source in influence for part in source]))
    batches = [_batch_sums([part @ whitening for part in source], root) for source in influence]
    total = np.asarray(sum(source.inflation * source.information for source in batches))
    covariance, scatter = np.zeros((root.shape[1],) * 2), np.zeros(root.shape[1])
    for source in batches:
        source_covariance, source_scatter = _source_covariance(source, total)
        covariance += source_covariance
        scatter += source_scatter
    size = np.diag(covariance) ** 2
    dof = np.divide(size, scatter, out=np.full(size.size, np.inf), where=scatter > 0)
    widening = 1 / np.sqrt(1 - 2 / np.maximum(dof, MIN_DOF))
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
    """Influences of one source summed over batches of 1, 2, 4, ... rows, in r whitened directions.

    Parameters
    ----------
    parts : list of (K, r) array
        The influences.
    root : (r, p) array
        From whitened directions back to components.
    lengths : tuple of int
        Rows per batch.
    sums : list of (n, r) array
        Sums over batches, for each length.
    squares : list of (r, r) array
        Σ G_b², for each length.
    shares : (lengths, p) array
        Σ v_b² of each component, v_b its share in batch b.
    level : int
        Index of the length that suffices for all directions together.
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
        """Part of this source in the total information, (r, r)."""
        return self.sums[0].T @ self.sums[0]


def _batch_sums(parts: list[FloatArray], root: FloatArray) -> _Batches:
    rows = sum(len(part) for part in parts)
    lengths = [1]
    while rows // (2 * lengths[-1]) >= MIN_BATCHES:
        lengths.append(2 * lengths[-1])
    sums = _sums(parts, len(lengths))
    squares = _squares(parts, lengths)
    components = [(part @ root) ** 2 for part in parts]
    fourth = EXCESS_OF_FOURTH_MOMENT * sum((part**2).sum(axis=0) for part in components)
    shares = np.array([(held**2).sum(axis=0) for held in _sums(components, len(lengths))])
    shares = shares - fourth
    total = np.asarray(sum(part.sum(axis=0) for part in components)) ** 2
    shares = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0)
    white = max(float((sums[0] ** 2).sum()), 1e-300)
    removed = np.array([np.trace(square) for square in squares]) / white
    variances = np.array([(values**2).sum() for values in sums]) / white
    variances = variances / (1 - np.minimum(removed, 0.9))
    level = int(_shortest_sufficient(variances[:, None], (removed / white)[:, None])[0])
    inflation = float(_lugsail(variances[:, None], np.array([level]))[0])
    return _Batches(parts, root, tuple(lengths), sums, squares, shares, level, inflation)


def _sums(parts: list[FloatArray], levels: int) -> list[FloatArray]:
    """Return sums over 1, 2, 4, ... successive rows; the last batch of a part may be shorter."""
    held, result = parts, [np.concatenate(parts)]
    for _ in range(levels - 1):
        held = [_pairs(part) for part in held]
        result.append(np.concatenate(held))
    return result


def _pairs(batches: FloatArray) -> FloatArray:
    """Return sums of two successive batches; a last one without a partner stays as it is."""
    pairs = batches[:-1:2] + batches[1::2]
    return np.concatenate([pairs, batches[-1:]]) if len(batches) % 2 else pairs


def _squares(
    parts: list[FloatArray], lengths: Sequence[int], weight: FloatArray | None = None
) -> list[FloatArray]:
    """Return Σ G_b W G_b over batches of each length, (r, r), G_b from outer products of rows.

    The square of a single row holds e⁴, three times what is wanted: the excess is subtracted.
    """
    r = parts[0].shape[1]
    W = np.eye(r) if weight is None else weight
    totals = [np.zeros((r, r)) for _ in lengths]
    for part in parts:
        weighted = part if weight is None else part @ weight
        rows = part.T @ (part * np.sum(weighted * part, axis=1)[:, None])
        G: FloatArray | None = None
        for total, length in zip(totals, lengths, strict=True):
            if length == 1:
                total += rows
            elif length <= r:  # fewer products of rows than of directions
                z = _padded(part, length)
                products = _padded(weighted, length) @ z.transpose(0, 2, 1)
                total += z.reshape(-1, r).T @ (products @ z).reshape(-1, r)
            else:
                if G is None:
                    z = _padded(part, length)
                    G = z.transpose(0, 2, 1) @ z
                else:
                    G = _pairs(G)
                total += (G @ W @ G).sum(axis=0)
            total -= EXCESS_OF_FOURTH_MOMENT * rows
    return totals


def _padded(part: FloatArray, length: int) -> FloatArray:
    """Return rows by batches, (n, length, r), the last filled up with zeros."""
    n = -(-len(part) // length)
    padded = np.zeros((n * length, part.shape[1]))
    padded[: len(part)] = part
    return padded.reshape(n, length, -1)


def _shortest_sufficient(variances: FloatArray, shares: FloatArray) -> NDArray[np.intp]:
    """Return, per column, the first row that no later row clearly exceeds, the last left out.

    The last row is kept for `_lugsail`.
    """
    rows = max(1, len(variances) - 1)
    quantile = special.ndtri(1 - FALSE_ALARM / max(1, rows * (rows - 1) // 2))
    chosen = np.full(variances.shape[1], rows - 1, dtype=np.intp)
    for i in range(rows - 2, -1, -1):
        # Batches are nested: their variances differ by the scatter of the longer batches alone.
        scatter = np.sqrt(2 * np.maximum(shares[i + 1 : rows] - shares[i], 0.0))
        exceeds = variances[i + 1 : rows] > variances[i] * (1 + quantile * scatter)
        chosen[~exceeds.any(axis=0)] = i
    return chosen


def _lugsail(variances: FloatArray, level: NDArray[np.intp]) -> FloatArray:
    """Return variances at a row per column, corrected for correlation cut at the batches' ends."""
    column = np.arange(variances.shape[1])
    short = variances[level, column]
    long = variances[np.minimum(level + 1, len(variances) - 1), column]
    return np.where(level > 0, np.maximum(2 * long - short, long / 2), short)


def _source_covariance(source: _Batches, total: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariance (p, p) of a source and half the variance of its diagonal, (p,)."""
    R = source.root
    levels = []
    crossed = _squares(source.parts, source.lengths, total)
    for sums, square, cross in zip(source.sums, source.squares, crossed, strict=True):
        removed = 2 * source.inflation * square - cross
        levels.append(((sums @ R) ** 2).sum(axis=0) + np.sum(R * (removed @ R), axis=0))
    variances = np.maximum(np.array(levels), 0.0)  # rounding may leave less than zero
    chosen = np.maximum(source.level, _shortest_sufficient(variances, source.shares))
    variance = _lugsail(variances, chosen)
    at = np.minimum(chosen + 1, len(variances) - 1)
    column = np.arange(R.shape[1])
    shares = source.shares[chosen, column]
    shares = np.where(chosen > 0, 4 * source.shares[at, column] - 3 * shares, shares)
    # Correlations come from the longest batches that a component asks for.
    longest = source.sums[int(at[chosen.argmax()] if chosen.any() else 0)] @ R
    shape = longest.T @ longest
    size = np.diag(shape)
    stretch = np.sqrt(np.divide(variance, size, out=np.zeros(size.size), where=size > 0))
    return shape * np.outer(stretch, stretch), shares * variance**2
