"""The command ``diagnose``: where simulation and measurement disagree, and why."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneumo_casadi.cli.options import (
    CasePath,
    Debug,
    Degrees,
    Flow,
    FlowOption,
    Json,
    Output,
    Strict,
    degrees_of,
    report_folder,
)
from pneumo_casadi.cli.terminal import exit_unless_usable, guarded, progress_bar, say
from pneumo_casadi.errors import CaseError, PneumoError

if TYPE_CHECKING:
    from pneumo_casadi.data import Case
    from pneumo_casadi.diagnosis import Diagnosis
    from pneumo_casadi.identification.result import Identification
    from pneumo_casadi.model.effect import Effect
    from pneumo_casadi.runtime.progress import Progress

#: What workers import.
DIAGNOSIS = "pneumo_casadi.diagnosis.diagnose"


def diagnose(
    case: CasePath,
    output: Output = None,
    json_file: Json = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Fits in parallel; default: one per processor, at most four."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT", help="Leave this effect out of the catalogue; can be repeated."
        ),
    ] = None,
    catalogue: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Add the effects of a file to the catalogue: discovered_term.json of an earlier "
            "diagnosis, or Python source with EFFECTS, which is executed with your rights.",
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Store finished fits here, to resume an interrupted diagnosis."
        ),
    ] = None,
    flow: Flow = FlowOption.AUTO,
    degrees: Degrees = None,
    refine: Annotated[
        bool,
        typer.Option(
            help="Refine the final model by output error and write it to result.json, which "
            "validate, simulate, export, design and compare take."
        ),
    ] = True,
    strict: Strict = False,
    debug: Debug = False,
) -> None:
    """Diagnose an axis: where model and measurement disagree, and which effect explains it.

    Verdicts: effect (one or more effects of the catalogue), ambiguous (several explain the data
    equally well), absorbed (the parameters contradict geometry or data sheet), unknown (no effect
    of the catalogue explains the data), none. FOLDER (default: report/CASE-diagnosis) gets
    report.html, summary.txt, diagnosis.json, curves.json, result.json and figures. --strict
    refuses a final model that is not to be used, or that could not be refined.
    """
    kept = "nothing was written" if keep is None else f"finished fits are in {keep}"
    with guarded(debug, kept):
        if strict and not refine:
            raise CaseError("--strict: --no-refine makes no final model that could be refused")

        from pneumo_casadi.runtime.output_folder import (
            OutputKind,
            check_replaceable,
            check_result_file,
        )
        from pneumo_casadi.runtime.processes import processes

        folder = report_folder(output, case, "-diagnosis")
        check_replaceable(folder, OutputKind.DIAGNOSIS)
        check_result_file(json_file, "verdict")
        # Workers import what they need while this process does.
        with processes(_workers(workers, catalogue), (DIAGNOSIS,)) as executor:
            from pneumo_casadi.data import read_case
            from pneumo_casadi.diagnosis import DiagnosisOptions
            from pneumo_casadi.diagnosis.diagnose import diagnose
            from pneumo_casadi.identification.warnings import Usable
            from pneumo_casadi.report.pages.diagnosis import write_diagnosis
            from pneumo_casadi.report.text.diagnosis import summary_text
            from pneumo_casadi.runtime.json_files import write_json
            from pneumo_casadi.runtime.progress import progress_range

            effects = effects_without(without or ())
            if catalogue is not None:
                effects |= effects_of_file(catalogue)
            read = read_case(case)
            refined, failure = None, ""
            with progress_bar() as report:
                options = DiagnosisOptions(keep, flow.form, degrees_of(degrees))
                stage = progress_range(report, 0.0, 0.7 if refine else 0.97)
                result = diagnose(read, effects, options, stage, executor)
                if refine:
                    stage = progress_range(report, 0.7, 0.97, "final model: ")
                    refined, failure = _refined(read, result, stage)
                report("report", 0.97)
                write_diagnosis(result, folder, effects, refined, executor)
        if json_file is not None:
            write_json(result.as_dict(), json_file)
        say(summary_text(result, effects, refined))
        if failure:
            say(f"no result.json: {failure}\n")
        say(f"report: {folder}/report.html")
        if refine:
            usable = Usable.NO if refined is None else refined.usability.usable
            exit_unless_usable(usable, strict)


def _refined(
    case: "Case", diagnosis: "Diagnosis", progress: "Progress"
) -> "tuple[Identification | None, str]":
    """Return the final model refined by output error; where that fails, None and the reason."""
    from pneumo_casadi.diagnosis.refined_identification import refine_diagnosis
    from pneumo_casadi.effects import EFFECTS

    own = [effect.name for effect in diagnosis.final_effects if effect.form not in EFFECTS]
    if own:
        return None, f"{own[0]} is an effect of a file, which result.json cannot hold"
    try:
        return refine_diagnosis(case, diagnosis, progress), ""
    except PneumoError as error:  # the diagnosis is done: it is written all the same
        return None, str(error)


def effects_without(names: Sequence[str]) -> "dict[str, type[Effect]]":
    """Return the catalogue of effects without some of them.

    Raises
    ------
    CaseError
        If there is no such effect, or none is left.
    """
    from pneumo_casadi.effects import EFFECTS

    unknown = [name for name in names if name not in EFFECTS]
    if unknown:
        raise CaseError(f"--without: no effect {unknown[0]!r}; there are {', '.join(EFFECTS)}")
    effects = {
        name: effect
        for name, effect in EFFECTS.items()
        if name not in names and effect.cause not in names
    }
    if not effects:
        raise CaseError("--without leaves no effect in the catalogue")
    return effects


def effects_of_file(path: Path) -> "dict[str, type[Effect]]":
    """Return the effects of a file, which a terminal is told are code where they are.

    Raises
    ------
    ModelError
        If the file has none.
    """
    from pneumo_casadi.effects.term import read_catalogue

    if path.suffix == ".py":
        say(f"executing {path} (--catalogue)")
    return read_catalogue(path)


def _workers(asked_for: int | None, catalogue: Path | None) -> int:
    """Return how many fits run at a time; one with classes that other processes cannot import."""
    if catalogue is not None and catalogue.suffix == ".py":
        return 1
    from pneumo_casadi.runtime.processes import default_workers

    return asked_for or default_workers()
