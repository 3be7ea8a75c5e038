"""What every committed result says of its making, and how it is written."""

import importlib.metadata
import json
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi import __version__
from pneumo_casadi.runtime.atomic_files import atomic_file


def made(seed: int | None, quick: bool, *packages: str) -> dict[str, Any]:
    """Return machine, versions and seed of a result."""
    names = ("casadi", "numpy", "scipy", *packages)
    versions = {"python": platform.python_version(), "pneumo_casadi": __version__}
    versions |= {name: importlib.metadata.version(name) for name in names}
    return {
        "machine": f"{platform.machine()} {platform.system()}, {os.cpu_count()} CPUs",
        "versions": versions,
        "seed": seed,
        "quick": quick,
    }


def write(path: Path | None, result: Mapping[str, Any]) -> None:
    """Write a result as JSON, whole or not at all."""
    if path is None:
        return
    with atomic_file(path) as draft:
        draft.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
