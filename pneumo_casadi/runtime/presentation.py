"""How results show themselves: in a shell, in a notebook, as text and as a table."""

import math
from collections.abc import Mapping
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.runtime.atomic_files import atomic_file

#: A `repr` is cut at a line once it is longer than this [characters].
LONGEST_REPR = 1100
#: Longest text of a field in the `repr` of a part of a result [characters].
_LONGEST_FIELD = 160


#: Characters that LaTeX would take for commands.
_LATEX = str.maketrans(
    {**{each: f"\\{each}" for each in "&%$#_{}"}, "~": r"\textasciitilde{}", "^": r"\^{}"}
    | {"\\": r"\textbackslash{}", "²": "$^2$", "³": "$^3$", "µ": r"$\mu$"}
)


class Presentable:
    """What all results have in common: a short repr, ``summary()``, ``to_frame()`` and exports.

    A subclass gives `headline` and `to_frame`. As a dataclass it needs ``repr=False``.
    """

    __slots__ = ()

    @property
    def headline(self) -> str:
        """What the result is, in one or two lines."""
        raise NotImplementedError

    def to_frame(self) -> pd.DataFrame:
        """Return the result as a table, SI units."""
        raise NotImplementedError

    def overview(self) -> pd.DataFrame:
        """Return the table that `summary` and notebooks show; by default that of `to_frame`."""
        return self.to_frame()

    def summary(self) -> str:
        """Return the result as text: headline and table."""
        frame = self.overview()
        if frame.empty:
            return self.headline
        return f"{self.headline}\n{frame.to_string(float_format='{:.4g}'.format, na_rep='')}"

    def to_latex(self) -> str:
        r"""Return the table of `overview` as LaTeX with ``\\toprule`` ... (package booktabs).

        Four significant digits; what is missing is left empty. SI units.
        """
        frame = self.overview().reset_index()
        head = " & ".join(map(_latex, frame.columns))
        rows = [" & ".join(map(_latex, row)) for row in frame.itertuples(index=False)]
        numbers = frame.dtypes.map(pd.api.types.is_numeric_dtype)
        columns = "".join("r" if number else "l" for number in numbers)
        lines = ["\\toprule", head + r" \\", "\\midrule", *(row + r" \\" for row in rows)]
        inner = "\n".join([*lines, "\\bottomrule"])
        return f"\\begin{{tabular}}{{{columns}}}\n{inner}\n\\end{{tabular}}\n"

    def to_csv(self, path: str | Path) -> None:
        """Write the table of `to_frame` as CSV, SI units, all digits."""
        with atomic_file(path) as draft:
            self.to_frame().to_csv(draft)

    def __repr__(self) -> str:
        lines, length = [], 0
        for line in self.summary().splitlines():
            length += len(line) + 1
            if length > LONGEST_REPR:
                lines.append("…")
                break
            lines.append(line)
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        frame = self.overview()
        table = "" if frame.empty else frame.to_html(float_format="{:.4g}".format, na_rep="")
        return f"<p>{escape(self.headline)}</p>{table}"


def _latex(cell: object) -> str:
    r"""Return a cell as LaTeX: numbers in math mode, text escaped.

    Examples
    --------
    >>> _latex(3.4879e-9), _latex("F_c"), _latex(float("nan"))
    ('$3.488 \\cdot 10^{-9}$', 'F\\_c', '')
    """
    if isinstance(cell, str) or cell is None:
        return (cell or "").translate(_LATEX)
    number = float(cell)  # type: ignore[arg-type]
    if math.isnan(number):
        return ""
    mantissa, _, exponent = f"{number:.4g}".partition("e")
    return f"${mantissa}" + (rf" \cdot 10^{{{int(exponent)}}}" if exponent else "") + "$"


class Brief:
    """A dataclass whose `repr` gives arrays by their shapes and cuts what is long.

    As a dataclass it needs ``repr=False``.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(repr=False)
    ... class Curve(Brief):
    ...     t: np.ndarray
    ...     unit: str
    >>> Curve(np.zeros(5000), "m")
    Curve(t=<array of 5000>, unit='m')
    """

    __slots__ = ()

    def __repr__(self) -> str:
        shown = [item.name for item in fields(self) if item.repr]  # type: ignore[arg-type]
        parts = ", ".join(f"{name}={_text(getattr(self, name))}" for name in shown)
        return _cut(f"{type(self).__name__}({parts})", LONGEST_REPR)


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<array of {' x '.join(map(str, value.shape))}>"
    if isinstance(value, Mapping):
        return _cut(f"{{{', '.join(f'{key}: {_text(item)}' for key, item in value.items())}}}")
    if isinstance(value, tuple | list):
        return _cut(f"({', '.join(map(_text, value))})")
    return _cut(repr(value))


def _cut(text: str, longest: int = _LONGEST_FIELD) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
