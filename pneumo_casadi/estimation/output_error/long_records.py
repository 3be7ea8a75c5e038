"""Output error of long data: a sample leads near the optimum, all data give it.

From the start that weighted least squares gives, a fit needs twenty iterations; from the optimum of
a sixteenth of the data it needs a few, to the same optimum. A sample also tells over which length
the model follows the data: an error of the flows moves the position further and further away, so
that the open-loop simulation of ten minutes says more about this drift than about the parameters,
and steps of the parameters do not contract. Records that last longer than the data bear are fitted
over windows, each with a free initial state; the robust covariance sums the windows of a record, so
that misfit may last longer than one of them.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.output_error.options import Method, OutputErrorOptions
from pneumo_casadi.estimation.output_error.result import OutputErrorResult
from pneumo_casadi.estimation.output_error.stages import fit_stages, stepping_of
from pneumo_casadi.estimation.output_error.starts import settled_start
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.progress import Progress, progress_range
from pneumo_casadi.valve import AnyFlowMap

logger = logging.getLogger(__name__)

#: Data are long from so many samples and so many Runge-Kutta steps on: a sweep takes a second.
LONG_SAMPLES, LONG_STEPS = 200_000, 1_000_000
#: And where a record lasts longer than this [s], or there are so many of them: full steps from
#: measured states contract over a few records of a minute.
LONG_RECORD, MANY_RECORDS = 100.0, 20
#: Lengths of windows that are tried on a sample, the longest first [s].
HORIZONS = (20.0, 5.0, 1.0)
#: Share of the samples that the first fit takes, and pieces of records at least.
SHARE, PIECES = 1 / 16, 2
#: Root mean square of the residuals in the last quarter of a window over that in the first from
#: which on the open-loop simulation drifts away.
DRIFT = 3.0
#: Iterations over all data, from the optimum of a sample, before shorter windows are tried.
ITERATIONS = 40
#: Part of the work that the sample is [1].
SAMPLE_WORK = 0.3


def are_long(axis: Axis, records: Sequence[Recording], options: OutputErrorOptions) -> bool:
    """Tell whether a fit begins with a sample: much data, and no length of windows given."""
    samples = sum(record.N for record in records)
    if samples < LONG_SAMPLES or options.window is not None:
        return False
    if max(r.duration for r in records) < LONG_RECORD and len(records) < MANY_RECORDS:
        return False
    if options.method is not Method.GAUSS_NEWTON:
        return False
    return samples * stepping_of(axis, records, options).substeps > LONG_STEPS


def fit_long_records(
    axis: Axis,
    records: Sequence[Recording],
    flow_map: AnyFlowMap | None,
    options: OutputErrorOptions,
    report: Progress,
) -> OutputErrorResult:
    """Fit a sample, then all data from there, over windows as long as the data bear.

    Parameters
    ----------
    axis, records, flow_map, options
        As for `fit_output_error`.
    report : callable
        Called as ``report(text, share)``.

    Raises
    ------
    FitError
        If neither converges, whatever the length of the windows.
    """
    lengths = horizons(records, options)
    for i, length in enumerate(lengths):
        last = i + 1 == len(lengths)
        sample = draw_sample(records, length)
        seconds = sum(record.duration for record in sample)
        stage = progress_range(report, 0.0, SAMPLE_WORK, f"sample of {seconds:.3g} s: ")
        try:
            first = fit_stages(axis, sample, flow_map, options, stage)
        except FitError:
            if last:
                raise
            continue
        ratio = drift(first)
        logger.info("windows of %g s: residuals grow %.2f times", length, ratio)
        if ratio > DRIFT and not last:
            continue
        stage = progress_range(report, SAMPLE_WORK, 1.0)
        chosen = replace(options, window=equal_window(records, options, length))
        if not last:
            most = min(ITERATIONS, options.max_iterations)
            chosen = replace(chosen, recover=False, max_iterations=most)
        start = axis.with_parameters(first.parameters)
        try:
            result = fit_stages(start, records, flow_map, chosen, stage, settled_start)
        except FitError:
            if last:
                raise
            continue
        return replace(result, chosen_window=chosen.window)
    raise AssertionError("the last length returns or raises")


def horizons(records: Sequence[Recording], options: OutputErrorOptions) -> tuple[float, ...]:
    """Return the lengths of windows to try [s], the longest first.

    Those longer than all records are one: whole records. A simulated loop does not drift.
    """
    if options.closed_loop:
        return HORIZONS[:1]
    longest = max(record.duration for record in records)
    shorter = [length for length in HORIZONS if length < longest]
    return tuple(shorter) if longest > HORIZONS[0] else (HORIZONS[0], *shorter)


def equal_window(
    records: Sequence[Recording], options: OutputErrorOptions, length: float
) -> float | None:
    """Return at most `length` [s] such that windows of the longest record are equal.

    None for whole records: where none is longer, and in a simulated loop.
    """
    longest = max(records, key=lambda record: record.duration)
    if options.closed_loop or longest.duration <= length:
        return None
    n = max(1, round(options.block / longest.dt))
    blocks, count = (longest.N - 1) // n, math.ceil(longest.duration / length - 1e-6)
    return math.ceil(blocks / count) * n * longest.dt


def draw_sample(records: Sequence[Recording], length: float) -> tuple[Recording, ...]:
    """Return pieces of at most `length` seconds, evenly over all records.

    Examples
    --------
    >>> from pneumo_casadi.data import InputHold
    >>> record = Recording(np.arange(4000), {"x": np.zeros(4000)}, "slow", "", InputHold.ZERO)
    >>> [int(piece.t[0]) for piece in draw_sample([record], 100.0)]
    [1000, 3000]
    """
    pieces = []
    for record in records:
        count = max(1, int(record.duration / length + 1e-9))
        step = record.duration / count
        pieces += [(record, record.t[0] + i * step) for i in range(count)]
    wanted = SHARE * sum(record.N for record in records)
    per_piece = np.mean([min(length / record.dt, record.N) for record, _ in pieces])
    number = min(len(pieces), max(PIECES, round(float(wanted / per_piece))))
    chosen = ((2 * np.arange(number) + 1) * len(pieces)) // (2 * number)
    drawn = [pieces[i] for i in chosen]
    return tuple(record.window(begin, begin + length) for record, begin in drawn)


def drift(result: OutputErrorResult) -> float:
    """Return how many times the residuals are larger at the ends of segments than at their begin.

    Root mean square of the last quarter over that of the first, of the output that grows most.
    """
    begin, end = [], []
    for segment, fitted in zip(result.segments, result.fitted, strict=True):
        squares = (segment.y - fitted) ** 2
        quarter = max(1, segment.K // 4)
        begin.append(squares[:, :quarter].mean(axis=1))
        end.append(squares[:, -quarter:].mean(axis=1))
    growth = np.mean(end, axis=0) / np.maximum(np.mean(begin, axis=0), np.finfo(float).tiny)
    return float(np.sqrt(growth.max()))
