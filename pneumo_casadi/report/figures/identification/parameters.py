"""Parameters at a glance: estimates with intervals beside the truth; correlations."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.figures.style import (
    BLACK,
    HEAD,
    SIMULATED,
    SMALL,
    TEXT,
    WLS,
    dress,
    legend_above,
    new_figure,
    symbol,
)
from pneumo_casadi.report.tables.parameters import (
    TRUSTED,
    output_error_half_width,
    wls_half_width,
)

#: Correlations of at least this size are written into their cell.
WRITTEN = 0.5
#: More parameters leave no room for numbers in the cells.
FEW = 16
#: Shares of red, green and blue in how bright a colour is (ITU-R BT.601).
LUMA = np.array([0.299, 0.587, 0.114])


def forest_figure(identification: Identification) -> Figure:
    """Draw WLS and output-error estimates ± 2σ, in per cent of the truth (or of output error)."""
    figure = new_figure(78.0, head=HEAD)
    draw_forest(figure.add_subplot(), identification)
    return figure


def draw_forest(axes: Axes, identification: Identification) -> None:
    """Draw the forest plot into given axes."""
    truth = identification.truth or {}
    names = list(identification.wls.names)
    result = identification.output_error
    base = {n: (truth if truth else result.parameters.as_dict()).get(n) for n in names}
    wls = [
        (float(value), wls_half_width(identification, n))
        for n, value in zip(names, identification.wls.estimate, strict=True)
    ]
    oe = [(result.parameters[n].value, output_error_half_width(identification, n)) for n in names]
    statuses = [result.status_of(name) for name in names]
    # A point without a bar would look like the most certain of all.
    oe = [
        estimate if status in TRUSTED else (math.nan, None)
        for estimate, status in zip(oe, statuses, strict=True)
    ]
    for row, (name, status) in enumerate(zip(names, statuses, strict=True)):
        if words := _no_deviation(base[name], bool(truth)):
            axes.annotate(
                words, (1.0, row), (-3, 0), xycoords=axes.get_yaxis_transform(), ha="right",
                textcoords="offset points", va="center", fontsize=SMALL, color=SIMULATED,
            )  # fmt: skip
        elif status is not EstimateStatus.ESTIMATED:
            axes.annotate(
                status.value, (0.0, row + 0.16), (3, 0), textcoords="offset points", va="center",
                fontsize=SMALL, color=SIMULATED,
            )  # fmt: skip
    references = [base[n] or math.nan for n in names]
    _points(axes, wls, references, -0.16, WLS, "s", "WLS")
    _points(axes, oe, references, 0.16, SIMULATED, "o", "output error")
    reference = "truth" if truth else "output error"
    axes.axvline(0.0, color=BLACK, linewidth=0.8, label=reference if truth else None)
    axes.set_yticks(range(len(names)), [symbol(n) for n in names])
    axes.set_ylim(len(names) - 0.5, -0.5)  # rows without a point too
    dress(axes, f"deviation from {reference} [%]")
    axes.tick_params(axis="y", labelsize=TEXT)
    legend_above(axes, 3)


def _no_deviation(base: float | None, of_truth: bool) -> str:
    """Return why there is no relative deviation from a value; empty where there is one."""
    if base is None:
        return "no true value is known"
    return "" if base else f"the {'true value' if of_truth else 'estimate'} is 0"


def correlation_figure(identification: Identification) -> Figure:
    """Draw the correlations of the output-error estimates, flow coefficients left out."""
    estimate = identification.output_error.uncertainty
    known = [n for n in estimate.names if n not in (*estimate.at_bound, *estimate.uninformed)]
    names = [n for n in identification.parameter_names if n in known]
    at = [estimate.names.index(n) for n in names]
    return matrix_figure(estimate.correlation[np.ix_(at, at)], names)


def matrix_figure(matrix: FloatArray, names: Sequence[str]) -> Figure:
    """Draw a correlation matrix, large entries written out."""
    few = len(names) <= FEW
    # Beside a matrix of many rows the bar would take the width that their names need.
    figure = new_figure(74.0 if few else 102.0)
    axes = figure.add_subplot()
    image = axes.imshow(matrix, vmin=-1, vmax=1, cmap="PuOr")
    if few:
        _write_entries(axes, matrix)
    labels = [symbol(name) for name in names]
    dress(axes)
    axes.grid(False)
    turn, size = (0, SMALL) if few else (90, SMALL - 1.5)
    axes.set_xticks(range(len(names)), labels, rotation=turn, fontsize=size)
    axes.set_yticks(range(len(names)), labels, fontsize=size)
    position: dict[str, Any] = {} if few else {"location": "bottom", "aspect": 40}
    bar = figure.colorbar(image, ax=axes, pad=0.02, **position)
    bar.set_label("correlation [1]", fontsize=TEXT)
    bar.ax.tick_params(labelsize=SMALL, width=0.6, length=2.5)
    return figure


def _write_entries(axes: Axes, matrix: FloatArray) -> None:
    colours = colormaps["PuOr"]((1 + matrix) / 2)
    for i, j in np.argwhere(np.abs(matrix) >= WRITTEN):
        if i != j:
            # The purple end is darker than the brown one at the same correlation.
            dark = float(colours[i, j, :3] @ LUMA) < 0.5
            axes.text(
                j, i, f"{matrix[i, j]:.2f}".replace("0.", ".").replace("-", "−"), ha="center",
                va="center", fontsize=SMALL - 1.5, color="white" if dark else "black",
            )  # fmt: skip


def _points(
    axes: Axes,
    estimates: Sequence[tuple[float, float | None]],
    references: Sequence[float],
    offset: float,
    colour: str,
    marker: str,
    label: str,
) -> None:
    pairs = zip(estimates, references, strict=True)
    values = np.array([100 * (v - r) / abs(r) for (v, _), r in pairs])
    # An interval that is infinite or does not exist is no bar.
    halves = np.array(
        [
            100 * half / abs(r) if half is not None and np.isfinite(half) else 0.0
            for (_, half), r in zip(estimates, references, strict=True)
        ]
    )
    axes.errorbar(
        values, np.arange(values.size) + offset, xerr=halves, fmt=marker, color=colour,
        markersize=3, linewidth=1.1, capsize=2, label=label,
    )  # fmt: skip
