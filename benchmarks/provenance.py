"""What every committed result says of its making, and how it is written."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.runtime.atomic_files import atomic_file
from pneumo_casadi.runtime.provenance import machine, package_versions


def made(seed: int | None, quick: bool, *packages: str) -> dict[str, Any]:
    """Return machine, versions and seed of a result."""
    return {
        "machine": machine(),
        "versions": package_versions(("casadi", "numpy", "scipy", *packages)),
        "seed": seed,
        "quick": quick,
    }


def write(path: Path | None, result: Mapping[str, Any]) -> None:
    """Write a result as JSON, whole or not at all."""
    if path is None:
        return
    with atomic_file(path) as draft:
        draft.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
