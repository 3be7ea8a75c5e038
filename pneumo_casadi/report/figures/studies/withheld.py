"""Diagnosed beside true effects, and stated probabilities beside observed frequencies."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    GREY,
    PAGE,
    SMALL,
    VERMILION,
    dress,
    new_figure,
)

#: Height of a row of the matrix, and of what surrounds both panels [mm].
ROW, REST = 3.3, 70.0
#: Distance of two lines of numbers below the matrix [mm], and width of a column with a word below,
#: in those of a column with a number.
LOWER, WORD = 2.3, 2.0
#: Numbers are wider than their columns: so many stand one below the other.
LINES = 3
_SHADES = LinearSegmentedColormap.from_list("shades", ["#ffffff", BLUE])


def withheld_figure(result: Mapping[str, Any]) -> Figure:
    """Draw confusion matrix and calibration of a sealed check.

    Parameters
    ----------
    result : mapping
        As the sealed check returns it.
    """
    n = len(result["confusion"]["rows"])
    figure = new_figure(ROW * n + REST, width=PAGE)  # a column is too narrow for forty causes
    above, below = figure.subplots(2, 1, height_ratios=(ROW * n, 42.0))
    confusion_matrix(above, result["confusion"])
    calibration_plot(below, result["calibration"])
    return figure


def confusion_matrix(axes: Axes, confusion: Mapping[str, Any]) -> None:
    """Draw counts, shaded by their share of the row: right answers lie on the numbered diagonal.

    Columns carry the numbers of the rows; effects that were never true share a column.
    """
    rows: Sequence[str] = confusion["rows"]
    columns, counts = _other_joined(rows, confusion["columns"], confusion["counts"])
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    edges = np.concatenate([[0.0], np.cumsum([_wide(name) for name in columns])])
    at = (edges[:-1] + edges[1:]) / 2
    axes.pcolormesh(
        edges, np.arange(len(rows) + 1) - 0.5, shares, cmap=_SHADES, vmin=0.0, vmax=1.0,
        edgecolor="#d0d0d0", linewidth=0.3, zorder=2,
    )  # fmt: skip
    axes.invert_yaxis()
    dress(axes)
    axes.grid(False)
    both = [name for name in columns if name in rows and name not in _WORDS]
    numbers = {name: i for i, name in enumerate(both, 1)}
    for i, j in zip(*np.nonzero(counts), strict=True):
        right = rows[i] == columns[j] or (columns[j] == "unknown" and rows[i] in _NO_LIST)
        colour = "#ffffff" if shares[i, j] > 0.5 else BLACK if right else VERMILION
        axes.text(
            at[j], i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=SMALL - 1.5,
            color=colour, fontweight="normal" if right else "bold", zorder=3,
        )  # fmt: skip
    labels = [f"{name.replace('_', ' ')}  {numbers.get(name, '')}".rstrip() for name in rows]
    axes.set_yticks(range(len(rows)), labels, fontsize=SMALL - 1.0)
    axes.set_xticks(at, [str(numbers.get(name, name)) for name in columns])
    for name, tick in zip(columns, axes.get_xticklabels(), strict=True):
        tick.set_fontsize(SMALL - 2.0)
        if name not in numbers:
            tick.set_rotation(90)
        else:
            tick.set_y(-LOWER * ((numbers[name] - 1) % LINES) / (ROW * len(rows)))
    axes.tick_params(length=0)
    axes.set_xlabel("diagnosed", fontsize=SMALL, labelpad=1)
    axes.set_ylabel("true", fontsize=SMALL, labelpad=4)


def _wide(name: str) -> float:
    """Return the width of a column: words stand on end and are as wide as a line is high."""
    return WORD if name in (*_WORDS, "other") else 1.0


_NO_LIST = ("left_out", "never_listed")
_WORDS = ("several", "none", "unknown", "failed", "effect", "ambiguous", "absorbed")


def _other_joined(
    rows: Sequence[str], columns: Sequence[str], counts: Sequence[Sequence[int]]
) -> tuple[list[str], FloatArray]:
    """Return columns and counts with all effects that no row has in one column."""
    table = np.asarray(counts, dtype=float)
    other = [j for j, name in enumerate(columns) if name not in rows and name not in _WORDS]
    if not other:
        return list(columns), table
    kept = [j for j in range(len(columns)) if j not in other]
    effects = [j for j in kept if columns[j] not in _WORDS]
    order, last = kept[: len(effects)], kept[len(effects) :]
    joined = [table[:, order], table[:, other].sum(axis=1, keepdims=True), table[:, last]]
    return [*(columns[j] for j in order), "other", *(columns[j] for j in last)], np.hstack(joined)


def calibration_plot(axes: Axes, calibration: Mapping[str, Any]) -> None:
    """Draw how often the first of the ranking was right over its stated probability."""
    axes.plot([0, 100], [0, 100], color=GREY, linewidth=0.7, zorder=1)
    bins = calibration["bins"]
    if bins:
        x = np.array([100 * group["stated"] for group in bins])
        y = np.array([group["percent"] for group in bins])
        ends = np.array([group["interval"] for group in bins]).T
        axes.errorbar(
            x, y, yerr=np.maximum(np.abs(ends - y), 0.0), fmt="o", color=BLUE, markersize=3.2,
            linewidth=0.8, capsize=1.5, zorder=2,
        )  # fmt: skip
    error = calibration["expected_calibration_error"]
    if error is not None:
        axes.text(
            0.98, 0.05, f"expected calibration error {error:.3f}", transform=axes.transAxes,
            ha="right", va="bottom", fontsize=SMALL,
            bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.0},
        )  # fmt: skip
    axes.set_xlim(-2, 102)
    axes.set_ylim(-2, 102)
    dress(axes, "stated probability of the first candidate [%]", "correct [%]")
