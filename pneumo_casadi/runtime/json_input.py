"""JSON that others have written: limited in size and depth, and converted to typed models."""

import json
import math
import re
from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import decoded, printable, read_bytes, shown

#: Largest JSON file that is read [bytes]; the result of an identification holds less than 1 MB.
LARGEST = 16 * 2**20
#: Deepest nesting; results need eight levels.
DEEPEST = 32
#: Most values in a file; a result holds some ten thousand.
MOST_VALUES = 10**6
#: Digits of an integer that 64 bits hold; longer ones are read as floating-point numbers.
_DIGITS = 18
#: Types as msgspec names them, in words.
_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "object": "a JSON object",
    "array": "a list",
    "null": "null",
}

M = TypeVar("M")


class Section(msgspec.Struct, kw_only=True):
    """A JSON object of which the fields of the class are read; further ones are ignored."""


class ClosedSection(msgspec.Struct, kw_only=True, forbid_unknown_fields=True):
    """A JSON object that has the fields of the class and no others."""


def read_json(path: str | Path, absent: str) -> dict[str, Any]:
    """Return the JSON object that a file holds.

    Parameters
    ----------
    path : path
        The file.
    absent : str
        What to do where there is no such file.

    Raises
    ------
    CaseError
        If it cannot be read, is no JSON object, too large or nested too deep, names a key twice,
        or holds a number that is not finite. The message names file, line or field, and remedy.
    """
    text = decoded(read_bytes(path, absent, LARGEST), path)
    try:
        content = json.loads(text, object_pairs_hook=_unique, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise CaseError(
            f"{path}: not a readable JSON file: line {error.lineno}: {error.msg}; it is empty, cut "
            "short or no JSON"
        ) from None
    except RecursionError:
        raise CaseError(f"{path}: nested deeper than {DEEPEST} levels; write it anew") from None
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None
    if not isinstance(content, dict):
        raise CaseError(f"{path}: expected a JSON object, got {shown(content)}; write {{...}}")
    try:
        _check_values(content)
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None
    return content


def typed(content: Any, model: type[M], where: str = "") -> M:
    """Return plain values as a typed model; numbers given as text are none.

    Parameters
    ----------
    content : object
        What JSON gave.
    model : type
        A `Section` or `ClosedSection`, or another type that msgspec knows.
    where : str, optional
        Name of the object in messages.

    Raises
    ------
    CaseError
        Naming the field, its value and what is expected.

    Examples
    --------
    >>> typed({"M": 16.9}, dict[str, float])
    {'M': 16.9}
    >>> typed({"M": "16.9 kg"}, dict[str, float], "datasheet")
    Traceback (most recent call last):
    ...
    pneumo_casadi.errors.CaseError: `datasheet.M`: expected a number, got '16.9 kg'; correct it
    """
    if isinstance(model, type) and issubclass(model, ClosedSection):
        fields = msgspec.structs.fields(model)
        needed = {field.encode_name for field in fields if field.required}
        check_keys(where, content, needed, {field.encode_name for field in fields})
    try:
        return msgspec.convert(content, model, strict=True)
    except msgspec.ValidationError as error:
        raise CaseError(_explained(str(error), content, model, where)) from None


def check_format(content: Mapping[str, Any], known: int) -> None:
    """Check the number of a format; formats have one since version 0.1.0.

    Raises
    ------
    CaseError
        If it is missing, none, or that of a later version.
    """
    number = typed(content, _Numbered).format
    if number != known:
        raise CaseError(
            f"`format`: {number}, this version reads {known}; "
            + ("update pneumo_casadi" if number > known else "write the file anew")
        )


class _Numbered(Section):
    format: int


def check_keys(
    where: str, content: Any, needed: Collection[str], optional: Collection[str]
) -> None:
    """Check that a value is an object with all `needed` keys and no other than the `optional`."""
    if not isinstance(content, Mapping):
        raise CaseError(f"`{where}`: expected a JSON object, got {shown(content)}; write {{...}}")
    missing = sorted(set(needed) - content.keys())
    unknown = sorted(str(key) for key in content.keys() - set(needed) - set(optional))
    advice = f"; there stands {_listed(where, unknown)}" if unknown else ""
    if missing:
        raise CaseError(f"missing key {_listed(where, missing)}{advice}")
    if unknown:
        raise CaseError(
            f"unknown key {_listed(where, unknown)}; known are "
            f"{', '.join(sorted({*needed, *optional}))}"
        )


def _listed(where: str, keys: list[str]) -> str:
    names = [f"`{_joined(where, key)}`" for key in keys[:5]]
    return ", ".join(names) + (f" and {len(keys) - 5} more" if len(keys) > 5 else "")


def _joined(where: str, key: str | int) -> str:
    if isinstance(key, int):
        return f"{where}[{key}]"
    name = printable(key if len(key) <= 60 else f"{key[:60]}...")
    return f"{where}.{name}" if where else name


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        counts = Counter(key for key, _ in pairs)
        twice = sorted(key for key, count in counts.items() if count > 1)
        raise CaseError(f"key {_listed('', twice)} stands twice; keep one")
    return content


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= _DIGITS else float(digits)


def _check_values(content: Any) -> None:
    """Check depth, number of values, and that all numbers are finite."""
    waiting: list[tuple[str, Any, int]] = [("", content, 1)]
    count = 0
    while waiting:
        where, value, depth = waiting.pop()
        count += 1
        if depth > DEEPEST:
            raise CaseError(f"`{where}`: nested deeper than {DEEPEST} levels; write it anew")
        if count > MOST_VALUES:
            raise CaseError(f"more than {MOST_VALUES} values; write it anew")
        if isinstance(value, float) and not math.isfinite(value):
            raise CaseError(
                f"`{where}`: expected a finite number, got {value} or a number too large; "
                "write one that was measured"
            )
        for text in value if isinstance(value, dict) else (value,):
            if isinstance(text, str) and not text.isascii():
                _check_text(where, text)
        if isinstance(value, dict):
            waiting += [(_joined(where, key), item, depth + 1) for key, item in value.items()]
        elif isinstance(value, list):
            waiting += [(_joined(where, k), item, depth + 1) for k, item in enumerate(value)]


def _check_text(where: str, text: str) -> None:
    """Check that a text can be written again: JSON can hold half of a character."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise CaseError(
            f"`{where}`: {shown(text)} holds half of a character; write it anew"
        ) from None


def _explained(message: str, content: Any, model: Any, where: str) -> str:
    """Return a message of msgspec in the words of this package, with the value that is wrong."""
    text, _, path = message.partition(" - at `$")
    keys = _resolved(path.removesuffix("`"), message, content, model)
    value = content
    for key in keys:
        where, value = _joined(where, key), value[key]
    field = re.search(r"field `(.*)`", text)
    if field:
        kind = "missing" if "missing" in text else "unknown"
        return f"{kind} key `{_joined(where, field[1])}`"
    expected = re.match(r"Expected `(.*?)`", text)
    if not expected:
        return f"`{where}`: {text[:1].lower()}{text[1:]}, got {shown(value)}; correct it"
    words = " or ".join(_WORDS.get(name, name) for name in expected[1].split(" | "))
    bound = text[expected.end() :].partition(", got")[0]
    return f"`{where}`: expected {words}{bound}, got {shown(value)}; correct it"


def _resolved(path: str, message: str, content: Any, model: Any) -> list[str | int]:
    """Return the keys of a path in which msgspec leaves out those of mappings, as ``[...]``."""
    keys: list[str | int] = []
    value = content
    for name, item in re.findall(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]", path):
        if name:
            keys.append(name)
        elif item.isdigit():
            keys.append(int(item))
        else:
            keys.append(_culprit(keys, list(value), message, content, model))
        value = value[keys[-1]]
    return keys


def _culprit(
    keys: list[str | int], names: list[str], message: str, content: Any, model: Any
) -> str:
    """Return the entry of a mapping that a message is about, by halving the mapping."""
    while len(names) > 1:
        half = names[: len(names) // 2]
        try:
            msgspec.convert(_reduced(content, keys, half), model, strict=True)
            same = False
        except msgspec.ValidationError as error:
            same = str(error) == message
        names = half if same else names[len(half) :]
    return names[0]


def _reduced(content: Any, keys: list[str | int], names: list[str]) -> Any:
    """Return content of which the mapping at some keys has these names only."""
    if not keys:
        return {name: content[name] for name in names}
    copy = dict(content) if isinstance(content, dict) else list(content)
    copy[keys[0]] = _reduced(content[keys[0]], keys[1:], names)  # type: ignore[index]
    return copy
