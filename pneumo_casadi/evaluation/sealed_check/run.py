"""Diagnosis of many cases, with one result file each, so that a run can be resumed."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from pneumo_casadi.data import Case, read_case
from pneumo_casadi.diagnosis import diagnose
from pneumo_casadi.effects import without_causes
from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check.draw import Draw, make
from pneumo_casadi.evaluation.sealed_check.seal import (
    canonical,
    is_open,
    read_verdict,
    verdict_path,
    write_verdict,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.runtime.interruption import is_ending
from pneumo_casadi.runtime.processes import WorkerDiedError
from pneumo_casadi.runtime.progress import Progress, no_progress

#: What is checked: a case and a catalogue to the JSON of a diagnosis. It must be importable, so
#: that it can be sent to another process.
Diagnosing = Callable[[Case, Mapping[str, type[Effect]]], Mapping[str, Any]]

CASES = "cases"
#: The verdict that is written where a diagnosis ended in an error; it is right nowhere.
FAILED = "failed"


def real_diagnosis(case: Case, catalogue: Mapping[str, type[Effect]]) -> dict[str, Any]:
    """Diagnose a case with this package.

    Parameters
    ----------
    case : Case
        Without its labels.
    catalogue : mapping of str to effect class
        What may be the cause.

    Returns
    -------
    dict
        What `Diagnosis.as_dict` returns.
    """
    return diagnose(case, catalogue).as_dict()


def in_turn(
    texts: str,
    tasks: Mapping[str, Callable[[], Any]],
    executor: Executor,
    progress: Progress | None = None,
) -> None:
    """Run named tasks in any order and report how long the rest will take.

    Parameters
    ----------
    texts : str
        Description of the tasks, for `progress`.
    tasks : mapping of str to callable
        Each writes its own result.
    executor : Executor
        Runs the tasks.
    progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Raises
    ------
    WorkerDiedError
        At the end, if the process of a task died; the message names the task.
    Exception
        The first other that a task raises; tasks that have not started by then are cancelled.
    """
    report = progress or no_progress
    began, n = time.monotonic(), len(tasks)
    futures: dict[Future[Any], str] = {executor.submit(task): name for name, task in tasks.items()}
    died: dict[str, WorkerDiedError] = {}
    try:
        for done, future in enumerate(as_completed(futures), 1):
            try:
                future.result()
            except WorkerDiedError as error:  # costs this task only
                died[futures[future]] = error
            left = (time.monotonic() - began) / done * (n - done)
            report(f"{texts}: {done} of {n}, {_duration(left)} left", done / n)
    finally:
        for future in futures:
            future.cancel()
    for name, death in died.items():
        raise WorkerDiedError(f"{name}: {death}; what is finished is kept") from death


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def make_cases(
    folder: Path,
    draws: Sequence[Draw],
    duration: float,
    fs: float,
    executor: Executor,
    progress: Progress | None = None,
) -> None:
    """Record all cases that are not there yet."""
    tasks = {
        draw.name: partial(make, draw, folder / CASES / draw.name, duration, fs)
        for draw in draws
        if not (folder / CASES / draw.name / "bench.json").is_file()
    }
    in_turn("recording", tasks, executor, progress)


def diagnose_cases(
    folder: Path,
    missing: Mapping[str, Sequence[str]],
    diagnosing: Diagnosing,
    executor: Executor,
    progress: Progress | None = None,
) -> None:
    """Diagnose all cases that have no verdict yet.

    Parameters
    ----------
    folder : Path
        With the cases in ``cases/``; verdicts go to ``verdicts/``.
    missing : mapping of str to sequence of str
        By name of the case: effects that its catalogue lacks.
    diagnosing : callable
        The diagnosis.
    executor : Executor
        Who runs it.
    progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Raises
    ------
    CaseError
        If the labels were opened already, or a verdict was tampered with.
    """
    waiting = {name: left_out for name, left_out in missing.items() if not _done(folder, name)}
    if waiting and is_open(folder):
        raise CaseError(
            f"{folder}: verdicts are gone ({', '.join(sorted(waiting)[:3])}), but the labels were "
            "opened; draw anew"
        )
    tasks = {
        name: partial(diagnose_one, folder, name, tuple(left_out), diagnosing)
        for name, left_out in waiting.items()
    }
    in_turn("diagnosing", tasks, executor, progress)


def _done(folder: Path, name: str) -> bool:
    if not verdict_path(folder, name).is_file():
        return False
    read_verdict(folder, name)
    return True


def diagnose_one(folder: Path, name: str, without: Sequence[str], diagnosing: Diagnosing) -> None:
    """Diagnose one case and write its verdict; an error is a verdict too."""
    try:
        verdict = dict(diagnosing(read_case(folder / CASES / name), without_causes(without)))
        canonical(verdict)
    except (ImportError, OSError, MemoryError):
        raise  # of this machine, not of the diagnosis
    except Exception as error:  # one defect must not cost the other cases
        if is_ending():
            raise
        verdict = {"verdict": FAILED, "error": f"{type(error).__name__}: {error}"}
    write_verdict(folder, name, verdict)
