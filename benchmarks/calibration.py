"""Question: how often do stated probabilities come true.

Data: results of sealed checks (`withheld.py`), each on fresh draws with the code of its time; their
cases without weak effects, together. Some hundred cases of one check cannot tell an error of a few
per cent from chance: `error_if_exact` is the mean error that exact probabilities would show.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import provenance

from pneumo_casadi.evaluation.sealed_check import calibration
from pneumo_casadi.evaluation.sealed_check.draw import Draw


def statements(result: Mapping[str, Any]) -> list[tuple[float, bool]]:
    """Return the probability stated of the first name, and whether it is right, of each case."""
    told = []
    for case in result["each"]:
        draw = Draw.of(case)
        if draw.background:
            continue
        first = case["ranking"][:1] == [" + ".join(sorted(draw.effects))]
        told.append((case["probability"], bool(draw.listed and draw.effects and first)))
    return told


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, nargs="+", help="JSON files of sealed checks")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    told = [statements(json.loads(path.read_text("utf-8"))) for path in arguments.results]
    together = [statement for check in told for statement in check]
    figures = {
        "checks": [calibration(*zip(*check, strict=True)).as_dict() for check in told],
        "together": calibration(*zip(*together, strict=True)).as_dict(),
        "cases": len(together),
    }
    for check in (*figures["checks"], figures["together"]):
        print({key: value for key, value in check.items() if key != "bins"})
    provenance.write(arguments.json, {**provenance.made(None, False), **figures})


if __name__ == "__main__":
    main()
