"""The commands ``example``, ``init`` and ``check``: make a case, and see what it is worth."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneumo_casadi.cli.options import CasePath, Debug, Json, Strict
from pneumo_casadi.cli.terminal import NOT_USABLE, guarded, say
from pneumo_casadi.errors import CaseError

if TYPE_CHECKING:
    from pneumo_casadi.data.readers.column_guess import ColumnGuess

#: Option of the command line -> what it asks for; all of them are needed.
QUESTIONS = {
    "piston": "diameter of the piston [mm]",
    "rod": "diameter of the rod [mm]",
    "stroke": "stroke [mm]",
    "supply": "supply pressure [bar gauge]",
}
Files = Annotated[list[Path], typer.Argument(metavar="CSV...", help="Records to identify on.")]


def example(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New folder of the case.")],
    debug: Debug = False,
) -> None:
    """Write a small case to start from: 10 s to identify on and 8 s held out, at 1 kHz.

    Its CSV files have names and units of their own (bar gauge, mm, ms), and columns.json says what
    they are: replace them by yours.
    """
    with guarded(debug):
        from pneumo_casadi.data.example_folder import write_example

        case = write_example(folder)
        for path in sorted(case.folder.iterdir()):
            say(str(path))
        say(f"\nnext: pneumo-casadi check {folder}\nthen: pneumo-casadi identify {folder}")


def check(
    case: CasePath, json_file: Json = None, strict: Strict = False, debug: Debug = False
) -> None:
    """Check the data of a case in seconds: mistakes, noise, motion, and what to record next.

    The first line names the gravest finding; its entries can be pasted into columns.json or
    bench.json. Nothing is fitted. --strict refuses a case with a severe finding.
    """
    with guarded(debug):
        from pneumo_casadi.data.check import check
        from pneumo_casadi.data.truth import read_truth
        from pneumo_casadi.runtime.json_files import without_infinities, write_json
        from pneumo_casadi.runtime.output_folder import check_result_file

        check_result_file(json_file, "findings")
        result = check(case)
        read_truth(case)  # a fit reads it, and would refuse it
        say(result.summary())
        if json_file is not None:
            write_json(without_infinities(result.as_dict()), json_file)
        if strict and not result.usable:
            raise typer.Exit(NOT_USABLE)


def init(
    files: Files,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="New folder of the case.")
    ],
    validate: Annotated[
        list[Path] | None, typer.Option(metavar="FILE", help="Record to hold out; can be repeated.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CHANNEL=NAME[:UNIT]",
            help="Column of a channel, as p_P=pA:bar or u=valve; can be repeated.",
        ),
    ] = None,
    piston: Annotated[float | None, typer.Option(help="Diameter of the piston [mm].")] = None,
    rod: Annotated[float | None, typer.Option(help="Diameter of the rod [mm].")] = None,
    stroke: Annotated[float | None, typer.Option(help="Stroke [mm].")] = None,
    supply: Annotated[float | None, typer.Option(help="Supply pressure [bar gauge].")] = None,
    ambient: Annotated[float, typer.Option(help="Ambient pressure, absolute [bar].")] = 1.01325,
    temperature: Annotated[float, typer.Option(help="Temperature of the air [°C].")] = 20.0,
    double_rod: Annotated[
        bool, typer.Option("--double-rod", help="The rod goes through both covers.")
    ] = False,
    angle: Annotated[
        float, typer.Option(help="Inclination of +x above the horizontal [°]; 90: vertical.")
    ] = 0.0,
    force: Annotated[float, typer.Option(help="Constant force on the rod in +x [N].")] = 0.0,
    gauge: Annotated[
        bool, typer.Option("--gauge", help="The pressures are relative to ambient.")
    ] = False,
    gain: Annotated[
        float | None, typer.Option(help="Gain of a proportional controller [V/m], with --u-max.")
    ] = None,
    u_max: Annotated[float | None, typer.Option(help="Largest command [V].")] = None,
    flow_map: Annotated[
        Path | None, typer.Option(metavar="CSV", help="Metered static flow of the valve.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Write bench.json and columns.json from the columns of log files, and copy the files.

    Files are CSV, MAT or Parquet.

    Channels and units are guessed from names and magnitudes, and shown. What is not given is asked
    for, if there is a terminal. A folder that holds something is left as it is.
    """
    given = {"piston": piston, "rod": rod, "stroke": stroke, "supply": supply}
    with guarded(debug):
        from pneumo_casadi.data.cylinder import Cylinder
        from pneumo_casadi.data.new_case import make_folder, read_header, sampling_frequency_of
        from pneumo_casadi.data.proposed_columns import guess_columns

        columns = read_header(files[0])
        size = _complete(given)
        cylinder = Cylinder(
            piston=1e-3 * size["piston"],
            rod=1e-3 * size["rod"],
            stroke=1e-3 * size["stroke"],
            supply=1e5 * (size["supply"] + ambient),
            ambient=1e5 * ambient,
            temperature=temperature + 273.15,
            double_rod=double_rod,
            gauge=gauge,
        )
        guesses = guess_columns(columns, cylinder, _stated(column or []))
        make_folder(
            output,
            cylinder,
            guesses,
            {"identify": files, "validate": validate or []},
            sampling_frequency_of(guesses, columns),
            {"controller": _controller(gain, u_max), **_load(angle, force)},
            flow_map,
        )
        for guess in guesses:
            offset = f", {guess.offset:+g} [SI]" if guess.offset else ""
            sign = ", reversed" if guess.scale is not None and guess.scale < 0 else ""
            say(f"{guess.channel:9} from column {guess.column} [{guess.unit}]{sign}{offset}")
        _ask_for_units(guesses)
        say(f"\nwritten: {output}/bench.json, {output}/columns.json")
        say(f"next: pneumo-casadi check {output}")


def _ask_for_units(guesses: Sequence["ColumnGuess"]) -> None:
    """Say which lengths may be in another unit as well, and how to state it."""
    for guess in guesses:
        if guess.doubts:
            units = " or ".join(f"{unit} ({1e3 * travel:g} mm)" for unit, travel in guess.doubts)
            say(
                f"\nis {guess.column} in {units}? Its name does not say, and each travel fits the "
                f"stroke; state it, as --column '{guess.channel}={guess.column}:"
                f"{guess.doubts[1][0]}'"
            )


def _complete(given: dict[str, float | None]) -> dict[str, float]:
    """Return the values, those that are missing asked for.

    Raises
    ------
    CaseError
        If there is no terminal to ask at.
    """
    missing = [name for name, value in given.items() if value is None]
    if missing and not sys.stdin.isatty():
        options = ", ".join(f"--{name} ({QUESTIONS[name]})" for name in missing)
        raise CaseError(f"there is no terminal to ask at: give {options}")
    return {
        name: value if value is not None else typer.prompt(QUESTIONS[name], type=float)
        for name, value in given.items()
    }


def _stated(texts: list[str]) -> dict[str, tuple[str, str]]:
    stated = {}
    for text in texts:
        channel, equals, column = text.partition("=")
        name, _, unit = column.partition(":")
        if not equals or not name:
            raise CaseError(f"--column {text}: expected CHANNEL=NAME or CHANNEL=NAME:UNIT")
        stated[channel.strip()] = (name.strip(), unit.strip())
    return stated


def _load(angle: float, force: float) -> dict[str, Any]:
    return {"load": {"angle_deg": angle, "force_N": force}} if angle or force else {}


def _controller(gain: float | None, u_max: float | None) -> dict[str, Any]:
    if gain is None:
        return {"type": "none"} | ({} if u_max is None else {"u_max_V": u_max})
    if u_max is None:
        raise CaseError("--gain: a controller has a largest command; give --u-max as well")
    return {"type": "proportional", "gain_V_per_m": gain, "u_max_V": u_max}
