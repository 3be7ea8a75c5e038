"""The command ``withheld``: the sealed check of the diagnosis."""

import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneumo_casadi.cli.options import Debug, Json
from pneumo_casadi.cli.terminal import guarded, progress_bar, say, show
from pneumo_casadi.errors import CaseError

if TYPE_CHECKING:
    from pneumo_casadi.runtime.progress import Progress


def withheld(
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Output folder for cases and verdicts."
        ),
    ],
    cases: Annotated[int, typer.Option(min=1, help="Number of cases.")] = 160,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed of the random cases; default: random."),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, help="Cases in parallel.")] = 1,
    duration: Annotated[float, typer.Option(help="Length of each record [s].")] = 20.0,
    rivals: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Number of clean cases for the simple alternative methods; default: all.",
        ),
    ] = None,
    weak: Annotated[
        str, typer.Option(help="What weak effects besides have a tenth of: small or medium.")
    ] = "small",
    json_file: Json = None,
    debug: Debug = False,
) -> None:
    """Check the diagnosis on random cases whose causes it does not know (sealed check).

    The virtual bench draws axes and effects; the hash of the labels is written before any case is
    diagnosed, and the labels are opened once every verdict is on disk. Called again with the same
    folder, it resumes.
    """
    with guarded(debug, f"finished cases are in {output}; run the same command again to resume"):
        from pneumo_casadi.report.pages.drawing import can_draw
        from pneumo_casadi.report.tables.sealed_check import withheld_table
        from pneumo_casadi.runtime.atomic_files import atomic_file
        from pneumo_casadi.runtime.json_files import write_json
        from pneumo_casadi.runtime.output_folder import check_result_file

        check_result_file(json_file, "seed")
        with progress_bar() as report:
            scores = check(output, cases, seed, workers, duration, report, rivals, weak)
        show(withheld_table(scores))
        if can_draw():
            from pneumo_casadi.evaluation.sealed_check.check import FIGURE
            from pneumo_casadi.report.figures.studies.withheld import withheld_figure
            from pneumo_casadi.report.figures.style import png

            with atomic_file(output / FIGURE) as draft:
                draft.write_bytes(png(withheld_figure(scores)))
        if json_file is not None:
            write_json(scores, json_file)
        say(f"\nscores: {output / 'scores.json'}")


def check(
    folder: Path,
    cases: int,
    seed: int | None,
    workers: int,
    duration: float,
    report: "Progress",
    rivals: int | None = None,
    weak: str = "small",
) -> dict[str, Any]:
    """Run the sealed check in a folder and return its scores.

    Parameters
    ----------
    folder : path
        Where cases and verdicts go, or went before.
    cases : int
        How many.
    seed : int or None
        Of the draw; None takes that of the folder, or a new one.
    workers : int
        Cases at a time.
    duration : float
        Of each record [s].
    report : callable
        Called with a text and the share of the present stage.
    rivals : int, optional
        Clean cases of which simple rivals are asked.
    weak : str
        Severity that weak effects besides have a tenth of.

    Raises
    ------
    CaseError
        If the folder holds another draw, or labels or verdicts were tampered with.
    MissingExtraError
        If numba is not installed.
    """
    from pneumo_casadi.evaluation.sealed_check import (  # needs the extra `bench`
        WithheldOptions,
        check_withheld,
    )
    from pneumo_casadi.evaluation.sealed_check.check import NAMES
    from pneumo_casadi.runtime.output_folder import OutputKind, claim_names
    from pneumo_casadi.runtime.processes import worker_pool
    from pneumo_casadi.virtual_bench.catalogue import severity_of

    claim_names(folder, OutputKind.SEALED_CHECK, NAMES)
    chosen = _seed_of(folder) if seed is None else seed
    with worker_pool(workers) as executor:
        scores = check_withheld(
            folder,
            WithheldOptions(
                cases, chosen, duration=duration, rivals=rivals, weak=severity_of(weak)
            ),
            executor,
            progress=report,
        )
    return {**scores, "seed": chosen, "duration_seconds": duration, "weak": weak}


def _seed_of(folder: Path) -> int:
    """Return the seed that an earlier call kept in a folder, or keep a new one."""
    from pneumo_casadi.evaluation.sealed_check.check import SEED_FILE
    from pneumo_casadi.runtime.atomic_files import atomic_file

    path = folder / SEED_FILE
    if path.is_file():
        try:
            return int(path.read_text("utf-8"))
        except ValueError:
            raise CaseError(f"{path}: not an integer; give --seed") from None
    drawn = secrets.randbits(48)
    with atomic_file(path) as draft:
        draft.write_text(f"{drawn}\n", encoding="utf-8")
    return drawn
