"""Run one tool on one problem in this process: ``python -m peer_tools.run TOOL FOLDER [again]``.

The folder holds ``problem``; ``answer.json`` is written to it with the times, and the peak of
memory: of importing, building and solving; of all since the process was started; and, with
``again``, of building and solving once more in the same process, where that was quick.
"""

import importlib
import json
import os
import resource
import sys
import time
from pathlib import Path
from typing import Any

from peer_tools.estimation import Answer, Estimation

#: Address space of a tool and of each program it starts [byte]; beyond, it fails by itself.
MEMORY = 16 * 2**30
#: Tools that took longer are not run again [s].
PATIENCE = 60.0
#: Environment variable with the reading of the monotonic clock at which the process was started.
LAUNCHED = "PEER_LAUNCHED"


def once(tool: Any, problem: Estimation) -> tuple[Answer, float, float]:
    """Build and solve; return the answer and the times of both."""
    start = time.perf_counter()
    built = tool.build(problem)
    middle = time.perf_counter()
    answer: Answer = tool.solve(problem, built)
    end = time.perf_counter()
    solve_s = end - middle if answer.solve_s is None else answer.solve_s
    return answer, end - start - solve_s, solve_s


def main() -> None:
    """Build, solve, write down."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    name, folder = sys.argv[1], Path(sys.argv[2])
    began = time.perf_counter()
    tool = importlib.import_module(f"peer_tools.{name}")
    problem = Estimation.read(folder / "problem")
    import_s = time.perf_counter() - began
    answer, build_s, solve_s = once(tool, problem)
    whole_s = time.monotonic() - float(os.environ[LAUNCHED])
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    results = {
        "import_s": import_s,
        "build_s": build_s,
        "solve_s": solve_s,
        "whole_s": whole_s,
        # Linux counts in KiB. A tool and the program it starts may peak together: their sum.
        "cpu_s": sum(item.ru_utime + item.ru_stime for item in used),
        "peak_GB": sum(item.ru_maxrss for item in used) * 1024 / 1e9,
        "theta": [float(value) for value in answer.theta],
        "x_0": [float(value) for value in answer.x_0],
        "objective": float(answer.objective),
        "status": answer.status,
        "iterations": answer.iterations,
        "version": tool.version(),
    }
    path = folder / "answer.json"
    path.write_text(json.dumps(results))
    if "again" in sys.argv[3:] and whole_s < PATIENCE:
        second, *again = once(tool, problem)
        if abs(second.objective - answer.objective) <= 1e-6 * answer.objective:
            draft = folder / "draft"
            draft.write_text(json.dumps({**results, "again_s": sum(again)}))
            draft.replace(path)


if __name__ == "__main__":
    main()
