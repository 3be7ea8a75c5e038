"""Question: does the diagnosis find causes that are withheld from it, and say so when it cannot.

Data: cases of the virtual bench, which shares no equation with the model: random axes with single
effects at three severities, pairs, nothing wrong, effects that parameters absorb, effects that the
catalogue of that run lacks, and effects that no catalogue has; 20 s at 1 kHz of chirp and squares
to identify on, 20 s of multisine and steps held out. The seed draws axes, effects, sizes,
references and noise; where none is given the system draws one, and the result tells it.

The hash of the labels is written before any case is diagnosed, and the labels are opened once every
verdict is on disk. How verdicts count is defined in `pneumo_casadi.evaluation.sealed_check.score`,
what is visible and what an oracle reaches in `pneumo_casadi.evaluation.sealed_check.measure`. With
``--keep`` an interrupted run goes on where it was.
"""

import argparse
import logging
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import provenance

from pneumo_casadi.cli.withheld import check
from pneumo_casadi.report.figures.studies.withheld import withheld_figure
from pneumo_casadi.report.figures.style import png
from pneumo_casadi.report.tables.sealed_check import withheld_table
from pneumo_casadi.report.text.identification import render


def told(text: str, share: float) -> None:
    """Print progress, one line a case."""
    print(text, file=sys.stderr, flush=True)


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=160, help="number of cases")
    parser.add_argument("--seed", type=int, help="of the draw; by default one of the system's")
    parser.add_argument("--workers", type=int, default=1, help="cases at a time")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="write the figure to this PNG file")
    parser.add_argument("--keep", type=Path, help="keep cases and verdicts here, and go on there")
    parser.add_argument(
        "--rivals", type=int, help="ask rivals of so many clean cases; by default of all"
    )
    parser.add_argument("--weak", default="small", help="weak effects have a tenth of this")
    parser.add_argument("--quick", action="store_true", help="two cases of four seconds")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    cases, duration = (2, 4.0) if arguments.quick else (arguments.cases, 20.0)
    with ExitStack() as stack:
        folder = arguments.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        own = arguments.rivals, arguments.weak
        result = check(folder, cases, arguments.seed, arguments.workers, duration, told, *own)
    print(render(withheld_table(result)))
    result = provenance.made(result["seed"], arguments.quick, "numba") | result
    provenance.write(arguments.json, result)
    if arguments.figure is not None:
        arguments.figure.write_bytes(png(withheld_figure(result)))


if __name__ == "__main__":
    main()
