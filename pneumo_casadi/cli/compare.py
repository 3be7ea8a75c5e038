"""The commands ``compare`` and ``report``: results side by side, and reports from result files."""

from pathlib import Path
from textwrap import fill
from typing import Annotated

import typer

from pneumo_casadi.cli.options import Debug, Json, Output
from pneumo_casadi.cli.terminal import guarded, progress_bar, say, show, width


def compare(
    results: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B [...]",
            help="Report folders of identify or diagnose, their result.json, or case folders.",
        ),
    ],
    output: Output = None,
    json_file: Json = None,
    debug: Debug = False,
) -> None:
    """Compare results: which parameters moved by how many standard deviations.

    Also simulates the records of each with the parameters of each. Cases are identified first. The
    others are compared with A. FOLDER, if given, gets report.html, comparison.txt,
    comparison.json and figures.
    """
    with guarded(debug):
        from pneumo_casadi.identification.compare import compare
        from pneumo_casadi.report.pages.write import write_comparison
        from pneumo_casadi.report.tables.comparison import comparison_tables
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.runtime.output_folder import (
            OutputKind,
            check_replaceable,
            check_result_file,
        )
        from pneumo_casadi.runtime.progress import progress_range

        if output is not None:
            check_replaceable(output, OutputKind.COMPARISON)
        check_result_file(json_file, "differences")
        with progress_bar() as report:
            # Drawing takes about as long as comparing two results does.
            share = 1.0 if output is None else 0.5
            comparison = compare(*results, progress=progress_range(report, 0.0, share))
            if output is not None:
                rest = progress_range(report, share, 1.0, "report: ")
                write_comparison(comparison, output, rest)
        if json_file is not None:
            write_json(comparison.as_dict(), json_file)
        say(fill(comparison.headline, min(width(), 100)))
        for table in comparison_tables(comparison):
            say()
            show(table)
        if output is not None:
            say(f"\nreport: {output}")


def report(
    result: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Report folder of identify, validate, diagnose, compare or design, or its result "
            "file.",
        ),
    ],
    debug: Debug = False,
) -> None:
    """Write report.html again from a result file alone, without the records.

    Curves come from curves.json beside it. Reports are complete then, but for that of an
    identification: its figures that need the records are left out.
    """
    with guarded(debug):
        from pneumo_casadi.report.pages.again import write_report_again

        say(f"report: {write_report_again(result)}")
