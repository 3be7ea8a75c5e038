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
        Path, typer.Argument(metavar="FOLDER", help="Folder that contains case folders.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Output folder for records and tables."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cases in parallel; default: one per processor.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Diagnose all cases of a folder, one row per case in cases.csv and cases.parquet.

    FOLDER (default: report/FOLDER-cases) gets the tables and cases/CASE.json, the whole diagnosis.
    Called again after an interruption or with more cases, it resumes; cases with changed data are
    diagnosed again. A case that fails has its error in its row (exit code 1).
    """
    keep = output or Path("report") / f"{folder.resolve().name}-cases"
    with guarded(debug, f"finished cases are in {keep}; run the same command again to resume"):
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
