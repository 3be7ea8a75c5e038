"""What functions of one sample have in common, however they are evaluated along a record."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, eq=False)
class RecordFunction:
    """A function of columns, evaluated for the samples of a record.

    Parameters
    ----------
    function : casadi.Function
        With dense inputs and outputs.
    """

    function: ca.Function

    def evaluate(self, N: int, *given: FloatArray) -> tuple[FloatArray, ...]:
        """Evaluate N samples.

        Parameters
        ----------
        N : int
            Number of samples.
        given : array
            One array per input: (n, N), or (n,) where all samples have the same.

        Returns
        -------
        tuple of (n, N) array
            One per output, a matrix column after column.
        """
        self.check(N, given)
        return self._evaluate(N, given)

    def _evaluate(self, N: int, given: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        raise NotImplementedError

    def check(self, N: int, given: Sequence[FloatArray]) -> None:
        """Raise ValueError if inputs for N samples have other shapes than the function."""
        for i, a in enumerate(given):
            n = self.function.numel_in(i)
            if a.ndim not in (1, 2) or a.shape[0] != n or (a.ndim == 2 and a.shape[1] < N):
                raise ValueError(
                    f"{self.function.name()}: input {i} has shape {a.shape}, expected "
                    f"{(n, N)} or {(n,)}"
                )


def without_repetition(function: ca.Function) -> ca.Function:
    """Return a function of SX in which nothing is computed twice; any other one as it is.

    Balances written from several sides, and their derivatives, have half of their operations in
    common.

    Examples
    --------
    >>> x, y = ca.SX.sym("x"), ca.SX.sym("y")
    >>> f = ca.Function("f", [x, y], [ca.sin(x + y), ca.cos(x + y)])
    >>> f.n_instructions() - without_repetition(f).n_instructions()
    1
    """
    if not function.is_a("SXFunction"):
        return function
    given = function.sx_in()
    names = function.name_in(), function.name_out()
    return ca.Function(function.name(), given, ca.cse(function.call(given)), *names)
