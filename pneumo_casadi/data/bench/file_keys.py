"""Keys and values of a JSON section: named in messages, checked, never guessed."""

from collections.abc import Collection, Mapping
from typing import Any

from pneumo_casadi.data.bench.quantities import as_number
from pneumo_casadi.errors import CaseError


def section(name: str, value: Any) -> dict[str, Any]:
    """Return `value` if it is a JSON object."""
    if not isinstance(value, dict):
        raise CaseError(f"`{name}`: expected a JSON object, got {value!r}")
    return value


def choice(name: str, value: Any, known: Collection[str]) -> str:
    """Return `value` if it is one of the `known` words."""
    if not isinstance(value, str) or value not in known:
        words = " or ".join(repr(str(word)) for word in known)
        raise CaseError(f"`{name}`: got {value!r}; write {words}")
    return value


def percent(name: str, value: Any) -> float:
    """Return a number of per cent as a share of 1."""
    return as_number(name, value, "%") / 100


def check_keys(
    where: str, content: Mapping[str, Any], needed: Collection[str], optional: Collection[str]
) -> None:
    """Check that all `needed` keys are there and no other than these and the `optional` ones."""
    missing = sorted(set(needed) - content.keys())
    unknown = sorted(content.keys() - set(needed) - set(optional))
    advice = f"; there stands {', '.join(f'`{where}{key}`' for key in unknown)}" if unknown else ""
    if missing:
        raise CaseError(f"missing key {', '.join(f'`{where}{key}`' for key in missing)}{advice}")
    if unknown:
        raise CaseError(
            f"unknown key {', '.join(f'`{where}{key}`' for key in unknown)}; "
            f"known are {', '.join(sorted({*needed, *optional}))}"
        )
