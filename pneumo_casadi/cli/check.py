"""The command ``check``: what the data of a case are worth, before anything is fitted."""

import typer

from pneumo_casadi.cli.options import CasePath, Debug, Json, Strict
from pneumo_casadi.cli.terminal import NOT_USABLE, guarded, say


def check(
    case: CasePath, json_file: Json = None, strict: Strict = False, debug: Debug = False
) -> None:
    """Check the data of a case in seconds: mistakes, noise, motion, and what to record next.

    The first line names the gravest finding; its entries can be pasted into columns.json or
    bench.json. Nothing is fitted. --strict refuses a case with a severe finding.
    """
    with guarded(debug):
        from pneumo_casadi.data.check import check
        from pneumo_casadi.runtime.json_files import without_infinities, write_json

        result = check(case)
        say(result.summary())
        if json_file is not None:
            write_json(without_infinities(result.as_dict()), json_file)
        if strict and not result.usable:
            raise typer.Exit(NOT_USABLE)
