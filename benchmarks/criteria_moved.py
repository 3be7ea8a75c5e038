"""Question: how many verdicts change when a criterion is moved by a fifth.

Data: 200 draws of the virtual bench as its sealed check draws them (20 s at 1 kHz, half of them
with weak effects besides, some causes missing from the catalogue). Each is diagnosed with the
criteria as they are, then with every criterion lowered and raised by a fifth. A probability above a
half is moved by a fifth of what it lacks to one: 0.95 raised by a fifth would exceed one. A verdict
has changed where its word has, or the causes that it names. Where the word and the cause that is
missed most stay, and only what is named beside it differs, it counts apart as well.

A diagnosis whose comparisons all come out the same for a move is not repeated: the criteria are
numbers that note where they would decide otherwise (`movable`). Fits are shared between the runs of
a case as long as the criterion moved decides nothing within them.
"""

import argparse
import logging
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import provenance
from movable import Movable, Move, noted
from shared_fits import SharedFits, sharing

from pneumo_casadi.data import Case, read_case
from pneumo_casadi.diagnosis.conclude import conclude
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS
from pneumo_casadi.diagnosis.prepare.prepare_study import applicable, prepare_study
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue
from pneumo_casadi.diagnosis.select.forms import causes_of
from pneumo_casadi.diagnosis.select.forward_selection import select_effects
from pneumo_casadi.effects import EFFECTS, without_causes
from pneumo_casadi.evaluation.sealed_check.draw import Draw, draw_cases, make
from pneumo_casadi.identification.flow_form import resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.runtime.threads import one_thread

SEED = 1905
CASES = 200
WORKERS = 2
#: Share by which a criterion is moved.
FIFTH = 0.2
WAYS = ("lowered", "raised")
#: Criteria that are probabilities above a half.
PROBABILITIES = ("certain", "alone", "further_alone")

#: What a verdict says: its word, and the causes named, the one missed most first.
Said = tuple[str, tuple[str, ...]]


def moves_of(name: str) -> tuple[Move, Move]:
    """Return a criterion lowered and raised."""
    value = getattr(CRITERIA, name)
    by = FIFTH * (1 - value if name in PROBABILITIES else value)
    return Move(name, value - by), Move(name, value + by)


def moves() -> tuple[Move, ...]:
    """Return every criterion lowered and raised."""
    return tuple(move for name in asdict(CRITERIA) for move in moves_of(name))


@contextmanager
def with_criteria() -> Iterator[Criteria]:
    """Give the criteria as numbers that know their moves."""
    values: dict[str, Any] = {
        name: Movable(value, {move: move.value for move in moves() if move.criterion == name})
        for name, value in asdict(CRITERIA).items()
    }
    yield Criteria(**values)


@contextmanager
def with_moved(move: Move) -> Iterator[Criteria]:
    """Give the criteria with one of them moved."""
    changed: dict[str, Any] = {move.criterion: move.value}
    yield replace(CRITERIA, **changed)


def said(study: Study, catalogue: Catalogue, fits: SharedFits) -> Said:
    """Return the verdict on a study, as `diagnose` finds it."""
    fits.study = study
    with sharing(fits):
        selection = select_effects(study, catalogue, fits)
        decision = conclude(study, selection, catalogue, fits).decision
    named: tuple[str, ...] = ()
    if decision.names_effects:
        named = tuple(dict.fromkeys((*selection.contributions, *selection.named)))
    sure = (name for name in named if name not in decision.judgement.undecided)
    causes = causes_of((*sure, *decision.absorbed), {**EFFECTS, **catalogue})
    return decision.verdict.value, causes


@one_thread
def one_case(
    case: Case,
    without: tuple[str, ...],
    watched: Callable[[], AbstractContextManager[Criteria]] = with_criteria,
    moved: Callable[[Move], AbstractContextManager[Criteria]] = with_moved,
) -> dict[str, Any]:
    """Return what is said of a case, and by each move that changes it.

    Parameters
    ----------
    case : Case
        What was measured.
    without : tuple of str
        Causes that the catalogue lacks, in all their forms.
    watched : callable
        Gives the context in which moves are noted.
    moved : callable
        Gives the context in which a move is made.
    """
    flow_options, _ = resolve_flow_form(case, IdentifyOptions())
    with watched() as criteria:
        study, _ = prepare_study(case, flow_options, criteria)
        catalogue = applicable(study, without_causes(without))
        fits = SharedFits()
        with noted() as near:
            usual = said(study, catalogue, fits)
    changed = []
    for move in sorted(near):
        fits.move = move
        with moved(move) as criteria:
            try:
                now = said(replace(study, criteria=criteria), catalogue, fits)
            except FAULTS as error:
                now = type(error).__name__, ()
        fits.forget(move)
        if now[0] != usual[0] or set(now[1]) != set(usual[1]):
            changed.append({**asdict(move), "verdict": now[0], "names": now[1]})
    return {
        "verdict": usual[0],
        "names": usual[1],
        "near": [asdict(move) for move in sorted(near)],
        "changed": changed,
        "jobs": dict(fits.counts),
    }


def kept(draw: Draw, keep: Path, **ways: Any) -> dict[str, Any]:
    """Return `one_case` of a draw, or what an interrupted run has found."""
    of = {"draw": draw.as_dict(), "ways": sorted(ways)}
    return provenance.kept(keep, draw.name, partial(of_draw, draw, **ways), of)


def of_draw(draw: Draw, **ways: Any) -> dict[str, Any]:
    """Make the case of a draw, and return `one_case` of it."""
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        make(draw, Path(scratch) / draw.name)
        return one_case(read_case(Path(scratch) / draw.name), draw.without, **ways)


def all_draws(
    draws: Sequence[Draw], work: Callable[[Draw, Path], dict[str, Any]], keep: Path | None
) -> dict[str, dict[str, Any]]:
    """Return the results of all draws by name."""
    results = {}
    with tempfile.TemporaryDirectory() as scratch, ProcessPoolExecutor(WORKERS) as pool:
        folder = keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        jobs = {draw.name: pool.submit(work, draw, folder) for draw in draws}
        for name, job in jobs.items():
            results[name] = job.result()
            print(name, results[name]["verdict"], len(results[name]["changed"]), flush=True)
    return results


def table(results: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each criterion: its values, and the cases in which each changes what."""
    return [
        {"criterion": name, "value": value}
        | {way: _by(move, results) for way, move in zip(WAYS, moves_of(name), strict=True)}
        for name, value in asdict(CRITERIA).items()
    ]


def _by(move: Move, results: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return in which cases a move changes what."""
    hits = {
        case: _says_the_same_first(change, result)
        for case, result in results.items()
        for change in result["changed"]
        if _is(change, move)
    }
    near = (any(_is(each, move) for each in result["near"]) for result in results.values())
    return {
        "value": move.value,
        "repeated_in": sum(near),
        "changed": sorted(hits),
        "beside_only": sum(hits.values()),
        "share": len(hits) / len(results),
        "share_word_or_first": (len(hits) - sum(hits.values())) / len(results),
    }


def _is(entry: Mapping[str, Any], move: Move) -> bool:
    """Return whether an entry of a result is of a move."""
    return entry["criterion"] == move.criterion and bool(np.isclose(entry["value"], move.value))


def _says_the_same_first(change: Mapping[str, Any], result: Mapping[str, Any]) -> bool:
    """Return whether the word and the first cause named are as before."""
    first = (list(each["names"])[:1] for each in (change, result))
    return change["verdict"] == result["verdict"] and next(first) == next(first)


def run(
    description: str,
    work: Callable[[Draw, Path], dict[str, Any]],
    figures_of: Callable[[Sequence[Draw], Mapping[str, Mapping[str, Any]]], dict[str, Any]],
) -> None:
    """Run a benchmark on draws from the command line."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--first", type=int, help="so many of them alone")
    parser.add_argument("--keep", type=Path, help="folder of results by case, to go on from")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="two cases, to see it run")
    arguments = parser.parse_args()
    draws = draw_cases(2 if arguments.quick else arguments.cases, SEED)[: arguments.first]
    results = all_draws(draws, work, arguments.keep)
    figures = {"cases": len(results), **figures_of(draws, results)}
    provenance.write(arguments.json, provenance.made(SEED, arguments.quick, "numba") | figures)


def figures_of(draws: Sequence[Draw], results: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the table, and the largest share of verdicts that a move changes."""
    figures: dict[str, Any] = {"criteria": table(results)}
    for key in ("share", "share_word_or_first"):
        most = max(row[way][key] for row in figures["criteria"] for way in WAYS)
        figures[f"most_{key}"] = most
        print(f"{key}: at most {100 * most:.1f} % of {len(results)} verdicts change")
    return figures


if __name__ == "__main__":
    run(__doc__, kept, figures_of)
