"""Keys and values of a JSON section: named in messages, checked, never guessed."""

from collections.abc import Collection
from typing import Any

from pneumo_casadi.data.bench.quantities import as_number
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import shown


def section(name: str, value: Any) -> dict[str, Any]:
    """Return `value` if it is a JSON object."""
    if not isinstance(value, dict):
        raise CaseError(f"`{name}`: expected a JSON object, got {shown(value)}")
    return value


def choice(name: str, value: Any, known: Collection[str]) -> str:
    """Return `value` if it is one of the `known` words."""
    if not isinstance(value, str) or value not in known:
        words = " or ".join(repr(str(word)) for word in known)
        raise CaseError(f"`{name}`: got {shown(value)}; write {words}")
    return value


def percent(name: str, value: Any) -> float:
    """Return a number of per cent as a share of 1."""
    return as_number(name, value, "%") / 100
