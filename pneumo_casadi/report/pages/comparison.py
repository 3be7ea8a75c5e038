"""The report of a comparison: parameters side by side, every record as each result simulates it."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from pneumo_casadi.identification.comparison import MOVED, Comparison
from pneumo_casadi.report.pages.drawing import can_draw
from pneumo_casadi.report.pages.page import (
    TIME_FIGURE,
    Picture,
    Section,
    Verdict,
    html_page,
    plots_of,
)
from pneumo_casadi.report.tables.comparison import comparison_tables
from pneumo_casadi.report.tables.laboratory import legend_table
from pneumo_casadi.report.tables.validation import records_table

if TYPE_CHECKING:
    from pneumo_casadi.report.pages.identification_figures import Drawn


def comparison_html(comparison: Comparison, pictures: Sequence[Picture]) -> str:
    """Return a comparison as one HTML page.

    Parameters
    ----------
    comparison : Comparison
        Results side by side.
    pictures : sequence of Picture
        The still figures of its time plots.
    """
    plots, left = plots_of(comparison.curves, pictures)
    moved = sum(item.moved for item in comparison.differences)
    words = f"{moved} of {len(comparison.differences)} differences exceed {MOVED:g} σ"
    used = " ".join(comparison.estimates) + " x p_P σ"
    sections = [
        Section("parameters", "Parameters", tables=comparison_tables(comparison)),
        Section("simulation", "Measurement and simulations", pictures=left, plots=plots),
        Section("symbols", "Symbols", tables=[legend_table(used)]),
        Section(
            "provenance", "Provenance", tables=[records_table(comparison.provenance)],
            provenance=comparison.provenance,
        ),
    ]  # fmt: skip
    title = f"Comparison of {' and '.join(comparison.names)}"
    verdict = Verdict("care" if moved else "good", words, comparison.headline)
    return html_page(title, verdict, sections)


def overlays(comparison: Comparison) -> "Iterable[Drawn]":
    """Draw every record with all simulations over time; nothing without matplotlib."""
    if not can_draw():
        return
    from pneumo_casadi.report.figures.time_series import time_series_figure
    from pneumo_casadi.report.pages.identification_figures import Drawn

    for curves in comparison.curves:
        yield Drawn(
            f"{TIME_FIGURE}{curves.record}",
            time_series_figure(curves),
            f"Record {curves.record}, measured and simulated over windows of up to 2 s with the "
            f"parameters of {' and of '.join(curves.simulations)}; below, measured minus "
            "simulated, averaged over 20 ms. Right: the part with the largest difference.",
        )
