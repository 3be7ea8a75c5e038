"""What every committed result says of its making, how it is written, and kept meanwhile."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.runtime.atomic_files import atomic_file
from pneumo_casadi.runtime.provenance import code_identity, machine, package_versions


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


def kept(
    folder: Path | None,
    name: str,
    make: Callable[[], dict[str, Any]],
    of: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return a result from the folder that keeps finished ones, or make and keep it.

    With `of`, which says what the result is of, only one of that by the same code counts.
    """
    path = None if folder is None else folder / f"{name}.json"
    made_of = {} if of is None else {"of": {**of, "code": code_identity()}}
    if path is not None and path.is_file():
        content: dict[str, Any] = json.loads(path.read_text("utf-8"))
        if of is None or content.get("of") == made_of["of"]:
            return content
    result = make() | made_of
    write(path, result)
    return result
