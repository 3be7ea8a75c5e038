"""The command line, put together from one module per command."""

from collections.abc import Sequence
from typing import Annotated, Any

import typer

from pneumo_casadi import __version__
from pneumo_casadi.cli.cases import check, example, init
from pneumo_casadi.cli.compare import compare, report
from pneumo_casadi.cli.design import design
from pneumo_casadi.cli.diagnose import diagnose
from pneumo_casadi.cli.diagnose_many import diagnose_many
from pneumo_casadi.cli.export import export
from pneumo_casadi.cli.identify import demo, identify
from pneumo_casadi.cli.simulate import simulate
from pneumo_casadi.cli.terminal import BAD_INPUT, OK, complain, say
from pneumo_casadi.cli.validate import validate
from pneumo_casadi.cli.withheld import withheld

app = typer.Typer(
    help="Identify physical parameters of pneumatic servo axes from recordings, with intervals.",
    epilog="Exit codes: 0 success, 1 a fit failed, 2 bad input or usage, "
    "3 a result that --strict refuses, 130 interrupted, 129 or 143 ended by SIGHUP or SIGTERM.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


def _version(wanted: bool) -> None:
    if wanted:
        say(f"pneumo-casadi {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Identify physical parameters of pneumatic servo axes from recordings, with intervals."""


for _command in (
    demo,
    example,
    init,
    check,
    identify,
    validate,
    simulate,
    diagnose,
    compare,
    report,
    diagnose_many,
    export,
    withheld,
    design,
):
    app.command()(_command)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    command: Any = app
    try:
        code = command(
            args=None if arguments is None else list(arguments),
            prog_name="pneumo-casadi",
            standalone_mode=False,
        )
    except Exception as error:
        # Errors of usage carry their own exit code and message; anything else is a defect.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        complain(f"{message()} Try pneumo-casadi --help.")
        return BAD_INPUT
    return int(code or OK)
