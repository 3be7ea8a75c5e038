"""The command ``diagnose-many``: a folder of cases, one row each."""

import os
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from pneumo_casadi.cli.options import Debug
from pneumo_casadi.cli.terminal import FIT_FAILED, complain, guarded, progress_bar, say


def diagnose_many(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder whose folders are cases.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where records and tables go."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cases at a time; by default one a processor.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Diagnose all cases of a folder: one row each in cases.csv and cases.parquet.

    FOLDER (default: report/FOLDER-cases) gets the tables and cases/CASE.json, the whole diagnosis.
    Interrupted, or called again with more cases, it goes on where it was; cases whose data have
    changed are diagnosed anew. A case that fails has its error in its row (exit code 1).
    """
    keep = output or Path("report") / f"{folder.resolve().name}-cases"
    with guarded(debug, f"what was finished is in {keep}: call it again to go on"):
        from pneumo_casadi.evaluation.batch import CSV, FAILED, PARQUET, case_folders, diagnose_many
        from pneumo_casadi.runtime.processes import processes

        cases = case_folders(folder)
        wanted = min(workers or os.cpu_count() or 1, len(cases))
        with progress_bar() as report, processes(wanted) as executor:
            rows = diagnose_many(cases, executor, keep=keep, progress=report)
    counted = Counter(row.verdict for row in rows).most_common()
    say(f"{len(rows)} cases: " + ", ".join(f"{verdict} {n}" for verdict, n in counted))
    tables = [path for path in (keep / CSV, keep / PARQUET) if path.is_file()]
    say(f"tables: {', '.join(map(str, tables))}")
    failed = [row for row in rows if row.verdict == FAILED]
    if failed:
        first = failed[0]
        complain(f"{len(failed)} of {len(rows)} cases failed; {first.case}: {first.error}")
        raise typer.Exit(FIT_FAILED)
