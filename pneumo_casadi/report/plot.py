"""Figures of results, one function each: ``pc.plot.parameters(result)`` returns a Figure.

A figure is shown by a notebook as it is. ``pc.plot.save(figure, path)`` saves it as PNG, SVG and
PDF, ``figure.savefig(path)`` as one of them by the suffix of the path. Its width is that of a
column or the page of an IFAC paper.

Examples
--------
With ``result = pc.identify(pc.example_case())``:

>>> figure = pc.plot.parameters(result)
>>> [axes.get_xlabel() for axes in figure.axes]
['deviation from truth [%]']
"""

from collections.abc import Sequence

from pneumo_casadi.data import UNITS, Recording
from pneumo_casadi.design import Design
from pneumo_casadi.diagnosis import Diagnosis
from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification.comparison import Comparison
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.figures.diagnosis.dashboard import dashboard_figure
from pneumo_casadi.report.figures.diagnosis.discovered_term import discovered_term_figure
from pneumo_casadi.report.figures.diagnosis.gap import gap_figure, gap_labels
from pneumo_casadi.report.figures.diagnosis.ranking import ranking_figure
from pneumo_casadi.report.figures.diagnosis.regimes import regime_figure
from pneumo_casadi.report.figures.diagnosis.unknown_inputs import unknown_input_figure
from pneumo_casadi.report.figures.diagnosis.where import where_figure
from pneumo_casadi.report.figures.identification.cross_validation import cross_validation_figure
from pneumo_casadi.report.figures.identification.flow_map import (
    flow_map_figure,
    residual_map_figure,
)
from pneumo_casadi.report.figures.identification.overview import overview_figure
from pneumo_casadi.report.figures.identification.parameters import correlation_figure, forest_figure
from pneumo_casadi.report.figures.identification.regressor import regressor_figure
from pneumo_casadi.report.figures.identification.residuals import fit_figure, residual_figure
from pneumo_casadi.report.figures.studies.design import design_figure
from pneumo_casadi.report.figures.style import (
    LINE,
    MEASURED,
    Figure,
    axis_label,
    dress,
    new_figure,
    save_figure,
    thin,
)
from pneumo_casadi.report.figures.time_series import time_series_figure
from pneumo_casadi.validation import Validation
from pneumo_casadi.valve import FlowMap, FlowModel, each_valve

save = save_figure


def recording(recording: Recording, channels: Sequence[str] = ("x",)) -> Figure:
    """Plot channels of a recording over time, one panel each."""
    figure = new_figure(12.0 + 32.0 * len(channels))
    panels = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, channels, strict=True):
        label, factor = axis_label(name, UNITS[name])
        t, values = thin(recording.t, recording[name])
        axes.plot(t, values * factor, color=MEASURED, linewidth=LINE)
        dress(axes, None, label)
    dress(panels[-1], "$t$ [s]")
    return figure


def parameters(result: Identification) -> Figure:
    """Plot the WLS and output-error estimates with their intervals, beside the truth if known."""
    return forest_figure(result)


def correlations(result: Identification) -> Figure:
    """Plot the correlations of the output-error estimates."""
    return correlation_figure(result)


def overview(result: Identification) -> Figure:
    """Plot flow map, held-out prediction and parameters at a glance."""
    _needed(result.flow_map is not None and result.validation is not None, "flow map, validation")
    return overview_figure(result)


def flow_map(result: Identification) -> Figure:
    """Plot the static flow map: surface and three projections, measured and fitted (Fig. 2)."""
    return flow_map_figure(*_flow(result))


def flow_map_residuals(result: Identification) -> Figure:
    """Plot the difference between the measured flow map and its fit (Fig. 3)."""
    return residual_map_figure(*_flow(result))


def regressor(result: Identification) -> Figure:
    """Plot the WLS fit: measured sides of the balances, W X̂ and residuals of the first record."""
    return regressor_figure(result.wls, result.records[0])


def cross_validation(result: Identification, record: int = 0) -> Figure:
    """Plot flows and force predicted by WLS on a held-out record (Figs. 4 and 5).

    `record` counts those that are long enough for the filters of WLS.
    """
    known = len(result.predictions)
    _needed(-known <= record < known, "held-out records that are long enough for WLS")
    return cross_validation_figure(result.predictions[record])


def output_error(result: Identification) -> Figure:
    """Plot the outputs measured and as fitted by output error."""
    return fit_figure(result.output_error, result.records)


def residuals(result: Identification) -> Figure:
    """Plot the residuals of the output-error fit and their autocorrelation."""
    return residual_figure(result.output_error, result.records)


def validation(result: Identification | Validation, record: int = 0) -> Figure:
    """Plot a held-out record, its simulations in open and closed loop, and their errors."""
    checked = result.validation if isinstance(result, Identification) else result
    if checked is None:
        raise ModelError("no validation to plot; the case has no held-out record")
    return time_series_figure(checked.curves[record])


def simulations(diagnosis: Diagnosis, record: int = 0) -> Figure:
    """Plot a held-out record over time, measured and simulated without and with the effects."""
    curves = _evidence(diagnosis).simulations
    _needed(bool(curves), "simulations of the held-out record")
    return time_series_figure(curves[record])


def gap(diagnosis: Diagnosis) -> Figure:
    """Plot the error on held-out data without and with the effects added, by output."""
    _needed(bool(diagnosis.gap.views), "simulations of the held-out record")
    return gap_figure(diagnosis)


def comparison(comparison: Comparison, record: int = 0) -> Figure:
    """Plot a record over time, measured and as each of the compared results simulates it."""
    _needed(bool(comparison.curves), "simulations")
    return time_series_figure(comparison.curves[record])


def ranking(diagnosis: Diagnosis) -> Figure:
    """Plot the most probable causes, and how much of the error each one removes."""
    _needed(bool(diagnosis.ranking), "candidates")
    return ranking_figure(diagnosis)


def where(diagnosis: Diagnosis) -> Figure:
    """Plot which balance the error lies in, and the parts of the record that hold most of it."""
    return where_figure(diagnosis)


def unknown_inputs(diagnosis: Diagnosis, record: int = 0) -> Figure:
    """Plot the input over time that each balance lacks on a held-out record, with ±2σ."""
    return unknown_input_figure(_evidence(diagnosis).inputs[record], diagnosis.where.unknown_inputs)


def regimes(diagnosis: Diagnosis, balance: str = "force") -> Figure:
    """Plot the mean residual of a balance over position, velocity, pressure and command."""
    evidence = _evidence(diagnosis)
    before = [item for item in evidence.before if item.balance == balance]
    after = [item for item in evidence.after if item.balance == balance]
    known = sorted({item.balance for item in evidence.before})
    _needed(bool(before), f"balance {balance!r} (there are {', '.join(known)})")
    return regime_figure(before, after, gap_labels(diagnosis))


def discovered_term(diagnosis: Diagnosis) -> Figure:
    """Plot a discovered term over its driver: curve with its 95 % band, and the formula."""
    if diagnosis.discovered is None:
        raise ModelError("nothing to plot: the diagnosis has discovered no term")
    return discovered_term_figure(diagnosis.discovered)


def dashboard(diagnosis: Diagnosis) -> Figure:
    """Plot a diagnosis at a glance: error, most probable causes, place, and residual."""
    _needed(bool(diagnosis.gap.views and diagnosis.ranking), "simulations and candidates")
    return dashboard_figure(diagnosis)


def design(design: Design) -> Figure:
    """Plot a designed reference, the predicted trajectories and the predicted gain."""
    return design_figure(design)


def _needed(there: bool, what: str) -> None:
    if not there:
        raise ModelError(f"nothing to plot: the result has no {what}")


def _flow(result: Identification) -> tuple[FlowMap, FlowModel]:
    if result.flow_map is None or result.flow is None:
        raise ModelError("nothing to plot: no flow map was measured")
    return next(iter(each_valve(result.flow_map, result.flow).values()))


def _evidence(diagnosis: Diagnosis) -> Evidence:
    if diagnosis.evidence is None:
        raise ModelError("nothing to plot: the diagnosis was made without its curves")
    return diagnosis.evidence
