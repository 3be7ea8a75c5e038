"""The command ``validate``."""

from dataclasses import replace
from textwrap import fill
from typing import Any

from pneumo_casadi.cli.options import CasePath, Debug, Json, Output, Parameters, Strict
from pneumo_casadi.cli.terminal import (
    exit_unless_usable,
    guarded,
    progress_bar,
    say,
    show,
    width,
)
from pneumo_casadi.errors import CaseError


def validate(
    case: CasePath,
    parameters: Parameters,
    output: Output = None,
    json_file: Json = None,
    strict: Strict = False,
    debug: Debug = False,
) -> None:
    """Compare simulations with identified parameters with the held-out records of CASE.

    Open loop and closed loop over whole records, and windows of 0.1, 0.5 and 2 s. --strict refuses
    parameters whose simulation is far from the records. FOLDER, if given, gets report.html,
    result.json, curves.json, table.txt and figures.
    """
    with guarded(debug):
        from pneumo_casadi.data import read_case
        from pneumo_casadi.identification.read_result import read_axis, result_path
        from pneumo_casadi.identification.result_file import validation_dict
        from pneumo_casadi.identification.warnings import (
            judge_usability,
            simulation_sentence,
            validation_warnings,
        )
        from pneumo_casadi.report.pages.write import write_validation
        from pneumo_casadi.report.tables.validation import validation_table
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.runtime.output_folder import (
            OutputKind,
            check_replaceable,
            check_result_file,
        )
        from pneumo_casadi.runtime.progress import progress_range
        from pneumo_casadi.runtime.provenance import provenance
        from pneumo_casadi.validation import validate

        if output is not None:
            check_replaceable(output, OutputKind.VALIDATION)
        check_result_file(json_file, "validation")
        read = read_case(case)
        axis = read_axis(parameters, read)
        if not read.validate:
            raise CaseError(f"{case}: no held-out record; add validate.csv or validate.csv.gz")
        with progress_bar() as report:
            share = 1.0 if output is None else 0.7
            done = progress_range(report, 0.0, share)
            validation = validate(axis, read.validate, progress=done)
            files = [*read.files, result_path(parameters)]
            origin = dict(validation.provenance) | {"sha256": provenance(files, {})["sha256"]}
            validation = replace(validation, provenance=origin)
            if output is not None:
                rest = progress_range(report, share, 1.0, "report: ")
                write_validation(validation, output, rest)
        warnings = tuple(validation_warnings(validation))
        usability = judge_usability(warnings, simulation_sentence(validation))
        say(fill(usability.sentence, min(width(), 100)))
        say()
        show(validation_table(validation))
        if output is not None:
            say(f"\nreport: {output}/report.html")
        if json_file is not None:
            content: dict[str, Any] = {"usable": usability.usable.value, "reason": usability.reason}
            content |= {"validation": validation_dict(validation), "provenance": origin}
            write_json(content, json_file)
        exit_unless_usable(usability.usable, strict)
