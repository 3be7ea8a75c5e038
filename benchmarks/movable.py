"""Numbers that know what they would be if a criterion were moved, and note where it would decide.

A `Movable` goes through the arithmetic of the diagnosis in place of a criterion. It holds its value
and those for every move of a criterion that it depends on. Where a comparison comes out otherwise
for a move, the move is noted: a run in which none is noted has the same result with the criterion
moved, without another run. What turns a movable number into a plain one ends the bookkeeping, and
notes all moves that it depends on.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin


@dataclass(frozen=True, slots=True, order=True)
class Move:
    """A criterion and the value that it is given instead."""

    criterion: str
    value: float


_NOTES: list[set[Move]] = [set()]


@contextmanager
def noted() -> Iterator[set[Move]]:
    """Collect the moves that would change a comparison within; they count outside as well."""
    _NOTES.append(set())
    try:
        yield _NOTES[-1]
    finally:
        inner = _NOTES.pop()
        note(inner)


def note(moves: set[Move]) -> None:
    """Note moves that would change something."""
    _NOTES[-1].update(moves)


class Movable(NDArrayOperatorsMixin):
    """A value, and the values that it has for moves of criteria.

    Parameters
    ----------
    value : float or array
        As the criteria are.
    otherwise : mapping of Move to float or array
        For each move on which it depends.

    Examples
    --------
    >>> share = Movable(0.5, {Move("share", 0.4): 0.4, Move("share", 0.6): 0.6})
    >>> with noted() as moves:
    ...     kept = 0.2 < share, 0.9 < 2 * share
    >>> [bool(each) for each in kept], sorted(moves)
    ([True, True], [Move(criterion='share', value=0.4)])
    """

    def __init__(self, value: Any, otherwise: Mapping[Move, Any]) -> None:
        self.value = value
        self.otherwise = otherwise

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, **named: Any) -> Any:
        if named.get("out") is not None:
            raise TypeError("a movable number is not written into an array: write it as a term")
        return _everywhere(getattr(ufunc, method), given, named)

    def __array_function__(
        self, function: Callable[..., Any], types: Any, given: tuple[Any, ...], named: Any
    ) -> Any:
        return _everywhere(function, given, named)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self._plain(), dtype)

    def __float__(self) -> float:
        return float(self._plain())

    def __int__(self) -> int:
        return int(self._plain())

    def __bool__(self) -> bool:
        return bool(self._plain())

    def __len__(self) -> int:
        return len(self.value)

    def __getitem__(self, index: Any) -> "Movable":
        return Movable(
            self.value[index], {move: other[index] for move, other in self.otherwise.items()}
        )

    def __getattr__(self, name: str) -> Any:
        if name in ("shape", "size", "ndim", "dtype"):  # those of any move
            return getattr(np.asarray(self.value), name)
        method = None if name.startswith("__") else getattr(np.ndarray, name, None)
        if not callable(method):
            raise AttributeError(name)
        return lambda *given, **named: _everywhere(
            lambda array: getattr(np.asarray(array), name)(*given, **named), (self,), {}
        )

    def _plain(self) -> Any:
        note(set(self.otherwise))
        return self.value


def _everywhere(function: Callable[..., Any], given: tuple[Any, ...], named: Any) -> Any:
    """Call a function with the values as they are and as every move makes them."""
    movable = [item for item in _flat((*given, *named.values())) if isinstance(item, Movable)]
    moves = {move for item in movable for move in item.otherwise}

    def called(move: Move | None) -> Any:
        return function(
            *(_at(item, move) for item in given),
            **{key: _at(item, move) for key, item in named.items()},
        )

    value = called(None)
    otherwise = {move: called(move) for move in moves}
    if np.asarray(value).dtype.kind not in "fc":  # decided: true or false, or which one
        note({move for move, other in otherwise.items() if not np.array_equal(value, other)})
        return value
    return Movable(value, otherwise)


def _flat(items: Any) -> Iterator[Any]:
    for item in items:
        if isinstance(item, (tuple, list)):
            yield from _flat(item)
        else:
            yield item


def _at(item: Any, move: Move | None) -> Any:
    """Return a value as a move makes it; None for no move."""
    if isinstance(item, Movable):
        return item.value if move is None else item.otherwise.get(move, item.value)
    if isinstance(item, (tuple, list)):
        return type(item)(_at(part, move) for part in item)
    return item
