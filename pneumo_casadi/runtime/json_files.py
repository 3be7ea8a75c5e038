"""JSON as the package writes it: strict, UTF-8, whole or not at all."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.runtime.atomic_files import atomic_file


def write_json(content: Mapping[str, Any], path: str | Path) -> None:
    """Write strict JSON in one step: the file is complete, or not there.

    Raises
    ------
    ValueError
        If a number is not finite; see `without_infinities`.
    """
    with atomic_file(path) as draft:
        draft.write_text(json_text(content), encoding="utf-8")


def json_text(content: Mapping[str, Any]) -> str:
    """Return strict JSON, one line an entry.

    Examples
    --------
    >>> print(json_text({"unit": "m³"}), end="")
    {
     "unit": "m³"
    }
    """
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def without_infinities(value: Any) -> Any:
    """Return plain values with None for every number that JSON cannot hold.

    Examples
    --------
    >>> without_infinities({"std": [0.5, math.inf]})
    {'std': [0.5, None]}
    """
    if isinstance(value, Mapping):
        return {str(key): without_infinities(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_infinities(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
