"""The sealed check from draw to scores; it goes on where it was interrupted."""

import json
from collections.abc import Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pneumo_casadi.progress import Progress
from pneumo_casadi.result_file import write_json
from pneumo_casadi.withheld.draw import Draw, Proportions, draw_cases
from pneumo_casadi.withheld.measure import measure_one
from pneumo_casadi.withheld.run import (
    CASES,
    Diagnosing,
    diagnose_cases,
    in_turn,
    make_cases,
    real_diagnosis,
)
from pneumo_casadi.withheld.said import said
from pneumo_casadi.withheld.score import Judged, scored
from pneumo_casadi.withheld.seal import opened, seal

MEASURES, SCORES = "measures", "scores.json"


@dataclass(frozen=True, slots=True)
class WithheldOptions:
    """What is drawn.

    Parameters
    ----------
    cases : int
        How many.
    seed : int
        Of the draw; the diagnosis never sees it.
    proportions : Proportions
        Of the kinds.
    duration, fs : float
        Length of each record [s] and sampling frequency [Hz].
    """

    cases: int = 160
    seed: int = 0
    proportions: Proportions = field(default_factory=Proportions)
    duration: float = 20.0
    fs: float = 1000.0


def check_withheld(
    folder: str | Path,
    options: WithheldOptions,
    executor: Executor | None = None,
    diagnosing: Diagnosing = real_diagnosis,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Draw, seal, diagnose, open and score; what the folder holds of it already is kept.

    The folder gets ``seal.json`` and ``labels.sealed``, then ``cases/``, ``verdicts/``, and once
    every verdict is there ``opened.json``, ``measures/`` and ``scores.json``. Whoever interrupts it
    loses the cases in work, no more.

    Parameters
    ----------
    folder : path
        Where all of it goes.
    options : WithheldOptions
        What is drawn.
    executor : Executor, optional
        Who records, diagnoses and measures; by default as many processes as there are processors.
    diagnosing : callable, optional
        From a case and a catalogue to the JSON of a diagnosis.
    progress : callable, optional
        Called with a text and the share of the present stage.

    Returns
    -------
    dict
        See `score.scored`.

    Raises
    ------
    CaseError
        If the folder holds another draw, or labels or verdicts were tampered with.
    """
    if executor is None:
        with ProcessPoolExecutor() as pool:
            return check_withheld(folder, options, pool, diagnosing, progress)
    folder = Path(folder)
    draws = draw_cases(options.cases, options.seed, options.proportions)
    seal(folder, draws, options.duration, options.fs)
    make_cases(folder, draws, options.duration, options.fs, executor, progress)
    left_out = {one.name: one.without for one in draws}
    diagnose_cases(folder, left_out, diagnosing, executor, progress)
    labels, verdicts = opened(folder)
    measures = _measure(folder, labels, verdicts, options, executor, progress)
    found = scored([Judged(one, said(verdicts[one.name]), measures[one.name]) for one in labels])
    write_json(found, folder / SCORES)
    return found


def _measure(
    folder: Path,
    draws: tuple[Draw, ...],
    verdicts: Mapping[str, Mapping[str, Any]],
    options: WithheldOptions,
    executor: Executor,
    progress: Progress | None,
) -> dict[str, dict[str, Any]]:
    """Measure what is not measured yet, and return all of it by case."""
    target = folder / MEASURES
    tasks = {}
    for one in draws:
        if (target / f"{one.name}.json").is_file():
            continue
        case, named = folder / CASES / one.name, sorted(said(verdicts[one.name]).named)
        tasks[one.name] = partial(
            measure_one, target, case, one, named, options.duration, options.fs
        )
    in_turn("measuring", tasks, executor, progress)
    return {one.name: json.loads((target / f"{one.name}.json").read_text("utf-8")) for one in draws}
