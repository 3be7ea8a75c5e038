"""How polytropic coefficients err with the form of the flow map, and with what is made of it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    HEAD,
    ORANGE,
    SKY,
    SMALL,
    TEXT,
    VERMILION,
    dress,
    new_figure,
)

#: Key, label, colour, marker and offset of what is compared.
SERIES = (
    ("wls", "WLS", ORANGE, "s", -0.24),
    ("fixed", "OE, fixed", VERMILION, "^", -0.08),
    ("anchored", "anchored", BLUE, "o", 0.08),
    ("left out", "left out", GREEN, "D", 0.24),
)


def flow_sensitivity_figure(result: Mapping[str, Any], case: str = "table1") -> Figure:
    """Draw misfit of the map, and errors of k_P and k_N, form by form.

    Parameters
    ----------
    result : mapping
        As ``benchmarks/flow_sensitivity.py`` writes it.
    case : str
        Which of its cases.
    """
    rows = result["forms"][case]
    forms = list(dict.fromkeys(row["form"] for row in rows))
    figure = new_figure(112.0, head=HEAD)
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(0.7, 1, 1))
    _misfit(above, rows, forms)
    for axes, name, symbol in ((middle, "k_P", "$k_P$"), (below, "k_N", "$k_N$")):
        _errors(axes, rows, forms, name)
        dress(axes, None, f"error of {symbol} [%]")
    handles = [
        Line2D([], [], color=colour, marker=marker, linestyle="none", markersize=3.5, label=text)
        for _, text, colour, marker, _ in SERIES
    ]
    above.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=4, frameon=False,
        fontsize=SMALL, columnspacing=0.8, handletextpad=0.1, borderaxespad=0.1,
    ).set_in_layout(False)  # fmt: skip
    below.set_xticks(range(len(forms)), forms, rotation=35, ha="right", rotation_mode="anchor")
    below.set_xlabel(r"form of the map: degrees of $\phi$, $\psi^+$, $\psi^-$", fontsize=TEXT)
    figure.align_ylabels()
    return figure


def _misfit(axes: Axes, rows: list[dict[str, Any]], forms: list[str]) -> None:
    first = [next(row for row in rows if row["form"] == form) for form in forms]
    at = np.arange(len(forms))
    for key, text, colour, shift in (
        ("map_error_percent", "all measured points", GREY, -0.19),
        ("map_error_used_percent", "range of the record", SKY, 0.19),
    ):
        values = [row[key] if row[key] is not None else np.nan for row in first]
        axes.bar(at + shift, values, 0.36, color=colour, edgecolor=BLACK, lw=0.4, label=text)
    axes.set_yscale("log")
    axes.set_ylim(0.05, 3.0)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_yticks([0.1, 0.3, 1.0], labels=["0.1", "0.3", "1"])
    handles, labels = axes.get_legend_handles_labels()
    own = Legend(
        axes, handles, labels, loc="upper right", frameon=False, fontsize=SMALL,
        handlelength=1.0, borderaxespad=0.1, labelspacing=0.2,
    )  # fmt: skip
    axes.add_artist(own)
    dress(axes, None, "misfit [%]")


def _errors(axes: Axes, rows: list[dict[str, Any]], forms: list[str], name: str) -> None:
    axes.axhline(0.0, color=BLACK, linewidth=0.8)
    for key, text, colour, marker, shift in SERIES:
        at, values, bars = [], [], []
        for row in rows:
            estimator = "wls" if key == "wls" else "output_error"
            mine = key == "wls" or row["treatment"] == key
            if not mine or row[estimator] is None:
                continue
            estimate = row[estimator][name]
            at.append(forms.index(row["form"]) + shift)
            values.append(estimate["error_percent"])
            bars.append(2 * (estimate["std_percent"] or 0.0))
        axes.errorbar(
            at, values, yerr=bars, fmt=marker, color=colour, markersize=3.2, linewidth=0.9,
            capsize=1.5, label=text,
        )  # fmt: skip
    axes.set_yscale("symlog", linthresh=1.0, linscale=0.8)
    axes.yaxis.set_minor_locator(NullLocator())
    ticks = [-30, -10, -3, -1, 0, 1, 3, 10]
    low, high = axes.get_ylim()
    shown = [tick for tick in ticks if low <= tick <= high]
    axes.set_yticks(shown, labels=[str(tick).replace("-", "−") for tick in shown])
