"""CasADi functions evaluated along a record by CasADi itself, in bounded memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import casadi as ca
import numpy as np

from pneumo_casadi.model.along_record.array_function import ArrayFunction
from pneumo_casadi.model.along_record.record_function import RecordFunction
from pneumo_casadi.model.machine_code.calls import call_with_arrays
from pneumo_casadi.parameters import FloatArray

#: Samples that are evaluated at a time.
STRETCH = 20_000


@dataclass(frozen=True, eq=False)
class MappedFunction(RecordFunction):
    """A function of any kind, such as one with splines, evaluated for all samples of a record.

    Examples
    --------
    >>> x, h = ca.MX.sym("x"), ca.MX.sym("h")
    >>> decay = MappedFunction(ca.Function("decay", [x, h], [x - h * x, 2 * h]))
    >>> decay.evaluate(2, np.array([[1.0, 2.0]]), np.array([0.5]))
    (array([[0.5, 1. ]]), array([[1., 1.]]))
    """

    def _evaluate(self, N: int, given: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
        f = self.function
        outputs = tuple(np.zeros((f.numel_out(i), N)) for i in range(f.n_out()))
        mapped = lru_cache(maxsize=1)(partial(self._mapped, [a.ndim == 1 for a in given]))
        for first in range(0, N, STRETCH):
            n = min(STRETCH, N - first)
            parts = [a if a.ndim == 1 else a[:, first : first + n] for a in given]
            for output, values in zip(outputs, call_with_arrays(mapped(n), *parts), strict=True):
                # CasADi lays the matrices of the samples side by side.
                output[:, first : first + n] = np.reshape(values, (-1, n), order="F")
        return outputs

    def _mapped(self, shared: Sequence[bool], n: int) -> ca.Function:
        """Return the function of n samples; inputs that are `shared` are the same for all."""
        f = self.function
        sizes = [(f.size1_in(i), 1 if same else n) for i, same in enumerate(shared)]
        symbols = [ca.MX.sym(f.name_in(i), *size) for i, size in enumerate(sizes)]
        columns = [
            ca.repmat(symbol, 1, n) if same else symbol
            for symbol, same in zip(symbols, shared, strict=True)
        ]
        results = f.map(n).call(columns)
        return ca.Function(f.name(), symbols, [ca.densify(result) for result in results])


def evaluated_without_compiling(function: ca.Function) -> RecordFunction:
    """Return a function of one sample as one of all samples of a record, at no cost to make."""
    return ArrayFunction(function) if ArrayFunction.suits(function) else MappedFunction(function)
