"""Choice of the degrees of the flow polynomials by cross-validation."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.polynomials import BRANCHES, Degrees, design_matrix_at

Folds = list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]
"""Points to fit and points withheld, of each fold."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class DegreeSelection:
    """Degrees compared by cross-validation.

    Parameters
    ----------
    table : DataFrame
        One row for each candidate, least error first: degrees ``phi``, ``psi_plus``,
        ``psi_minus``, number of coefficients ``n``, cross-validated error ``rms`` [kg/s], its
        standard error ``rms_error`` [kg/s] and ``percent`` of the greatest flow.
    best : tuple of int
        The candidate with the least error.
    chosen : tuple of int
        The one with the fewest coefficients whose error is within one standard error of it.
    at_limit : tuple of str
        Polynomials whose best degree is the highest tried: higher ones may fit better still.
    """

    table: pd.DataFrame
    best: Degrees
    chosen: Degrees
    at_limit: tuple[str, ...]


def select_degrees(
    table: FlowMap,
    candidates: Iterable[Degrees] | None = None,
    folds: int = 5,
) -> DegreeSelection:
    """Choose the degrees of eq. 12 by K-fold cross-validation and the one-standard-error rule.

    Whole pressure columns *and* whole command rows are withheld together, so that no withheld
    point has a neighbour at its own pressure or command in the fit. The outermost columns and
    rows, and u = 0, always stay in the fit: the question is interpolation, not continuation.

    Parameters
    ----------
    table : FlowMap
        Measured points at one supply pressure.
    candidates : iterable of tuple of int, optional
        Degrees of (φ, ψ⁺, ψ⁻) to compare; by default all from 1 to 9 (729 candidates), or up
        to the highest degree that the number of pressures allows.
    folds : int, optional
        Number of folds K.

    Returns
    -------
    DegreeSelection

    Raises
    ------
    CaseError
        If there are too few distinct pressures for the folds or the degrees, or too few commands
        to tell leakage from gain.

    References
    ----------
    .. [1] T. Hastie, R. Tibshirani, J. Friedman, *The Elements of Statistical Learning*,
       2nd ed., section 7.10.
    """
    masks = fold_masks(table, folds)
    tried = _all_degrees(table, masks) if candidates is None else list(candidates)
    if not tried:
        raise CaseError("no candidate degrees to compare")
    top = tuple(max(degrees[i] for degrees in tried) for i in range(3))
    D = design_matrix_at(table.u, table.p, (top[0], top[1], top[2]), table.p_range)
    scale = np.sqrt(np.mean(D**2, axis=0))
    D = D / np.where(scale > 0, scale, 1.0)
    _check_training(table, (top[0], top[1], top[2]), masks)
    used = np.concatenate(
        [np.arange(n + 1) <= np.array(tried)[:, [i]] for i, n in enumerate(top)], axis=1
    )
    try:
        squares = np.column_stack([_mean_squares(D, table.q_m, used, *fold) for fold in masks])
    except np.linalg.LinAlgError:
        raise CaseError(
            f"{table.source}: the points that a fold leaves do not determine all coefficients of "
            f"degrees up to {top}; meter all commands at all pressures, or compare lower degrees"
        ) from None
    return _choose(tried, squares, table.q_max)


def _mean_squares(
    D: FloatArray,
    q_m: FloatArray,
    used: NDArray[np.bool_],
    train: NDArray[np.bool_],
    test: NDArray[np.bool_],
) -> FloatArray:
    """Mean square error of each candidate on the withheld points of one fold [(kg/s)²].

    All candidates are solved at once: a column that a candidate does not use is replaced by one
    of the identity, so that its coefficient is zero.
    """
    gram, rhs = D[train].T @ D[train], D[train].T @ q_m[train]
    square = used[:, :, None] & used[:, None, :]
    theta = np.linalg.solve(
        np.where(square, gram, np.eye(len(gram))), np.where(used, rhs, 0.0)[:, :, None]
    )[:, :, 0]
    return np.asarray(np.mean((q_m[test] - theta @ D[test].T) ** 2, axis=1))


def _choose(tried: list[Degrees], squares: FloatArray, q_max: float) -> DegreeSelection:
    mean = squares.mean(axis=1)
    standard_error = squares.std(axis=1, ddof=1) / np.sqrt(squares.shape[1])
    size = np.array([sum(degrees) + 3 for degrees in tried])
    best = int(np.argmin(mean))
    eligible = np.flatnonzero(mean <= mean[best] + standard_error[best])
    chosen = int(eligible[np.lexsort((mean[eligible], size[eligible]))[0]])
    rms = np.sqrt(mean)
    frame = pd.DataFrame(tried, columns=["phi", "psi_plus", "psi_minus"]).assign(
        n=size,
        rms=rms,
        rms_error=standard_error / (2 * np.where(rms > 0, rms, 1.0)),
        percent=100 * rms / q_max,
    )
    logger.info("degrees %s chosen (best %s)", tried[chosen], tried[best])
    frame = frame.sort_values(["rms", "n"], ignore_index=True)
    highest = np.max(tried, axis=0)
    at_limit = tuple(
        branch
        for branch, degree, limit in zip(BRANCHES, tried[best], highest, strict=True)
        if degree == limit and len(tried) > 1
    )
    return DegreeSelection(frame, tried[best], tried[chosen], at_limit)


def fold_masks(table: FlowMap, folds: int) -> Folds:
    """Return the points to fit and those withheld, of each fold.

    A fold withholds every `folds`-th pressure column and command row together; the outermost ones
    and u = 0 are never withheld.

    Raises
    ------
    CaseError
        If there are too few distinct pressures for the folds.
    """
    columns = table.column_numbers
    column = _labels(columns, folds)
    row = _labels(table.command_numbers, folds)
    row[table.u == 0] = -1
    if folds < 2 or len(np.unique(column[column >= 0])) < folds:
        raise CaseError(
            f"{table.source}: {columns.max() + 1} distinct pressures do not make {folds} "
            "folds (at least 2) with both outermost columns kept; use fewer folds or meter more"
        )
    withheld = [(column == j) | (row == j) for j in range(folds)]
    return [(~test, test) for test in withheld]


def _labels(number: NDArray[np.int64], folds: int) -> NDArray[np.int64]:
    """Fold of each point by the number of its column or row; -1 for the outermost ones."""
    label = (number - 1) % folds
    label[(number == 0) | (number == number.max())] = -1
    return label


def _distinct_pressures(table: FlowMap, folds: Folds) -> tuple[int, int, int]:
    """Pressure columns that every fold leaves to φ, ψ⁺ and ψ⁻."""
    columns = table.column_numbers

    def least(side: NDArray[np.bool_]) -> int:
        return min(np.unique(columns[train & side]).size for train, _ in folds)

    return least(np.isfinite(table.u)), least(table.u > 0), least(table.u < 0)


def _all_degrees(table: FlowMap, folds: Folds) -> list[Degrees]:
    top = (min(9, distinct - 1) for distinct in _distinct_pressures(table, folds))
    first, second, third = (range(1, degree + 1) for degree in top)
    return [(i, j, k) for i in first for j in second for k in third]


def _check_training(table: FlowMap, top: Degrees, folds: Folds) -> None:
    left = _distinct_pressures(table, folds)
    for branch, degree, distinct in zip(BRANCHES, top, left, strict=True):
        if distinct <= degree:
            raise CaseError(
                f"{table.source}: {branch} of degree {degree} needs {degree + 1} distinct "
                f"pressures, a fold leaves {distinct}; lower the degrees or use more folds"
            )
    phi, plus, minus = (min(degree, 0) for degree in top)
    for train, _ in folds:
        u, p = table.u[train], table.p[train]
        constants = design_matrix_at(u, p, (phi, plus, minus), table.p_range)
        if np.linalg.matrix_rank(constants) < constants.shape[1]:
            commands = ", ".join(f"{command:g}" for command in np.unique(u))
            raise CaseError(
                f"{table.source}: a fold leaves the commands {commands} V, which do not tell "
                "leakage from gain; meter at u = 0, or at more commands on either side of it"
            )
