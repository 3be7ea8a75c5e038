"""Overdetermined linear systems with rows of several equations (eq. 13)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.robust_covariance import default_lags
from pneumo_casadi.parameters import FloatArray

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """An overdetermined linear system Y = W X + ρ with rows of several equations (eq. 13).

    Parameters
    ----------
    Y : (r,) array
        Measured side.
    W : (r, n) array
        Observation matrix.
    names : tuple of str
        Parameters, one for each column of W.
    equations : tuple of str
        Names of the equations.
    equation : (r,) array of int
        Equation of each row, an index into `equations`.
    instant : (r,) array of int
        Instant of each row: rows of several equations at one instant share it, consecutive
        instants of one record differ by one, records lie apart.
    shared_error : (r, k) array, optional
        Changes of Y by k independent errors of standard deviation one that all rows share, as
        those of a flow map; by default there is none.

    Raises
    ------
    ModelError
        If shapes differ, a value is not finite, or there are no more rows than parameters.
    """

    Y: FloatArray
    W: FloatArray
    names: tuple[str, ...]
    equations: tuple[str, ...]
    equation: IntArray
    instant: IntArray
    shared_error: FloatArray | None = None

    def __post_init__(self) -> None:
        rows, n = self.W.shape
        shared = np.zeros((rows, 0)) if self.shared_error is None else self.shared_error
        object.__setattr__(self, "shared_error", shared)
        parts = {"Y": self.Y, "equation": self.equation, "instant": self.instant}
        for label, values in parts.items():
            if values.shape != (rows,):
                raise ModelError(f"{label} has shape {values.shape}, W has {rows} rows")
        if shared.shape[0] != rows:
            raise ModelError(f"shared_error has shape {shared.shape}, W has {rows} rows")
        if n != len(self.names):
            raise ModelError(f"W has {n} columns for {len(self.names)} names")
        if not (np.all(np.isfinite(self.Y)) and np.all(np.isfinite(self.W))):
            raise ModelError("Y or W hold values that are not finite")
        if rows <= n:
            raise ModelError(
                f"{rows} rows cannot determine {n} parameters: give longer records or decimate less"
            )

    @property
    def errors_in_common(self) -> FloatArray:
        """Changes of Y by errors that all rows share, shape (r, k)."""
        assert self.shared_error is not None
        return self.shared_error

    def without(self, name: str) -> "LinearSystem":
        """Return the system without one parameter, which is thereby put to zero."""
        keep = [j for j, other in enumerate(self.names) if other != name]
        names = tuple(self.names[j] for j in keep)
        return replace(self, W=self.W[:, keep], names=names)


def stack_systems(systems: Sequence[LinearSystem]) -> LinearSystem:
    """Stack the systems of several records; their instants are set apart."""
    first = systems[0]
    instants = []
    start = 0
    # A gap longer than the lags that are summed keeps the records apart.
    gap = default_lags(sum(system.Y.size for system in systems)) + 1
    for system in systems:
        instants.append(system.instant + start)
        start = int(instants[-1].max()) + gap
    return LinearSystem(
        Y=np.concatenate([s.Y for s in systems]),
        W=np.vstack([s.W for s in systems]),
        names=first.names,
        equations=first.equations,
        equation=np.concatenate([s.equation for s in systems]),
        instant=np.concatenate(instants),
        shared_error=np.vstack([s.errors_in_common for s in systems]),
    )
