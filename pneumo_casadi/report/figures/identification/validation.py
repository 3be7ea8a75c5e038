"""Simulations beside a record that no fit has seen, and their differences."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from pneumo_casadi.report.figures.style import (
    CLOSED,
    HEAD,
    LINE,
    MEASURED,
    SIMULATED,
    TEXT,
    axis_label,
    block_means,
    dress,
    legend_above,
    new_figure,
    thin,
)
from pneumo_casadi.validation import Error, Run

#: Errors are averaged over blocks of this length [s], so that they show beside the noise.
AVERAGED = 0.02


def validation_figure(run: Run, errors: Mapping[str, Error]) -> Figure:
    """Draw a held-out record, its free runs, and their errors.

    Parameters
    ----------
    run : Run
        Record and simulations.
    errors : mapping of str to Error
        Of each output; the band of ±2σ of its sensor is drawn with the error.
    """
    outputs = tuple(errors)
    figure = new_figure(18.0 + 42.0 * len(outputs), head=HEAD)
    ratios = [2, 1.2] * len(outputs)
    axes_of = figure.subplots(
        2 * len(outputs), 1, sharex=True, squeeze=False, height_ratios=ratios
    )[:, 0]
    simulations = [("open loop", run.open_loop, SIMULATED, "-")]
    if run.closed_loop is not None:
        simulations.append(("closed loop", run.closed_loop, CLOSED, "--"))
    for i, name in enumerate(outputs):
        above, below = axes_of[2 * i], axes_of[2 * i + 1]
        label, factor = axis_label(name, errors[name].unit)
        error_label, error_factor = axis_label("error", errors[name].unit, error=True)
        t, y = thin(run.record.t, run.record[name])
        above.plot(t, y * factor, color=MEASURED, linewidth=2.2, label="measured")
        for text, trajectory, colour, dashes in simulations:
            _, simulated = thin(run.record.t, trajectory[name])
            above.plot(t, simulated * factor, dashes, color=colour, linewidth=LINE, label=text)
            e = run.record[name] - trajectory[name]
            time, mean = block_means(run.record.t, e, AVERAGED)
            below.plot(time, mean * error_factor, color=colour, linewidth=LINE)
        if errors[name].percent and errors[name].noise_percent:
            noise = errors[name].rms * errors[name].noise_percent / errors[name].percent
            band = 2 * noise * error_factor
            below.axhspan(-band, band, color="#dddddd", linewidth=0, zorder=0.5)
        dress(above, None, label)
        dress(below, None, error_label)
    legend_above(axes_of[0], 3)
    axes_of[-1].set_xlabel("$t$ [s]", fontsize=TEXT)
    figure.align_ylabels()
    return figure
