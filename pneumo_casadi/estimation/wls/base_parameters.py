"""Base parameters: which combinations of parameters a regressor can tell apart (Gautier 1991)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray

#: Maps (x, dx, u) to Y of shape (ne,) and W of shape (ne, n); a CasADi function does.
Regressor = Callable[[Any, Any, Any], tuple[Any, Any]]

#: A column counts as dependent if less than this share of it stands off the columns before it.
TOLERANCE = 1e-7


@dataclass(frozen=True, slots=True)
class BaseParameters:
    """The identifiable combinations of the parameters of a regressor W.

    W X = W[:, columns] (X[columns] + combination X[dependent]).

    Parameters
    ----------
    names : tuple of str
        All parameters, in the order of the columns of W.
    columns : tuple of int
        Columns of the base, in their order in W.
    dependent : tuple of int
        Columns that are linear combinations of the base.
    combination : (n_base, n_dependent) array
        Coefficients of the dependent parameters in each base parameter.
    diagonal : (n,) array
        ``|R_ii|`` of the scaled and pivoted QR factorisation, in the order of the pivots.
    """

    names: tuple[str, ...]
    columns: tuple[int, ...]
    dependent: tuple[int, ...]
    combination: FloatArray
    diagonal: FloatArray

    @property
    def rank(self) -> int:
        """Number of base parameters."""
        return len(self.columns)

    @property
    def expressions(self) -> tuple[str, ...]:
        """The base parameters as text, for example ``"X_s2 + 0.97 X_s3"``."""
        return tuple(
            _expression(self.names[column], [self.names[j] for j in self.dependent], row)
            for column, row in zip(self.columns, self.combination, strict=True)
        )

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Parameters that the data determine in linear combinations only, not one by one."""
        coupled = {
            self.names[column]
            for column, row in zip(self.columns, self.combination, strict=True)
            if np.any(row != 0)
        }
        coupled |= {self.names[column] for column in self.dependent}
        return tuple(name for name in self.names if name in coupled)

    @property
    def remedy(self) -> str:
        """How many of which parameters to hold, so that the others can be estimated."""
        n, coupled = len(self.dependent), self.unidentifiable
        of = f"{n} of " if n < len(coupled) else ""
        return f"Hold {of}{', '.join(coupled)} (`--fix NAME=VALUE`)"

    def describe(self) -> str:
        """Return what can be estimated instead of what cannot, as one sentence."""
        if not self.dependent:
            return f"all {self.rank} parameters are identifiable"
        joint = [text for text in self.expressions if " " in text]
        without = [
            self.names[column]
            for column, part in zip(self.dependent, self.combination.T, strict=True)
            if not np.any(part)
        ]
        sentences = []
        if joint:
            sentences.append(f"only the combinations {'; '.join(joint)} can be estimated")
        if without:
            sentences.append(f"the data hold no trace of {', '.join(without)}")
        return "; ".join(sentences)


def base_parameters(
    W: ArrayLike, names: Sequence[str], tolerance: float = TOLERANCE
) -> BaseParameters:
    """Find the base parameters of a regressor by rank-revealing QR.

    Columns are scaled to unit length, so that units do not decide, and factorised with column
    pivoting; the rank is the number of diagonal elements of R above `tolerance` times the
    first. The earliest columns that span the range then make the base, so that regrouping
    keeps the names that come first. On rows of random states this is the structural base of
    the model; on rows of a record it is what the trajectory excites.

    Parameters
    ----------
    W : (r, n) array
        Observation matrix.
    names : sequence of str
        One for each column.
    tolerance : float, optional
        On the scaled matrix. Noise in W hides dependences below its own share.

    Returns
    -------
    BaseParameters

    Raises
    ------
    ModelError
        If W holds values that are not finite, or not one column a name.

    Examples
    --------
    >>> W = np.random.default_rng(0).normal(size=(50, 2))
    >>> base = base_parameters(np.column_stack([W, W @ [0.0, 0.97]]), ["X_s1", "X_s2", "X_s3"])
    >>> base.expressions
    ('X_s1', 'X_s2 + 0.97 X_s3')
    """
    matrix = np.asarray(W, dtype=float)
    if matrix.ndim != 2 or matrix.shape[1] != len(names):
        raise ModelError(f"W of shape {matrix.shape} does not match {len(names)} names")
    if not np.all(np.isfinite(matrix)):
        raise ModelError("W holds values that are not finite")
    size = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(size > 0, size, 1.0)
    # Only R is needed; its columns relate to each other as those of W do, with n rows each.
    R = np.asarray(linalg.qr(scaled, mode="r")[0], dtype=np.float64)[: len(names)]
    _, pivoted, _ = linalg.qr(R, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(pivoted))
    columns, dependent = _first_independent(R, tolerance * max(float(diagonal[0]), 1e-300))
    combination = np.zeros((len(columns), len(dependent)))
    if columns and dependent:
        solved = np.linalg.lstsq(R[:, columns], R[:, dependent], rcond=None)[0]
        combination = np.asarray(solved, dtype=np.float64)
        combination[np.abs(combination) < 1e3 * tolerance] = 0.0
        combination *= size[dependent] / size[columns][:, None]
    return BaseParameters(tuple(names), tuple(columns), tuple(dependent), combination, diagonal)


def structural_base(
    regressor: Regressor, names: Sequence[str], n_states: int, n_inputs: int, seed: int = 0
) -> BaseParameters:
    """Find the base parameters of the model itself, on random states and derivatives.

    Parameters
    ----------
    regressor : callable
        ``(x, dx, u) -> (Y, W)`` as from the model's `regressor`.
    names : sequence of str
        One for each column of W.
    n_states, n_inputs : int
        Lengths of x and u.
    seed : int, optional
        Of the random states.

    Returns
    -------
    BaseParameters
    """
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(20 + 5 * len(names)):
        x, dx = rng.uniform(-1, 1, size=(2, n_states))
        _, W = regressor(x, dx, rng.uniform(-1, 1, size=n_inputs))
        rows.append(np.array(W).reshape(-1, len(names)))
    return base_parameters(np.vstack(rows), names)


def _first_independent(R: FloatArray, least: float) -> tuple[list[int], list[int]]:
    """Split columns into those that add a direction to the ones before them, and the rest."""
    basis: list[FloatArray] = []
    columns: list[int] = []
    dependent: list[int] = []
    for j in range(R.shape[1]):
        rest = np.array(R[:, j])
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            for direction in basis:
                rest -= direction * (direction @ rest)
        length = float(np.linalg.norm(rest))
        if length > least:
            basis.append(rest / length)
            columns.append(j)
        else:
            dependent.append(j)
    return columns, dependent


def _expression(name: str, others: Sequence[str], row: FloatArray) -> str:
    text = name
    for other, coefficient in zip(others, row, strict=True):
        if coefficient == 0:
            continue
        sign = "+" if coefficient > 0 else "-"
        factor = f"{abs(coefficient):.3g} " if abs(abs(coefficient) - 1) > 1e-9 else ""
        text += f" {sign} {factor}{other}"
    return text
