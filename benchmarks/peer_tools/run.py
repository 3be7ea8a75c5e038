"""Run one tool on one problem in this process: ``python -m peer_tools.run TOOL FOLDER``.

The folder holds ``problem``; ``answer.json`` is written to it, with the times of building and
solving (importing the tool is counted apart) and the peak of memory.
"""

import importlib
import json
import resource
import sys
import time
from pathlib import Path

from peer_tools.estimation import Answer, Estimation

#: Address space of a tool and of each program it starts [byte]; beyond, it fails by itself.
MEMORY = 16 * 2**30


def main() -> None:
    """Build, solve, write down."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    name, folder = sys.argv[1], Path(sys.argv[2])
    began = time.perf_counter()
    tool = importlib.import_module(f"peer_tools.{name}")
    problem = Estimation.read(folder / "problem")
    start = time.perf_counter()
    built = tool.build(problem)
    middle = time.perf_counter()
    answer: Answer = tool.solve(problem, built)
    end = time.perf_counter()
    solve_s = end - middle if answer.solve_s is None else answer.solve_s
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    results = {
        "import_s": start - began,
        "build_s": end - start - solve_s,
        "solve_s": solve_s,
        # Linux counts in KiB. A tool and the program it starts may peak together: their sum.
        "peak_GB": sum(item.ru_maxrss for item in used) * 1024 / 1e9,
        "theta": [float(value) for value in answer.theta],
        "x_0": [float(value) for value in answer.x_0],
        "objective": float(answer.objective),
        "status": answer.status,
        "iterations": answer.iterations,
        "version": tool.version(),
    }
    (folder / "answer.json").write_text(json.dumps(results))


if __name__ == "__main__":
    main()
