"""Cases of a few seconds, an executor without processes, and verdicts made by hand."""

from concurrent.futures import Executor, Future

import pytest

from pneumo_casadi.evaluation.sealed_check import Judged, Kind, read_answer
from pneumo_casadi.evaluation.sealed_check.draw import Draw


class InPlace(Executor):
    """Does everything at once and where it stands."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


@pytest.fixture
def in_place():
    return InPlace()


def verdict(word, *names, ranking=None, ambiguous=(), probability=0.9, balance="force"):
    """The JSON of a diagnosis, as far as scores read it."""
    order = ranking if ranking is not None else [" + ".join(names)] if names else []
    rest = (1 - probability) / max(len(order) - 1, 1)
    chances = [probability if i == 0 else rest for i in range(len(order))]
    return {
        "verdict": word,
        "effects": [{"name": name, "probability": probability} for name in names],
        "ranking": [
            {"name": name, "probability": chance, "held_out_shrink": 0.5}
            for name, chance in zip(order, chances, strict=True)
        ],
        "ambiguous": list(ambiguous),
        "where": {"balance": balance},
    }


@pytest.fixture
def told():
    """Makes the JSON of a diagnosis."""
    return verdict


@pytest.fixture
def judged():
    """Makes a case with its verdict: ``judged("single", "stribeck", told(...))``."""

    def make(kind, effects, content, **measured):
        names = effects.split() if effects else []
        draw = Draw("w001", Kind(kind), 1, dict.fromkeys(names, "medium"))
        return Judged(draw, read_answer(content), {"visible": bool(names), **measured})

    return make
