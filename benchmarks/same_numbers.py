"""Question: are the figures of two folders of results the same.

Data: two folders of JSON files, as ``benchmarks/results``. Files of the same name are compared
value by value: numbers to a relative tolerance, everything else exactly. Differences below 1e-20 do
not count, nor, within a list, those below 1e-12 of its largest number: these are rounding. The
smallest quantity of a result, a conductance in m³/(s Pa), is about 1e-12. What depends on the
machine and the moment (times, memory, versions) is left out. Nothing is random.

Exit code 1 where something differs, or where a file stands in one folder only.
"""

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Keys that say how, when and where a result was made.
IGNORED = frozenset(
    {
        "machine",
        "versions",
        "platform",
        "provenance",
        "sha256",
        "seconds",
        "longest_s",
        "selection_seconds",
        "peak_GiB",
        "cold_cache",
        "quick",
    }
)
RELATIVE = 1e-9
#: Absolute tolerance in any unit, and as a share of the largest number of the same list.
ABSOLUTE, SHARE_OF_LIST = 1e-20, 1e-12


@dataclass(frozen=True, slots=True)
class Difference:
    """One value that differs.

    Parameters
    ----------
    path : str
        File, then keys and indices down to the value, joined by ``/``.
    before, after : object
        The two values; `MISSING` where there is none.
    """

    path: str
    before: Any
    after: Any

    def __str__(self) -> str:
        """Return one line, with the relative difference of two numbers."""
        line = f"{self.path}: {shown(self.before)} -> {shown(self.after)}"
        if is_number(self.before) and is_number(self.after) and self.before:
            line += f" ({(self.after - self.before) / abs(self.before):+.1e})"
        return line


MISSING = object()


def shown(value: Any) -> str:
    """Return a value as one short line."""
    text = "nothing" if value is MISSING else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else f"{text[:77]}..."


def is_number(value: Any) -> bool:
    """Tell whether a value is a number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def differences(
    before: Any,
    after: Any,
    *,
    ignored: frozenset[str] = IGNORED,
    relative: float = RELATIVE,
    absolute: float = ABSOLUTE,
    path: str = "",
) -> Iterator[Difference]:
    """Yield every difference between two JSON values.

    Parameters
    ----------
    before, after : object
        What `json.loads` returns.
    ignored : frozenset of str
        Keys that are not compared, wherever they stand.
    relative : float
        Relative tolerance of numbers.
    absolute : float
        Absolute tolerance of numbers.
    path : str
        Where the values stand, for the differences.

    Examples
    --------
    >>> [str(d) for d in differences({"M": 2.0, "seconds": 3}, {"M": 2.2, "seconds": 4})]
    ['M: 2.0 -> 2.2 (+1.0e-01)']
    """
    if isinstance(before, dict) and isinstance(after, dict):
        absolute = ABSOLUTE
        keys = [*before, *(key for key in after if key not in before)]
        pairs = [(key, before.get(key, MISSING), after.get(key, MISSING)) for key in keys]
        pairs = [pair for pair in pairs if pair[0] not in ignored]
    elif isinstance(before, list) and isinstance(after, list):
        absolute = max(ABSOLUTE, SHARE_OF_LIST * largest([*before, *after]))
        n = max(len(before), len(after))
        first, second = (values + [MISSING] * (n - len(values)) for values in (before, after))
        pairs = [(str(i), a, b) for i, (a, b) in enumerate(zip(first, second, strict=True))]
    else:
        if not same(before, after, relative, absolute):
            yield Difference(path, before, after)
        return
    for key, a, b in pairs:
        inner = f"{path}/{key}" if path else key
        yield from differences(
            a, b, ignored=ignored, relative=relative, absolute=absolute, path=inner
        )


def same(before: Any, after: Any, relative: float, absolute: float) -> bool:
    """Tell whether two values without keys are the same."""
    if is_number(before) and is_number(after):
        return math.isclose(before, after, rel_tol=relative, abs_tol=absolute) or (
            math.isnan(before) and math.isnan(after)
        )
    return type(before) is type(after) and bool(before == after)


def largest(values: Sequence[Any]) -> float:
    """Return the largest finite magnitude among some values; 0 without any."""
    return max((abs(v) for v in values if is_number(v) and math.isfinite(v)), default=0.0)


def compare_folders(
    before: Path, after: Path, ignored: frozenset[str] = IGNORED, relative: float = RELATIVE
) -> list[Difference]:
    """Return all differences between the JSON files of two folders.

    Raises
    ------
    FileNotFoundError
        If a folder holds no JSON file.
    """
    files = [{path.name: path for path in folder.glob("*.json")} for folder in (before, after)]
    for folder, known in zip((before, after), files, strict=True):
        if not known:
            raise FileNotFoundError(f"{folder}: no JSON files to compare")
    results: list[Difference] = []
    for name in sorted(files[0].keys() | files[1].keys()):
        first, second = (
            json.loads(known[name].read_text("utf-8")) if name in known else MISSING
            for known in files
        )
        if first is MISSING or second is MISSING:
            there = [MISSING if content is MISSING else "a file" for content in (first, second)]
            results.append(Difference(name, *there))
            continue
        results += differences(first, second, ignored=ignored, relative=relative, path=name)
    return results


def main() -> None:
    """Compare two folders from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path, help="folder of results")
    parser.add_argument("after", type=Path, help="folder to compare with it")
    parser.add_argument("--relative", type=float, default=RELATIVE, help="tolerance of numbers")
    parser.add_argument(
        "--allow", metavar="KEY", action="append", default=[], help="a key that may differ"
    )
    arguments = parser.parse_args()
    ignored = IGNORED | frozenset(arguments.allow)
    result = compare_folders(arguments.before, arguments.after, ignored, arguments.relative)
    for difference in result:
        print(difference)
    print(f"{len(result)} differences at a relative tolerance of {arguments.relative:g}")
    raise SystemExit(1 if result else 0)


if __name__ == "__main__":
    main()
