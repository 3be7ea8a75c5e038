"""The command ``validate``."""

from pneumo_casadi.cli.options import CasePath, Debug, Json, Output, Parameters
from pneumo_casadi.cli.terminal import guarded, progress_bar, say, show
from pneumo_casadi.errors import CaseError


def validate(
    case: CasePath,
    parameters: Parameters,
    output: Output = None,
    json_file: Json = None,
    debug: Debug = False,
) -> None:
    """Compare simulations with identified parameters with the held-out records of CASE.

    Open loop and closed loop over whole records, and windows of 0.1, 0.5 and 2 s.
    """
    with guarded(debug):
        from pneumo_casadi.data import read_case
        from pneumo_casadi.identification.result_file import read_axis, validation_dict
        from pneumo_casadi.report.pages.write import Kind, check_replaceable, write_validation
        from pneumo_casadi.report.tables.results import validation_table
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.validation import validate

        if output is not None:
            check_replaceable(output, Kind.VALIDATION)
        read = read_case(case)
        axis = read_axis(parameters, read)
        if not read.validate:
            raise CaseError(f"{case}: no held-out record; add validate.csv or validate.csv.gz")
        with progress_bar() as report:
            validation = validate(axis, read.validate, progress=report)
        show(validation_table(validation))
        if output is not None:
            write_validation(validation, output)
            say(f"\nreport: {output}")
        if json_file is not None:
            write_json({"validation": validation_dict(validation)}, json_file)
