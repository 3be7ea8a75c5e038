"""The figures of an identification, in the order of its report, with their captions."""

from collections.abc import Iterator
from dataclasses import dataclass

from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.figures.identification.cross_validation import cross_validation_figure
from pneumo_casadi.report.figures.identification.flow_map import (
    flow_map_figure,
    residual_map_figure,
)
from pneumo_casadi.report.figures.identification.identifiability import clustered_correlation_figure
from pneumo_casadi.report.figures.identification.overview import overview_figure
from pneumo_casadi.report.figures.identification.parameters import correlation_figure, forest_figure
from pneumo_casadi.report.figures.identification.regressor import regressor_figure
from pneumo_casadi.report.figures.identification.residuals import fit_figure, residual_figure
from pneumo_casadi.report.figures.style import Figure, files_of, png, svg
from pneumo_casadi.report.figures.time_series import time_series_figure
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import FlowMap, FlowModel, each_valve


@dataclass(frozen=True, slots=True)
class Drawn:
    """A figure with its caption.

    Parameters
    ----------
    name : str
        Of its file, without suffix.
    figure : matplotlib.figure.Figure
        The drawing.
    caption : str
        What it shows.
    """

    name: str
    figure: Figure
    caption: str

    def png(self) -> bytes:
        """Return the figure as a PNG file."""
        return png(self.figure)

    def files(self) -> dict[str, bytes]:
        """Return the contents of the figure's files by suffix: PNG, SVG and PDF."""
        return files_of(self.figure)

    def svg(self) -> bytes:
        """Return the figure as an SVG file."""
        return svg(self.figure)


def figures_of(identification: Identification) -> Iterator[Drawn]:
    """Draw all figures of an identification, in the order of the report.

    Yields
    ------
    Drawn
        One figure with its name and caption.
    """
    if identification.validation is not None and identification.flow_map is not None:
        yield Drawn(
            "overview",
            overview_figure(identification),
            "Summary: flow map, simulation of a held-out record, parameters.",
        )
    yield Drawn(
        "parameters",
        forest_figure(identification),
        "Estimates with intervals of ±2σ that include the correlation of the residuals, "
        + (
            "relative to the true parameters."
            if identification.truth
            else "relative to output error."
        ),
    )
    if identification.validation is not None:
        yield from validation_figures(identification.validation)
    yield from _flow_map_figures(identification)
    yield from _wls_figures(identification)
    yield from _output_error_figures(identification)


def _flow_map_figures(identification: Identification) -> Iterator[Drawn]:
    if identification.flow_map is not None and identification.flow is not None:
        valves = each_valve(identification.flow_map, identification.flow)
        for number, (which, (table, flow)) in enumerate(valves.items()):
            yield from _figures_of_map(f"_{'PN'[number]}" if which else "", which, table, flow)


def _figures_of_map(end: str, which: str, table: FlowMap, flow: FlowModel) -> Iterator[Drawn]:
    yield Drawn(
        f"flow_map{end}",
        flow_map_figure(table, flow),
        f"Static flow map{which or ' of the valve'}: surface and its three projections "
        "(as Fig. 2 of the paper); dots: measured, lines: fitted.",
    )
    yield Drawn(
        f"residual_map{end}",
        residual_map_figure(table, flow),
        f"Residuals of the fitted flow map{which} (as Fig. 3 of the paper).",
    )


def _wls_figures(identification: Identification) -> Iterator[Drawn]:
    yield Drawn(
        "regressor",
        regressor_figure(identification.wls, identification.records[0]),
        "Weighted least squares on a record of the fit: left side Y of the balances (eq. 13) and "
        "W X̂; below, the residuals with a band of ±2σ. Rows at rest are left out because static "
        "friction is not a function of the velocity.",
    )
    for prediction in identification.predictions:
        yield Drawn(
            f"cross_validation_{prediction.name}",
            cross_validation_figure(prediction),
            "Mass flows and pressure force predicted by weighted least squares on a held-out "
            "record (as Figs. 4 and 5 of the paper). Rows at rest are left out.",
        )


def _output_error_figures(identification: Identification) -> Iterator[Drawn]:
    yield Drawn(
        "output_error",
        fit_figure(identification.output_error, identification.records),
        "Measured outputs and the output-error fit.",
    )
    yield Drawn(
        "residuals",
        residual_figure(identification.output_error, identification.records),
        "Residuals of the output-error fit and their autocorrelation. A complete model leaves "
        "white residuals, inside the band; the ±2σ of the estimates allow for what is left.",
    )
    yield Drawn(
        "correlations",
        correlation_figure(identification),
        "Correlations of the output-error estimates.",
    )
    if identification.identifiability is not None:
        yield Drawn(
            "all_correlations",
            clustered_correlation_figure(identification.identifiability),
            "Correlations of all estimates, the flow map's coefficients among them; parameters "
            "that compensate each other are adjacent.",
        )


def validation_figures(validation: Validation) -> Iterator[Drawn]:
    """Draw each held-out record beside its simulations.

    Yields
    ------
    Drawn
        One figure a record, with its name and caption.
    """
    for curves in validation.curves:
        yield Drawn(
            f"validation_{curves.record}",
            time_series_figure(curves),
            f"Held-out record {curves.record}: simulations over the whole record with the "
            "recorded inputs (open loop) and under the recorded controller (closed loop); below, "
            "measured minus simulated, averaged over 20 ms; the band is ±2σ of one sensor sample. "
            "Right: the part with the largest difference, shaded on the left.",
        )
