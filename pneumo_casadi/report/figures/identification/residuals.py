"""The output-error fit: measured and fitted outputs, residuals and their autocorrelation."""

import numpy as np
from matplotlib.figure import Figure

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.statistics import autocorrelation
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    HEAD,
    LINE,
    MEASURED,
    SIMULATED,
    TEXT,
    axis_label,
    dress,
    legend_above,
    new_figure,
    remark,
    symbol,
    thin,
)

#: Longest lag that is drawn [s].
LAG = 0.2


def fit_figure(result: OutputErrorResult, records: tuple[Recording, ...]) -> Figure:
    """Draw measured and fitted outputs of the first record identified on."""
    outputs = result.axis.outputs
    t, measured, fitted = _first_record(result, records)
    figure = new_figure(18.0 + 28.0 * len(outputs), head=HEAD)
    axes_of = figure.subplots(len(outputs), 1, sharex=True, squeeze=False)[:, 0]
    for i, (axes, name) in enumerate(zip(axes_of, outputs, strict=True)):
        label, factor = axis_label(name, result.axis.unit(name))
        time, y, y_hat = thin(t, measured[i], fitted[i])
        axes.plot(time, y * factor, color=MEASURED, linewidth=2.2, label="measured")
        axes.plot(time, y_hat * factor, color=SIMULATED, linewidth=LINE, label="output error")
        dress(axes, None, label)
    legend_above(axes_of[0], 2)
    axes_of[-1].set_xlabel("$t$ [s]", fontsize=TEXT)
    figure.align_ylabels()
    return figure


def residual_figure(result: OutputErrorResult, records: tuple[Recording, ...]) -> Figure:
    """Draw the residuals of the output-error fit and their autocorrelation.

    A model that is complete leaves white residuals: all bars but the first inside the band
    ±1.96/√K.
    """
    outputs = result.axis.outputs
    t, measured, fitted = _first_record(result, records)
    figure = new_figure(16.0 + 27.0 * len(outputs))
    grid = figure.subplots(len(outputs), 2, squeeze=False, width_ratios=(1.7, 1), sharex="col")
    for i, name in enumerate(outputs):
        label, factor = axis_label(name, result.axis.unit(name))
        e = measured[i] - fitted[i]
        time, shown = thin(t, e)
        grid[i, 0].plot(time, shown * factor, color=BLUE, linewidth=0.4)
        dress(grid[i, 0], None, f"residual {label}")
        dt = float(np.median(np.diff(t)))
        lags = max(2, min(round(LAG / dt), e.size // 4))
        rho = autocorrelation(e, lags)
        grid[i, 1].plot(dt * np.arange(lags + 1), rho, color=BLACK, linewidth=LINE)
        band = 1.96 / np.sqrt(e.size)
        grid[i, 1].axhspan(-band, band, color=BLUE, alpha=0.3, linewidth=0)
        dress(grid[i, 1], None, f"autocorr. {symbol(name)} [1]")
        grid[i, 1].set_ylim(-0.5, 1.05)
    remark(grid[0, 1], "white if\nin the band")
    grid[-1, 0].set_xlabel("$t$ [s]", fontsize=TEXT)
    grid[-1, 1].set_xlabel("lag [s]", fontsize=TEXT)
    figure.align_ylabels()
    return figure


def _first_record(
    result: OutputErrorResult, records: tuple[Recording, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Join the segments of the first record: middle of each block, measured, fitted."""
    record = records[0]
    t, y, y_hat = [], [], []
    for segment, fitted in zip(result.segments, result.fitted, strict=True):
        if segment.record != 0:
            continue
        middle = segment.first + segment.n * (np.arange(segment.K) + 0.5) - 0.5
        t.append(record.t[0] + record.dt * middle)
        y.append(segment.y)
        y_hat.append(fitted)
    return np.concatenate(t), np.hstack(y), np.hstack(y_hat)
