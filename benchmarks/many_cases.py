"""Question: does the memory of a batch grow with the number of its cases.

Data: 1,000 cases of 2 s at 1 kHz, ten folders of each of 100 axes of the virtual bench; each axis
has one effect. Each case is diagnosed with a catalogue of one effect, in two processes. The memory
of the process that holds the batch is read before the first case and after each; its workers have
memory of their own.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from batch import WORKERS, linked, make_cases, one_effect
from provenance import made, write

from pneumo_casadi.evaluation.batch import diagnose_many
from pneumo_casadi.runtime.processes import processes

CASES, AXES, DURATION = 1000, 100, 2.0
BAR_MB = 100.0


def resident_MB() -> float:
    """Return the memory that this process has now [MB]."""
    status = Path("/proc/self/status").read_text("utf-8")
    return 1024e-6 * float(status.split("VmRSS:")[1].split()[0])


def run(cases: int, axes: int) -> dict[str, Any]:
    """Diagnose a batch and return what its process took."""
    with tempfile.TemporaryDirectory() as held:
        scratch = Path(held)
        folders = linked(make_cases(scratch / "axes", axes, DURATION), scratch / "cases", cases)
        levels: list[float] = []
        with processes(WORKERS) as pool:
            # The first cases load what every batch needs.
            diagnose_many(folders[:WORKERS], pool, keep=scratch / "first", diagnosing=one_effect)
            before, began = resident_MB(), time.perf_counter()
            rows = diagnose_many(
                folders,
                pool,
                keep=scratch / "out",
                progress=lambda text, share: levels.append(resident_MB()),
                diagnosing=one_effect,
            )
            seconds = time.perf_counter() - began
    failed = [f"{row.case}: {row.error}" for row in rows if row.error]
    if failed:
        raise SystemExit(failed[0])
    result = {
        "cases": len(rows),
        "duration_s": DURATION,
        "seconds": seconds,
        "before_MB": before,
        "largest_MB": max(levels),
        "grown_MB": max(levels) - before,
        "bar_MB": BAR_MB,
    }
    print(f"{len(rows)} cases in {seconds:.0f} s: {result['grown_MB']:.1f} MB more", flush=True)
    return result


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="ten cases of two axes")
    arguments = parser.parse_args()
    result = run(10, 2) if arguments.quick else run(CASES, AXES)
    write(arguments.json, {**made(0, arguments.quick, "pandas", "numba"), **result})


if __name__ == "__main__":
    main()
