"""One style for all figures: column width of the paper, colours that everybody can tell apart.

Figures are made through the object interface, without pyplot: no global state, no display.
"""

import re
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Figure
from matplotlib.transforms import Bbox

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.tables.table import with_symbols

#: Widths of one column and of the page [mm] (IFAC).
COLUMN, PAGE = 88.0, 181.0
MM = 1 / 25.4
DPI = 220

#: Okabe and Ito (2008): distinct with every common colour vision.
BLACK, GREY = "#000000", "#8c8c8c"
BLUE, ORANGE, GREEN, VERMILION, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9"
#: Colours of the curves in all figures.
MEASURED, SIMULATED, CLOSED, WLS, TRUTH = GREY, BLUE, VERMILION, ORANGE, BLACK

TEXT, SMALL = 8.0, 7.0
LINE = 0.9

#: Room for a legend above the axes [mm].
HEAD = 4.0
#: Height of a bar's row, and of what an axis needs beside its rows [mm].
ROW, REST = 5.4, 11.0

#: Display units: SI unit -> (text, factor). Residuals have the unit of their signal.
DISPLAY = {
    "m": ("mm", 1e3),
    "Pa": ("kPa", 1e-3),
    "kg/s": ("g/s", 1e3),
    "N": ("N", 1.0),
    "V": ("V", 1.0),
}

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
    "force": "force",
}
UNITS = {"mass_flow_P": "kg/s", "mass_flow_N": "kg/s", "force": "N"}

#: Coefficients of the flow's polynomials: branch, power.
_COEFFICIENT = re.compile(r"(phi|psi_plus|psi_minus)_(\d+)")
_BRANCHES = {"phi": r"\varphi", "psi_plus": r"\psi^+", "psi_minus": r"\psi^-"}

#: More points than this in one curve are too many for a column.
POINTS = 4000


class Sheet(Figure):
    """A figure that is saved as large as it was made.

    Notebooks save with ``bbox_inches="tight"``, which cuts off what the layout does not count,
    legends above the axes among it, and gives each figure a width of its own.
    """

    def get_tightbbox(
        self, renderer: RendererBase | None = None, *, bbox_extra_artists: Any = None
    ) -> Bbox:
        """Return the whole figure."""
        return self.bbox_inches


def new_figure(height: float, width: float = COLUMN, head: float = 0.0) -> Figure:
    """Return an empty figure of that size [mm] that lays itself out below a free head [mm]."""
    figure = Sheet(figsize=(width * MM, height * MM), dpi=DPI, layout="constrained")
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


def legend_above(axes: Axes, columns: int = 3, handles: Sequence[Artist] | None = None) -> None:
    """Put the legend above the axes, out of the way of the curves.

    Parameters
    ----------
    handles : sequence of Artist, optional
        Labelled; by default what the axes hold.
    """
    legend = axes.legend(
        handles=axes.get_legend_handles_labels()[0] if handles is None else list(handles),
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


def symbol(name: str) -> str:
    """Return how a quantity is written in figures: as in the paper where it has a symbol there.

    Examples
    --------
    >>> symbol("F_c_plus"), symbol("stribeck.delta_F")
    ('$F_c^+$', 'Stribeck friction: delta_F')
    """
    coefficient = _COEFFICIENT.fullmatch(name)
    if coefficient is not None:
        return f"${_BRANCHES[coefficient[1]]}_{{{coefficient[2]}}}$"
    return SYMBOLS.get(name) or with_symbols(name)


def axis_label(name: str, unit: str) -> tuple[str, float]:
    """Return the label of a quantity with its display unit, and the factor from SI.

    Examples
    --------
    >>> axis_label("x", "m")
    ('$x$ [mm]', 1000.0)
    """
    text, factor = DISPLAY.get(unit, (unit, 1.0))
    return f"{symbol(name)} [{text}]", factor


def thin(*arrays: FloatArray) -> Sequence[FloatArray]:
    """Return every n-th value of curves that have more points than a column can show."""
    step = max(1, int(np.ceil(arrays[0].size / POINTS)))
    return [array[::step] for array in arrays]


def block_means(t: FloatArray, e: FloatArray, seconds: float) -> tuple[FloatArray, FloatArray]:
    """Return means over blocks of so many seconds: which averages the noise."""
    n = max(1, round(seconds / float(t[1] - t[0])))
    K = t.size // n
    if K < 2:
        return t, e
    return t[: K * n].reshape(K, n).mean(axis=1), e[: K * n].reshape(K, n).mean(axis=1)


def headroom(axes: Axes, share: float = 0.25) -> None:
    """Leave so much of its height free at the top of a panel, for a remark."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + share * (high - low))


def write_at_bar(axes: Axes, value: float, at: float, text: str, bar: str = BLUE) -> None:
    """Write a number behind a bar of that colour on an axis to 100 %, into it where it is long."""
    inside = value > 85
    axes.annotate(
        text, (value, at), (-2 if inside else 2, -0.4), textcoords="offset points", va="center",
        ha="right" if inside else "left", fontsize=SMALL - 0.5,
        color="#ffffff" if inside and bar == BLUE else BLACK, zorder=4,
    )  # fmt: skip


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


def save_figure(figure: Figure, path: str | Path) -> tuple[Path, ...]:
    """Save a figure as PNG, SVG and PDF, in the width of a column or of the page of an IFAC paper.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        From one of the functions of ``pc.plot``.
    path : path
        Of the files, without suffix.

    Returns
    -------
    tuple of Path
        The three files.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> import tempfile
    >>> folder = tempfile.mkdtemp()
    >>> [file.name for file in pc.plot.save(pc.plot.parameters(result), folder + "/parameters")]
    ['parameters.png', 'parameters.svg', 'parameters.pdf']
    """
    path, written = Path(path), []
    for suffix, content in files_of(figure).items():
        file = path.with_name(f"{path.name}.{suffix}")
        file.write_bytes(content)
        written.append(file)
    return tuple(written)


def files_of(figure: Figure) -> dict[str, bytes]:
    """Return the contents of a figure's files by their suffixes: png, svg and pdf."""
    contents: dict[str, bytes] = {}
    layout = figure.get_layout_engine()
    try:
        for content_of in (png, svg, pdf):
            contents[content_of.__name__] = content_of(figure)
            # It takes as long as drawing, and would find the same; even "none" draws once more.
            with rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
                figure.set_layout_engine(None)
    finally:
        figure.set_layout_engine(layout)
    return contents


def pdf(figure: Figure) -> bytes:
    """Return a figure as the content of a PDF file, with its fonts embedded."""
    buffer = BytesIO()
    # Type 42: publishers refuse the bitmaps of type 3. No date: equal results give equal files.
    with rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format="pdf", metadata={"CreationDate": None})
    return buffer.getvalue()


def svg(figure: Figure) -> bytes:
    """Return a figure as the content of an SVG file, letters as outlines."""
    buffer = BytesIO()
    # A fixed salt and no date: equal results give equal files.
    with rc_context({"svg.hashsalt": "pneumo_casadi", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
