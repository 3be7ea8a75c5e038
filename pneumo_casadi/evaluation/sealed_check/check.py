"""The sealed check from draw to scores; it goes on where it was interrupted."""

import os
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pneumo_casadi.evaluation.sealed_check.answer import read_answer
from pneumo_casadi.evaluation.sealed_check.draw import (
    BACKGROUND,
    Draw,
    Kind,
    Proportions,
    draw_cases,
)
from pneumo_casadi.evaluation.sealed_check.judged import Judged
from pneumo_casadi.evaluation.sealed_check.measure import measure_one, rivals_of_one
from pneumo_casadi.evaluation.sealed_check.run import (
    CASES,
    Diagnosing,
    diagnose_cases,
    in_turn,
    make_cases,
    real_diagnosis,
)
from pneumo_casadi.evaluation.sealed_check.score import scored
from pneumo_casadi.evaluation.sealed_check.seal import (
    ABSENT,
    LABELS,
    OPENED,
    SEAL,
    VERDICTS,
    opened,
    seal,
)
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.json_input import read_json
from pneumo_casadi.runtime.output_folder import OutputKind, claim_names
from pneumo_casadi.runtime.processes import worker_pool
from pneumo_casadi.runtime.progress import Progress
from pneumo_casadi.virtual_bench import Severity

MEASURES, RIVALS, SCORES = "measures", "rivals", "scores.json"
SEED_FILE, FIGURE = "seed.txt", "withheld.png"
#: What a sealed check writes into its folder.
NAMES = (SEAL, LABELS, OPENED, CASES, VERDICTS, MEASURES, RIVALS, SCORES, SEED_FILE, FIGURE)
#: Kinds of cases on which the simple rivals are run.
KINDS_OF_RIVALS = (Kind.SINGLE, Kind.PAIR, Kind.NONE)


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
    rivals : int or None
        Number of clean cases, in the order of the draw, on which simple rivals are run; None for
        all. They fit every effect of the catalogue and take longer than the diagnosis.
    background : float
        Share of cases with weak effects besides.
    weak : Severity
        What these have a tenth of.
    """

    cases: int = 160
    seed: int = 0
    proportions: Proportions = field(default_factory=Proportions)
    duration: float = 20.0
    fs: float = 1000.0
    rivals: int | None = None
    background: float = BACKGROUND
    weak: Severity = Severity.SMALL


def check_withheld(
    folder: str | Path,
    options: WithheldOptions,
    executor: Executor | None = None,
    diagnosing: Diagnosing = real_diagnosis,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Draw, seal, diagnose, open and score; what the folder holds of it already is kept.

    The folder gets ``seal.json`` and ``labels.sealed``, then ``cases/``, ``verdicts/``, and once
    every verdict is there ``opened.json``, ``measures/``, ``rivals/`` and ``scores.json``. Whoever
    interrupts it loses the cases in work, no more.

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
        with worker_pool(os.cpu_count() or 1) as pool:
            return check_withheld(folder, options, pool, diagnosing, progress)
    folder = Path(folder)
    claim_names(folder, OutputKind.SEALED_CHECK, NAMES)
    kinds = options.proportions, options.background, options.weak
    draws = draw_cases(options.cases, options.seed, *kinds)
    seal(folder, draws, options.duration, options.fs)
    make_cases(folder, draws, options.duration, options.fs, executor, progress)
    left_out = {draw.name: draw.without for draw in draws}
    diagnose_cases(folder, left_out, diagnosing, executor, progress)
    labels, verdicts = opened(folder)
    measures = _measure(folder, labels, verdicts, options, executor, progress)
    scores = scored(
        [Judged(draw, read_answer(verdicts[draw.name]), measures[draw.name]) for draw in labels]
    )
    write_json(scores, folder / SCORES)
    return scores


def _measure(
    folder: Path,
    draws: tuple[Draw, ...],
    verdicts: Mapping[str, Mapping[str, Any]],
    options: WithheldOptions,
    executor: Executor,
    progress: Progress | None,
) -> dict[str, dict[str, Any]]:
    """Measure what is not measured yet, and return all of it by case."""
    sizes, rivals = {}, {}
    for draw in draws:
        case, named = folder / CASES / draw.name, sorted(read_answer(verdicts[draw.name]).named)
        sizes[draw.name] = partial(
            measure_one, folder / MEASURES, case, draw, named, options.duration, options.fs
        )
        if draw.kind in KINDS_OF_RIVALS and not draw.background:  # no others are scored
            rivals[draw.name] = partial(rivals_of_one, folder / RIVALS, case, draw)
    selected = dict(list(rivals.items())[: options.rivals])
    measures: dict[str, dict[str, Any]] = {draw.name: {} for draw in draws}
    for text, name, tasks in (("measuring", MEASURES, sizes), ("running rivals", RIVALS, selected)):
        target = folder / name
        missing = {k: v for k, v in tasks.items() if not (target / f"{k}.json").is_file()}
        in_turn(text, missing, executor, progress)
        for key in tasks:
            known = read_json(target / f"{key}.json", ABSENT)
            measures[key] = known | measures[key]
    return measures
