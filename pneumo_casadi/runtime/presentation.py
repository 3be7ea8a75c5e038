"""How results show themselves: in a shell, in a notebook, as text and as a table."""

from html import escape

import pandas as pd

#: A `repr` is cut at a line once it is longer than this [characters].
LONGEST_REPR = 1100


class Presentable:
    """What all results have in common: a short repr, ``summary()`` and ``to_frame()``.

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
