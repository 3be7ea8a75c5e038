"""Report folders: written beside their place, then renamed, so that none is ever half there."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.comparison import Comparison
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict, validation_dict
from pneumo_casadi.identification.trajectory_file import (
    RecordSimulation,
    trajectory_frame,
    write_frames,
)
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.identification import html_report
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.tables.comparison import comparison_tables
from pneumo_casadi.report.tables.validation import validation_table
from pneumo_casadi.report.text.identification import render, text_report
from pneumo_casadi.runtime.atomic_files import atomic_folder
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.validation import Validation

if TYPE_CHECKING:
    from pneumo_casadi.report.pages.identification_figures import Drawn


class Kind(Enum):
    """Kinds of result folders: what each of them holds, its own mark first.

    A folder is replaced only by one of its own kind: a simulation must not cost the
    identification that it simulates.
    """

    IDENTIFICATION = ("report.html", "result.json", "table.txt", "figures")
    VALIDATION = ("table.txt", "result.json", "figures")
    SIMULATION = ("simulation",)
    DIAGNOSIS = ("diagnosis.json", "report.html", "summary.txt", "result.json", "figures")
    COMPARISON = ("comparison.json", "comparison.txt")
    DESIGN = ("design.json", "design.txt", "design.png", "reference.csv")


def write_identification(
    identification: Identification,
    folder: str | Path,
    paper: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write the report of an identification.

    Parameters
    ----------
    identification : Identification
        What was identified.
    folder : path
        Folder to make. One that holds an earlier report is replaced as a whole.
    paper : bool, optional
        Whether to set the paper's Table 1 beside the results.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Path
        The folder: ``result.json``, ``report.html``, ``table.txt``, ``figures/*.png``.

    Raises
    ------
    CaseError
        If the folder holds anything but an earlier report.
    """
    report = progress or no_progress
    with folder_in_one_step(folder, Kind.IDENTIFICATION) as draft:
        write_json(result_dict(identification), draft / "result.json")
        (draft / "table.txt").write_text(text_report(identification, paper), "utf-8")
        report("figures", 0.1)
        pictures = _save(_figures_of(identification), draft / "figures")
        (draft / "report.html").write_text(html_report(identification, pictures, paper), "utf-8")
    report("done", 1.0)
    return Path(folder)


def write_validation(validation: Validation, folder: str | Path) -> Path:
    """Write errors and figures of a validation on its own into a folder."""
    with folder_in_one_step(folder, Kind.VALIDATION) as draft:
        write_json({"validation": validation_dict(validation)}, draft / "result.json")
        (draft / "table.txt").write_text(render(validation_table(validation)) + "\n", "utf-8")
        _save(_figures_of(validation), draft / "figures")
    return Path(folder)


def write_simulations(runs: Sequence[RecordSimulation], folder: str | Path) -> tuple[Path, ...]:
    """Write simulations as CSV into ``folder/simulation``, one file a record."""
    with folder_in_one_step(folder, Kind.SIMULATION) as draft:
        (draft / "simulation").mkdir()
        frames = [(run.record.name, trajectory_frame(run)) for run in runs]
        written = write_frames(frames, draft / "simulation")
    return tuple(Path(folder) / "simulation" / path.name for path in written)


def write_comparison(comparison: Comparison, folder: str | Path) -> Path:
    """Write a comparison of results into a folder: ``comparison.json``, ``comparison.txt``."""
    with folder_in_one_step(folder, Kind.COMPARISON) as draft:
        write_json(comparison.as_dict(), draft / "comparison.json")
        tables = [render(table) for table in comparison_tables(comparison)]
        text = "\n\n\n".join([comparison.headline, *tables])
        (draft / "comparison.txt").write_text(text + "\n", "utf-8")
    return Path(folder)


def check_replaceable(folder: str | Path, kind: Kind) -> None:
    """Raise a `CaseError` if a folder is there that is not empty and not of this kind."""
    folder = Path(folder)
    if not folder.exists():
        return
    if not folder.is_dir():
        raise CaseError(f"{folder}: is a file; name a folder for the report")
    names = {path.name for path in folder.iterdir()}
    foreign = sorted(names - set(kind.value))
    if names and kind.value[0] not in names:
        foreign = sorted(names)
    if foreign:
        raise CaseError(
            f"{folder}: holds {', '.join(foreign[:3])}, which is no earlier {kind.name.lower()} "
            "and would be lost; choose another folder"
        )


def _figures_of(result: Identification | Validation) -> "Iterable[Drawn]":
    """Return the figures of a result; none without matplotlib."""
    if not can_draw():
        return ()
    from pneumo_casadi.report.pages.identification_figures import figures_of, validation_figures

    if isinstance(result, Validation):
        return validation_figures(result)
    return figures_of(result)


def _save(figures: "Iterable[Drawn]", folder: Path) -> list[Picture]:
    folder.mkdir()
    pictures = []
    for drawn in figures:
        picture = Picture(drawn.name, drawn.png(), drawn.caption)
        (folder / f"{picture.name}.png").write_bytes(picture.content)
        pictures.append(picture)
    return pictures


@contextmanager
def folder_in_one_step(folder: str | Path, kind: Kind) -> Iterator[Path]:
    """Yield a draft folder that takes the place of `folder` when all is well.

    After an error the draft is gone and `folder` is as it was.
    """
    check_replaceable(folder, kind)
    with atomic_folder(folder) as draft:
        yield draft
