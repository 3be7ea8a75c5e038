"""Question: what does the diagnosis say of the practice cases, and of those without labels.

Data: ``practice/`` of the data folder (one hidden effect each, named in ``labels.json``),
``practice_more/`` (effects of other forms, unlisted ones, and many weak ones), or ``blind/``, whose
labels are kept elsewhere; all from a bench program that shares no code with this package. Nothing
is random.

Each case is diagnosed with the whole catalogue on two processes. A practice verdict is right where
it names the labelled effect and no other, or finds nothing where nothing is wrong. Among weak
effects it is right where it names the labelled one first and none that is not there; of an unlisted
one where it says ``unknown`` and discovers a term over the right driver. Time and peak
memory (of all processes, with the libraries that they share counted each time) are those of a case
with machine code at hand; ``--cold`` gives every case an empty cache, compiler included.
"""

import argparse
import json
import logging
import os
import resource
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import provenance
import tables

from pneumo_casadi.data import read_case
from pneumo_casadi.diagnosis import DiagnosisOptions, diagnose
from pneumo_casadi.valve import FlowForm

WORKERS = 2
#: The form of the flow map is chosen, as `diagnose` does by default.
AUTO = "auto"
#: Drivers of the causes that no catalogue lists, by their labels.
DRIVERS = {"X_cogging": "x", "X_vibration": "t", "X_flow_drift": "t"}
GiB = 2**20  # ru_maxrss counts KiB


def one_case(folder: Path, form: FlowForm | None) -> dict[str, Any]:
    """Return the diagnosis of a case, with time and memory."""
    began = time.perf_counter()
    with ProcessPoolExecutor(WORKERS) as executor:
        options = DiagnosisOptions(flow_form=form)
        result = diagnose(read_case(folder), options=options, executor=executor).as_dict()
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    each = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    result["seconds"] = time.perf_counter() - began
    result["peak_GiB"] = (own + WORKERS * each) / GiB
    return result


def isolated(folder: Path, cold: bool, flow: str) -> dict[str, Any]:
    """Diagnose in a process of its own, so that memory is that of one case."""
    import subprocess

    with tempfile.TemporaryDirectory() as scratch:
        environment = dict(os.environ)
        if cold:
            environment["PNEUMO_CASADI_CACHE"] = scratch
        target = Path(scratch) / "verdict.json"
        command = [sys.executable, __file__, "--one", str(folder), "--json", str(target)]
        command += ["--flow", flow]
        subprocess.run(command, check=True, env=environment)
        content: dict[str, Any] = json.loads(target.read_text("utf-8"))
    return content


def right(verdict: dict[str, Any], label: dict[str, Any]) -> bool:
    """Tell whether a verdict is what the label says."""
    effects, weak = label["effects"], label.get("background", {})
    named = [effect["name"] for effect in verdict["effects"]]
    if effects and effects[0] in DRIVERS:
        term = verdict["discovered"] or {"driver": ""}
        return bool(verdict["verdict"] == "unknown" and term["driver"] == DRIVERS[effects[0]])
    if weak:
        return named[: len(effects)] == effects and set(named) <= {*effects, *weak}
    return sorted(named) == sorted(effects) and (bool(effects) or verdict["verdict"] == "none")


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="holds practice/ and the others")
    parser.add_argument("--more", action="store_true", help="other forms, unlisted, many weak ones")
    parser.add_argument("--blind", action="store_true", help="the cases without labels")
    parser.add_argument("--cold", action="store_true", help="an empty compile cache for each case")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--one", type=Path, help="one case folder only")
    parser.add_argument("--quick", action="store_true", help="two cases only")
    parser.add_argument(
        "--flow",
        choices=(AUTO, *(form.value for form in FlowForm)),
        default=AUTO,
        help="form of the flow map; by default chosen by its held-out error",
    )
    arguments = parser.parse_args()
    form = None if arguments.flow == AUTO else FlowForm(arguments.flow)
    logging.disable(logging.WARNING)
    if arguments.one is not None:
        provenance.write(arguments.json, one_case(arguments.one, form))
        return
    if arguments.data is None:
        parser.error("--data is needed")
    sets = {"blind": arguments.blind, "practice_more": arguments.more, "practice": True}
    source = arguments.data / next(name for name, wanted in sets.items() if wanted)
    names = sorted(p.name for p in source.iterdir() if p.is_dir() and not p.name.endswith("60s"))
    cases = {}
    for name in names[:2] if arguments.quick else names:
        cases[name] = isolated(source / name, arguments.cold, arguments.flow)
        seconds, peak = cases[name]["seconds"], cases[name]["peak_GiB"]
        print(f"{name}: {cases[name]['verdict']}, {seconds:.0f} s, {peak:.2f} GiB", flush=True)
    told = provenance.made(None, arguments.quick)
    if arguments.blind:
        provenance.write(arguments.json, cases | told)
        return
    labels = json.loads((source / "labels.json").read_text("utf-8"))
    for name, case in cases.items():
        case["right"] = right(case, labels[name])
    result: dict[str, Any] = {
        "cases": cases,
        "right": sum(case["right"] for case in cases.values()),
        "of": len(cases),
        "cold_cache": arguments.cold,
        "longest_s": max(case["seconds"] for case in cases.values()),
        "peak_GiB": max(case["peak_GiB"] for case in cases.values()),
    }
    print(tables.verdicts(result))
    print({key: value for key, value in result.items() if key != "cases"})
    provenance.write(arguments.json, result | told)


if __name__ == "__main__":
    main()
