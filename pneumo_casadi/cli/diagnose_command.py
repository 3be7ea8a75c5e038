"""What ``diagnose`` does: where simulation and reality part, why, and how far the gap closes."""

import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import typer

from pneumo_casadi.cli.flow_option import Degrees, Flow, FlowOption, degrees_of
from pneumo_casadi.cli.terminal import guarded, out, progress_bar
from pneumo_casadi.data import Case, read_case
from pneumo_casadi.diagnosis import DiagnosisOptions, diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.identify import IdentifyOptions
from pneumo_casadi.identification.result_file import provenance, write_json
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.report.pages.diagnosis import write_diagnosis
from pneumo_casadi.report.pages.write import Kind, check_replaceable
from pneumo_casadi.report.text.diagnosis import summary_text
from pneumo_casadi.runtime.progress import progress_range

#: More processes than this do not help: one part after another waits for the last fit.
MOST_WORKERS = 4
#: What tells linear algebra how many threads it may start; read when a process begins.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def diagnose_command(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", help="Folder with bench.json and records.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where the report goes."),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the diagnosis here as JSON."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Fits at a time; by default one a processor, four at most."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT", help="Leave this effect out of the catalogue; may be repeated."
        ),
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Keep finished fits here; interrupted work goes on from them."
        ),
    ] = None,
    flow: Flow = FlowOption.AUTO,
    degrees: Degrees = None,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks and the log.")] = False,
) -> None:
    """Diagnose an axis: where simulation and reality part, why, and how far the gap closes.

    Verdicts: an effect of the catalogue (or several), several that the data cannot tell apart, one
    that hides in the parameters, an unknown one, or nothing wrong. FOLDER (default:
    report/CASE-diagnosis) gets report.html, summary.txt, diagnosis.json and figures.
    """
    kept = "nothing was written" if keep is None else f"finished fits are in {keep}"
    with guarded(debug, kept):
        folder = output or Path("report") / f"{case.resolve().name}-diagnosis"
        check_replaceable(folder, Kind.DIAGNOSIS)
        chosen = catalogue_without(without or ())
        found_case = read_case(case)
        with progress_bar() as report, processes(workers or default_workers()) as executor:
            found = diagnose(
                found_case,
                chosen,
                DiagnosisOptions(keep, flow.form, degrees_of(degrees)),
                progress_range(report, 0.0, 0.97),
                executor,
            )
            report("report", 0.97)
            origin = origin_of(found_case, without or ())
            write_diagnosis(found, folder, chosen, origin)
        if json_file is not None:
            write_json(found.as_dict() | {"provenance": origin}, json_file)
        out.print(summary_text(found, chosen), markup=False, soft_wrap=True)
        out.print(f"report: {folder}/report.html", soft_wrap=True)


def catalogue_without(names: Sequence[str]) -> dict[str, type[Effect]]:
    """Return the catalogue without some effects.

    Raises
    ------
    CaseError
        If there is no such effect, or none is left.
    """
    unknown = [name for name in names if name not in EFFECTS]
    if unknown:
        raise CaseError(f"--without: no effect {unknown[0]!r}; there are {', '.join(EFFECTS)}")
    found = {name: effect for name, effect in EFFECTS.items() if name not in names}
    if not found:
        raise CaseError("--without leaves no effect in the catalogue")
    return found


def origin_of(case: Case, without: Sequence[str]) -> dict[str, Any]:
    """Return what is needed to repeat a diagnosis: versions, hashes of the data, options."""
    known = provenance(case, IdentifyOptions())
    left_out = list(dict.fromkeys(without))
    return {key: known[key] for key in ("versions", "platform", "sha256")} | {
        "options": {"without": left_out}
    }


def default_workers() -> int:
    """Return how many fits run at a time if nothing is said."""
    return min(os.cpu_count() or 1, MOST_WORKERS)


@contextmanager
def processes(workers: int) -> Iterator[Executor | None]:
    """Yield an executor of so many processes, None for one: then all is done in this process."""
    if workers == 1:
        yield None
        return
    # A forked process would inherit the threads of compiled models in whatever state they are.
    context = get_context("spawn")
    executor = ProcessPoolExecutor(workers, context, initializer=_leave_interruption_to_the_parent)
    # Processes share the cores; a linear algebra that wants them all besides slows every fit.
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update({name: "1" for name, value in before.items() if value is None})
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def _leave_interruption_to_the_parent() -> None:
    """Let Ctrl-C end the fits that have begun, which are kept, and no other."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
