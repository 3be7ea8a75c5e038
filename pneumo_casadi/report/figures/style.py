"""One style for all figures: column width of the paper, colours that everybody can tell apart.

Figures are made through the object interface, without pyplot: no global state, no display.
"""

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pneumo_casadi.parameters import FloatArray

#: Widths of one column and of the page [mm] (IFAC).
COLUMN, PAGE = 88.0, 181.0
MM = 1 / 25.4
DPI = 220

#: Okabe and Ito (2008): distinct with every common colour vision.
BLACK, GREY = "#000000", "#8c8c8c"
BLUE, ORANGE, GREEN, VERMILION, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9"
#: Who is who in every figure.
MEASURED, SIMULATED, CLOSED, WLS, TRUTH = GREY, BLUE, VERMILION, ORANGE, BLACK

TEXT, SMALL = 8.0, 7.0
LINE = 0.9

#: Room for a legend above the axes [mm].
HEAD = 4.0

#: Display units: SI unit -> (text, factor).
DISPLAY = {
    "m": ("mm", 1e3),
    "Pa": ("bar", 1e-5),
    "kg/s": ("g/s", 1e3),
    "N": ("N", 1.0),
    "V": ("V", 1.0),
}
#: Errors of pressures and positions are small; these units read better.
ERROR_DISPLAY = {**DISPLAY, "Pa": ("kPa", 1e-3), "m": ("mm", 1e3)}

SYMBOLS = {
    "X_s1": r"$X_{s1}$",
    "X_s2": r"$X_{s2}$",
    "X_s3": r"$X_{s3}$",
    "X_s4": r"$X_{s4}$",
    "X_s5": r"$X_{s5}$",
    "X_s6": r"$X_{s6}$",
    "M": r"$M$",
    "f_v": r"$f_v$",
    "F_c_plus": r"$F_c^+$",
    "F_c_minus": r"$F_c^-$",
    "p_P": r"$p_P$",
    "p_N": r"$p_N$",
    "x": r"$x$",
    "u": r"$u$",
    "p": r"$p$",
    "q_m": r"$q_m$",
    "F": r"$F$",
    "mass_flow_P": r"$q_{mP}$",
    "mass_flow_N": r"$q_{mN}$",
    "force": "effort",
}
UNITS = {"mass_flow_P": "kg/s", "mass_flow_N": "kg/s", "force": "N"}

#: More points than this in one curve are too many for a column.
POINTS = 4000


def new_figure(height: float, width: float = COLUMN, head: float = 0.0) -> Figure:
    """Return an empty figure of that size [mm] that lays itself out below a free head [mm]."""
    figure = Figure(figsize=(width * MM, height * MM), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    layout: Any = figure.get_layout_engine()
    rect = (0, 0, 1, 1 - head / height)
    layout.set(w_pad=0.035, h_pad=0.03, hspace=0.03, wspace=0.03, rect=rect)
    return figure


def dress(axes: Axes, x: str | None = None, y: str | None = None) -> None:
    """Give axes their labels, sizes and a light grid."""
    axes.tick_params(labelsize=SMALL, width=0.6, length=2.5, pad=2)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
    axes.grid(True, linewidth=0.3, color="#d0d0d0")
    axes.set_axisbelow(True)
    if x is not None:
        axes.set_xlabel(x, fontsize=TEXT, labelpad=2)
    if y is not None:
        axes.set_ylabel(y, fontsize=TEXT, labelpad=2)


def legend_above(axes: Axes, columns: int = 3) -> None:
    """Put the legend above the axes, out of the way of the curves."""
    legend = axes.legend(
        fontsize=SMALL,
        ncols=columns,
        frameon=False,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.1,
        handlelength=1.4,
        columnspacing=1.0,
    )
    # Room for it is kept by `new_figure`: a legend wider than its axes must not push others aside.
    legend.set_in_layout(False)


def axis_label(name: str, unit: str, error: bool = False) -> tuple[str, float]:
    """Return the label of a quantity with its display unit, and the factor from SI.

    Examples
    --------
    >>> axis_label("x", "m")
    ('$x$ [mm]', 1000.0)
    """
    text, factor = (ERROR_DISPLAY if error else DISPLAY).get(unit, (unit, 1.0))
    return f"{SYMBOLS.get(name, name)} [{text}]", factor


def thin(*arrays: FloatArray) -> Sequence[FloatArray]:
    """Return every n-th value of curves that have more points than a column can show."""
    step = max(1, int(np.ceil(arrays[0].size / POINTS)))
    return [array[::step] for array in arrays]


def block_means(t: FloatArray, e: FloatArray, seconds: float) -> tuple[FloatArray, FloatArray]:
    """Return means over blocks of so many seconds: what is left of an error beside noise."""
    n = max(1, round(seconds / float(t[1] - t[0])))
    K = t.size // n
    if K < 2:
        return t, e
    return t[: K * n].reshape(K, n).mean(axis=1), e[: K * n].reshape(K, n).mean(axis=1)


def remark(axes: Axes, text: str) -> None:
    """Write a short remark into the upper right corner of axes."""
    axes.text(
        0.985, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=SMALL - 0.5,
        bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.0}, zorder=5,
    )  # fmt: skip


def png(figure: Figure) -> bytes:
    """Return a figure as the content of a PNG file."""
    buffer = BytesIO()
    # Without version and date equal results give equal files.
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()


def svg(figure: Figure) -> bytes:
    """Return a figure as the content of an SVG file, letters as outlines."""
    buffer = BytesIO()
    # A fixed salt and no date: equal results give equal files.
    with rc_context({"svg.hashsalt": "pneumo_casadi", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
