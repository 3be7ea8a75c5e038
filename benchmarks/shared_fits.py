"""Work on one study that is done once for all moves of criteria that change nothing in it."""

import hashlib
import pickle
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
from movable import Move, note, noted

from pneumo_casadi.diagnosis.discover import discover
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import _run_in_worker
from pneumo_casadi.diagnosis.select import (
    complete,
    fit_ledger,
    forward_selection,
    propose,
)
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.model.effect import Effect

#: Functions of a study that take long, by the module that calls them.
SHARED = (
    (forward_selection, "fit_model"),
    (forward_selection, "background"),
    (forward_selection, "accepted"),
    (fit_ledger, "refine_model"),
    (fit_ledger, "screened"),
    (propose, "background"),
    (complete, "background"),
    (complete, "accepted"),
    (discover, "propose_term"),
)
#: Arguments that differ in their criteria only, and so tell no job from another.
CRITERIA_ONLY = (Study, BalanceLevels)


class SharedFits(Executor):
    """Do work on a study in this process, each piece once for all moves that change nothing in it.

    Jobs are identified by the content of their arguments; functions in `SHARED`, which are called
    often, by the identity of theirs.
    """

    def __init__(self) -> None:
        self.study: Study | None = None
        self.move: Move | None = None
        self.known: dict[tuple[Any, Move | None], tuple[Future[Any], set[Move], Any]] = {}
        self.counts: Counter[str] = Counter()

    def submit(self, fn: Callable[..., Any], /, *given: Any, **named: Any) -> "Future[Any]":
        """Return what is known of a job, or do it."""
        if fn is _run_in_worker:
            _, job, *rest = given
            return self._shared(_key(job, rest), job, (self.study, *rest), {})
        return self._shared(_key(fn, [*given, named]), fn, given, named)

    def shared(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that is called once for the same objects."""

        def call(*given: Any, **named: Any) -> Any:
            objects = tuple(_identity(item) for item in (*given, *named.items()))
            return self._shared((function.__qualname__, *objects), function, given, named).result()

        return call

    def _shared(
        self, key: Any, fn: Callable[..., Any], given: tuple[Any, ...], named: Mapping[str, Any]
    ) -> "Future[Any]":
        plain = self.known.get((key, None))
        if plain is not None and self.move not in plain[1]:
            self.counts["shared"] += 1
            note(plain[1])
            return _as_new(plain[0])
        if (key, self.move) not in self.known:
            self.counts["done"] += 1
            # What was given is kept: otherwise a new object could get the same identity.
            self.known[key, self.move] = *_done(fn, given, named), (given, named)
        return _as_new(self.known[key, self.move][0])

    def forget(self, move: Move) -> None:
        """Drop what was done for a move."""
        self.known = {key: held for key, held in self.known.items() if key[1] != move}


@contextmanager
def sharing(fits: SharedFits) -> Iterator[None]:
    """Share what `SHARED` lists."""
    with ExitStack() as stack:
        for module, name in SHARED:
            stack.enter_context(patch.object(module, name, fits.shared(getattr(module, name))))
        yield


def _key(job: Callable[..., Any], given: list[Any]) -> str:
    """Return what a job is known by."""
    return f"{job.__module__}.{job.__qualname__} {digest(given)}"


def _as_new(future: "Future[Any]") -> "Future[Any]":
    """Return a finished future without the traceback of those who have asked for it before."""
    error = future.exception()
    if error is not None:
        error.__traceback__ = None
    return future


def _identity(item: Any) -> Any:
    """Return what an argument is known by."""
    if isinstance(item, CRITERIA_ONLY):
        return ""
    if isinstance(item, Effect):
        return item.name
    if isinstance(item, (tuple, list)):
        return tuple(_identity(part) for part in item)
    return item if isinstance(item, (str, int, float, type(None))) else id(item)


def _done(
    fn: Callable[..., Any], given: tuple[Any, ...], named: Mapping[str, Any]
) -> tuple["Future[Any]", set[Move]]:
    future: Future[Any] = Future()
    with noted() as inside:
        try:
            future.set_result(fn(*given, **named))
        except (PneumoError, RuntimeError, ValueError, ArithmeticError) as error:
            future.set_exception(error)
    return future, inside


def digest(given: Any) -> str:
    """Return a hash of the arguments of a job; equal ones have the same."""
    return hashlib.sha256(pickle.dumps(_plain(given))).hexdigest()


def _plain(item: Any) -> Any:
    """Return content without identity: pickle writes an object that occurs twice differently."""
    if isinstance(item, CRITERIA_ONLY):
        return ""
    if isinstance(item, Mapping):
        return "{" + ",".join(f"{key}:{_plain(value)}" for key, value in item.items()) + "}"
    if isinstance(item, (list, tuple)):
        return "[" + ",".join(_plain(value) for value in item) + "]"
    if isinstance(item, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(item).tobytes()).hexdigest() + str(item.shape)
    if isinstance(item, (str, bytes, int, float, complex, type(None))):
        return repr(item)
    return f"{type(item).__qualname__} {hashlib.sha256(pickle.dumps(item)).hexdigest()}"
