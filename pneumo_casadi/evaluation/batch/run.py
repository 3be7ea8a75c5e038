"""Diagnoses of many cases: one task, one result file and one table row each; resumable.

A case is diagnosed within one process, which is fastest with more cases than processors. A task
needs nothing but the folders.
"""

import json
import os
import secrets
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from pneumo_casadi.data.emps import IDENTIFY as EMPS_FILE
from pneumo_casadi.errors import CaseError, PneumoError
from pneumo_casadi.evaluation.batch.table import CSV, FAILED, PARQUET, Row, row_of, write_tables
from pneumo_casadi.runtime.interruption import is_ending
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.json_input import read_json
from pneumo_casadi.runtime.output_folder import OutputKind, claim_names
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.provenance import code_identity, sha256

#: From a case folder to the JSON of a diagnosis. It must be importable, so that it can be sent to
#: another process.
Diagnosing = Callable[[Path], Mapping[str, Any]]

#: Where the records lie within the output folder.
CASES = "cases"
#: Error of Dask where workers died over a task. It also blames tasks that waited on the same
#: worker: each is tried once more, alone.
KILLED = "KilledWorker"
#: Files of a case folder that a diagnosis reads: when one of them changes, it is diagnosed again.
DATA = ("bench.json", "columns.json", "flow_map*.csv", "identify*", "validate*", "DATA_EMPS*.mat")


def real_diagnosis(folder: Path) -> dict[str, Any]:
    """Diagnose a case folder with the whole catalogue, within this process.

    Returns
    -------
    dict
        What `Diagnosis.as_dict` returns.
    """
    from pneumo_casadi.diagnosis import diagnose  # a second that other work need not wait for

    return diagnose(folder).as_dict()


def diagnose_many(
    folders: Sequence[str | Path],
    executor: Executor | None = None,
    *,
    keep: str | Path,
    progress: Progress | None = None,
    diagnosing: Diagnosing = real_diagnosis,
) -> tuple[Row, ...]:
    """Diagnose many cases and write one row for each.

    Parameters
    ----------
    folders : sequence of path
        Case folders, of different names.
    executor : Executor, optional
        Who diagnoses: a process pool, ``client.get_executor()`` of Dask ...; by default this
        process. Its workers must see `folders` and `keep` under the same paths.
    keep : path
        Output folder: a record a case in ``cases/``, then ``cases.csv`` and ``cases.parquet``
        (there effects and probabilities are lists). Called again with the same folder, what has
        its record is not diagnosed again unless its data or this package have changed.
    progress : callable, optional
        Called with a text and the share done.
    diagnosing : callable, optional
        From a case folder to the JSON of a diagnosis, importable; by default `diagnose`.

    Returns
    -------
    tuple of Row
        In the order of `folders`. A case that fails has its error in its row. An error of its data
        or of its fits is kept; one of the machine (a file, memory, a worker that died over it
        again and again) is tried anew by the next call.

    Raises
    ------
    CaseError
        If two folders have the same name, or there is none.
    PneumoError
        If the executor broke down or was closed. Finished cases are kept.

    Examples
    --------
    >>> def diagnosis(folder):
    ...     return {"verdict": "none", "effects": [], "ambiguous": [], "where": {"balance": "none"},
    ...             "gap": {"before": 1.0, "after": 1.0, "shrink": 0.0, "shrink_interval": [0, 0]}}
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as out:
    ...     rows = diagnose_many(["press_1", "press_2"], keep=out, diagnosing=diagnosis)
    >>> [(row.case, row.verdict) for row in rows]
    [('press_1', 'none'), ('press_2', 'none')]
    """
    # A worker may stand elsewhere. Links stay what they are called: records go by name.
    paths = [Path(os.path.abspath(folder)) for folder in folders]  # noqa: PTH100
    _check_names(paths)
    out = Path(keep).resolve()
    claim_names(out, OutputKind.CASES, (CASES, CSV, PARQUET))
    report = progress or no_progress
    rows: dict[str, Row] = {}
    for row in _rows(paths, out, diagnosing, executor):
        rows[row.case] = row
        report(f"diagnosed {len(rows)} of {len(paths)}", len(rows) / len(paths))
    table = tuple(rows[path.name] for path in paths)
    write_tables(table, out)
    return table


def case_folders(folder: str | Path) -> tuple[Path, ...]:
    """Return the case folders within a folder, by name.

    Raises
    ------
    CaseError
        If there is none.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CaseError(f"{folder}: no such folder; give the folder that holds the case folders")
    folders = sorted(
        path
        for path in folder.iterdir()
        if (path / "bench.json").is_file() or (path / EMPS_FILE).is_file()
    )
    if not folders:
        raise CaseError(f"{folder}: no case in it; each case is a folder with bench.json")
    return tuple(folders)


def diagnose_one(folder: Path, out: Path, diagnosing: Diagnosing, call: str = "") -> Row:
    """Diagnose a case and write its record, unless that is there already.

    Parameters
    ----------
    folder : Path
        Case folder.
    out : Path
        Output folder.
    diagnosing : callable
        The diagnosis.
    call : str, optional
        What distinguishes this call from others: Dask gives equal tasks one result, also where
        files have changed in between.

    Raises
    ------
    OSError, ImportError, MemoryError
        Faults of the machine, which are no result of a case.
    """
    path = out / CASES / f"{folder.name}.json"
    made_of = _made_of(folder, diagnosing)
    kept = _kept(path, made_of)
    if kept is not None:
        return kept
    began = time.perf_counter()
    diagnosis: dict[str, Any] | None = None
    error = ""
    try:
        diagnosis = dict(diagnosing(folder))
        row_of({"case": folder.name, "diagnosis": diagnosis, "seconds": 0.0, "error": ""})
        json.dumps(diagnosis, allow_nan=False)
    except (ImportError, OSError, MemoryError):
        raise
    except Exception as fault:  # one defect must not cost the other cases
        if is_ending():
            raise
        diagnosis, error = None, _one_line(fault)
    record = {
        "case": folder.name,
        "folder": str(folder),
        "made_of": made_of,
        "seconds": time.perf_counter() - began,
        "error": error,
        "diagnosis": diagnosis,
    }
    write_json(record, path)
    return row_of(record)


def _rows(
    folders: Sequence[Path], out: Path, diagnosing: Diagnosing, executor: Executor | None
) -> Iterator[Row]:
    """Yield the row of each case once, in any order."""
    call = secrets.token_hex(8)
    if executor is None:
        for folder in folders:
            yield _outcome(folder, partial(diagnose_one, folder, out, diagnosing, call))
        return
    futures: dict[Future[Row], Path] = {}
    try:
        for folder in folders:
            futures[executor.submit(diagnose_one, folder, out, diagnosing, call)] = folder
        neighbours = []
        for future in as_completed(futures):
            folder = futures[future]
            if type(future.exception()).__name__ == KILLED:
                neighbours.append(folder)
            else:
                yield _outcome(folder, future.result)
        for folder in neighbours:
            again = executor.submit(diagnose_one, folder, out, diagnosing, secrets.token_hex(8))
            yield _outcome(folder, again.result)
    except (BrokenExecutor, CancelledError) as error:
        raise PneumoError(
            f"the workers are gone ({_one_line(error)}): killed, out of memory or closed; finished "
            f"cases are in {out}, call it again to go on, with fewer workers if memory is short"
        ) from error
    finally:
        for future in futures:
            future.cancel()


def _outcome(folder: Path, result: Callable[[], Row]) -> Row:
    try:
        return result()
    except (BrokenExecutor, CancelledError):
        raise
    except Exception as error:  # a fault of one machine must not cost the other cases
        return Row(folder.name, FAILED, error=_one_line(error))


def _made_of(folder: Path, diagnosing: Diagnosing) -> dict[str, Any]:
    """Return what a record rests on: another one is asked for when any of it changes."""
    files = sorted(path for form in DATA for path in folder.glob(form) if path.is_file())
    how = f"{diagnosing.__module__}.{getattr(diagnosing, '__qualname__', repr(diagnosing))}"
    return {
        "pneumo_casadi": code_identity(),
        "diagnosing": how,
        "sha256": {path.name: sha256(path) for path in files},
    }


def _kept(path: Path, made_of: Mapping[str, Any]) -> Row | None:
    """Return the row of a record that is there, whole and made of the same."""
    try:
        record = read_json(path, "diagnose it")
        return row_of(record) if record["made_of"] == made_of else None
    except (ValueError, KeyError, TypeError):  # CaseError is a ValueError
        return None


def _check_names(folders: Sequence[Path]) -> None:
    names = [folder.name for folder in folders]
    if not names:
        raise CaseError("no case folder; give at least one")
    twice = sorted(name for name, number in Counter(names).items() if number > 1)
    if twice:
        raise CaseError(
            f"{len(twice)} names stand for more than one case folder ({', '.join(twice[:3])}), but "
            "records go by name; rename the folders, or diagnose them into different outputs"
        )


def _one_line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
