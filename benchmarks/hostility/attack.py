"""An attack: how its files are made, what reads them, and how its success shows."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

#: Seconds of processor time, and bytes of memory, that reading a file must not take.
TIME, MEMORY = 20, 6 * 2**30
#: Name of the file that code of an attack makes where it runs.
CANARY = "canary"


@dataclass(frozen=True)
class Attack:
    """A hostile file.

    Parameters
    ----------
    name : str
        What it tries.
    make : callable
        Writes it into a folder that holds a sound case, result and export; the path of the canary
        is the second argument.
    read : str
        Python that a user would run in that folder.
    won : callable, optional
        Whether it succeeded although no canary was made, from the folder and what was printed.
    """

    name: str
    make: Callable[[Path, Path], None]
    read: str
    won: Callable[[Path, str], bool] = lambda folder, printed: False


def succeeds(attack: Attack, folder: Path) -> str:
    """Carry an attack out and return how it succeeded, or an empty text."""
    canary = folder.parent / f"{folder.name}.{CANARY}"
    attack.make(folder, canary)
    environment = {**os.environ, "PNEUMO_CASADI_CACHE": str(folder.parent / "cache")}
    try:
        done = subprocess.run(
            # As the installed command runs: the current folder is not on the path of imports.
            [sys.executable, "-P", "-c", attack.read],
            cwd=folder,
            env=environment,
            capture_output=True,
            timeout=10 * TIME,
            preexec_fn=_limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "it hangs"
    printed = (done.stdout + done.stderr).decode("utf-8", "replace")
    if canary.exists():
        return "code was run"
    if done.returncode < 0:
        return f"the process ended with signal {-done.returncode}"
    if "MemoryError" in printed:
        return "memory was exhausted"
    if "Traceback" in printed and "pneumo_casadi.errors" not in printed:
        return f"a traceback: {printed.strip().splitlines()[-1][:200]}"
    return "it shows in the output" if attack.won(folder, printed) else ""


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (TIME, TIME))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
