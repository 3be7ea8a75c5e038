"""Keys and values of a JSON section: named in messages, checked, never guessed."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from pneumo_casadi.data.bench.quantities import Quantity
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


def percent(name: str, value: Any, share: Quantity) -> float:
    """Return a number of per cent as a share of 1, checked in per cent."""
    return Quantity("%", 100 * share.lower, 100 * share.upper).check(name, value) / 100


@contextmanager
def named_by_keys(keys: Mapping[str, str], before: str = "", of: str = "") -> Iterator[None]:
    """Let errors name the keys of a file instead of the attributes that the values become.

    Parameters
    ----------
    keys : mapping of str to str
        Key of the file -> attribute.
    before, of : str
        What stands before each key, and before each attribute, as ``"controller."``.
    """
    try:
        yield
    except CaseError as error:
        text = str(error)
        for key, name in keys.items():
            text = text.replace(f"`{of}{name}`", f"`{before}{key}`")
        raise CaseError(text) from None
