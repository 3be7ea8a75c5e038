"""Tools run in processes of their own, with caches of their own."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from peer_tools.estimation import Estimation
from peer_tools.run import LAUNCHED, PATIENCE

#: Environment variables that name a folder of what a tool has compiled, beside our own.
CACHES = {"NUMBA_CACHE_DIR": "numba", "JAX_COMPILATION_CACHE_DIR": "jax"}


def failed(run: Mapping[str, Any]) -> bool:
    """Tell whether a run gave no answer."""
    return "failure" in run


def runs_of(module: str, given: Estimation, limit: float) -> dict[str, Any]:
    """Run one tool in a folder of its own, cold and then again with what it has compiled."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        given.write(folder / "problem")
        result = one_run(module, folder, limit, True)
        if not failed(result) and result["whole_s"] <= PATIENCE:
            second = one_run(module, folder, limit, False)
            result["restart_s"] = second.get("whole_s")
        return result


def one_run(module: str, folder: Path, limit: float, again: bool) -> dict[str, Any]:
    """Run one tool in its own process, `again` there; return its answer or its failure."""
    cache = folder / "cache"
    cache.mkdir(mode=0o700, exist_ok=True)
    answer = folder / "answer.json"
    answer.unlink(missing_ok=True)
    kept = {variable: str(cache / name) for variable, name in CACHES.items()}
    own = {"PNEUMO_CASADI_CACHE": str(cache), "TMPDIR": str(folder), **kept}
    own["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    own[LAUNCHED] = repr(time.monotonic())
    process = subprocess.Popen(
        [sys.executable, "-m", "peer_tools.run", module, str(folder), *["again"] * again],
        cwd=Path(__file__).parents[1],
        env={**os.environ, **own},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        _, errors = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        errors = ""
        if not answer.exists():
            return {"failure": f"no answer within {limit:g} s"}
    if not answer.exists():
        lines = errors.strip().splitlines() or ["no message"]
        return {"failure": f"exit code {process.returncode}: {lines[-1]}"}
    content: dict[str, Any] = json.loads(answer.read_text())
    return content
