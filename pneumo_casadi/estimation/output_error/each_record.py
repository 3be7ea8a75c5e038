"""Estimates from each of several records, or groups of many: their spread and intervals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import special

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.output_error.fit import fit_output_error
from pneumo_casadi.estimation.output_error.long_records import are_long
from pneumo_casadi.estimation.output_error.options import OutputErrorOptions
from pneumo_casadi.estimation.output_error.result import OutputErrorResult
from pneumo_casadi.estimation.output_error.stages import fit_stages
from pneumo_casadi.estimation.output_error.starts import known_start
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.threads import one_thread

#: Probability that records of one axis exceed the limit of the spread in any parameter by chance.
CHANCE = 0.01
#: Most fits; more records are fitted in groups. What drifts shows in ten as in hundreds, and a
#: table has room for them.
MOST_FITS = 10


@dataclass(frozen=True, eq=False)
class RecordEstimates:
    """Output-error estimates from single records, or from groups of records where there are many.

    Parameters
    ----------
    records : tuple of str
        Names of the records that could be fitted alone; of a group the first and the last.
    names : tuple of str
        Parameters, those of the flow map excepted.
    values, std : (nr, n) array
        Estimates and robust standard deviations [SI], a row a record; infinite where the record
        says nothing about a parameter or a bound holds it.
    failed : tuple of str
        Records on which the fit alone did not converge.

    Examples
    --------
    >>> alone = RecordEstimates(
    ...     ("a", "b"), ("M",), np.array([[16.8], [17.0]]), np.array([[0.1], [0.1]])
    ... )
    >>> round(alone.spread("M"), 3)
    1.414
    """

    records: tuple[str, ...]
    names: tuple[str, ...]
    values: FloatArray
    std: FloatArray
    failed: tuple[str, ...] = ()

    def spread(self, name: str) -> float | None:
        """Return how far the estimates lie apart, in their standard deviations σ.

        √(Σ (θ - mean)²/σ² / (n - 1)) over the n records with an interval, with the mean weighted by
        1/σ²: about one where the records agree (the Birge ratio). None for fewer than two.
        """
        z = self._distances(name)
        return float(np.sqrt(z @ z / (z.size - 1))) if z.size > 1 else None

    def excess(self, name: str) -> float:
        """Return the sum of the squared distances over the limit of chance.

        Records that agree exceed the limit in any parameter in one case of a hundred. 0 for fewer
        than two intervals.
        """
        z = self._distances(name)
        if z.size < 2:
            return 0.0
        return float(z @ z / special.chdtri(z.size - 1, CHANCE / len(self.names)))

    def _distances(self, name: str) -> FloatArray:
        # From their own mean: the interval of the joint fit widens with what is to be seen here.
        # Biases, as that of the smoothed friction, count: they differ with the motion.
        column = self.names.index(name)
        known = np.isfinite(self.std[:, column]) & (self.std[:, column] > 0)
        values, std = self.values[known, column], self.std[known, column]
        mean = np.average(values, weights=std**-2) if values.size else 0.0
        return np.asarray((values - mean) / std)


@one_thread
def fit_each_record(
    joint: OutputErrorResult,
    records: Sequence[Recording],
    options: OutputErrorOptions,
    progress: Progress | None = None,
) -> RecordEstimates:
    """Fit each record alone, from the solution of all together; of many, groups in their order.

    The flow map is held where the joint fit has left it: it belongs to all records, and a single
    one would move it.

    Parameters
    ----------
    joint : OutputErrorResult
        Fit to all records.
    records : sequence of Recording
        Two or more.
    options : OutputErrorOptions
        As in the joint fit.
    progress : callable, optional
        Called as ``progress(text, share)``.
    """
    report = progress or no_progress
    flow = joint.axis.flow_parameters
    axis = joint.axis.with_parameters(joint.parameters.fix(*flow))
    names = tuple(name for name in joint.uncertainty.names if name not in set(flow))
    fitted: list[str] = []
    failed: list[str] = []
    rows: list[list[tuple[float, float]]] = []
    groups = record_groups(records)
    alone = replace(options, recover=False)
    long = are_long(joint.axis, records, options)
    first = 0
    for i, (name, group) in enumerate(groups.items()):
        stage = progress_range(report, i / len(groups), (i + 1) / len(groups), name)
        try:
            if long:
                whole = replace(alone, window=joint.chosen_window)
                begin = known_start(_initial_states(joint, first, len(group)))
                fit = fit_stages(axis, group, None, whole, stage, begin)
            else:
                fit = fit_output_error(axis, group, None, alone, stage)
        except FitError:
            failed.append(name)
            continue
        finally:
            first += len(group)
        fitted.append(name)
        rows.append([(fit.parameters[name].value, _std(fit, name)) for name in names])
    table = np.array(rows, dtype=float).reshape(len(fitted), len(names), 2)
    return RecordEstimates(
        tuple(fitted),
        names,
        table[:, :, 0],
        table[:, :, 1],
        tuple(failed),
    )


def record_groups(records: Sequence[Recording]) -> dict[str, Sequence[Recording]]:
    """Return the records by name, or `MOST_FITS` groups of neighbours where there are more."""
    cuts = np.linspace(0, len(records), min(len(records), MOST_FITS) + 1).astype(int)
    parts = [records[first:last] for first, last in pairwise(cuts)]
    names = [
        part[0].name if len(part) == 1 else f"{part[0].name} ... {part[-1].name}" for part in parts
    ]
    numbered = [
        f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name
        for i, name in enumerate(names)
    ]
    return dict(zip(numbered, parts, strict=True))


def _initial_states(fit: OutputErrorResult, first: int, count: int) -> list[FloatArray]:
    """Return the initial states of the segments of some records, the first of which is given."""
    wanted = range(first, first + count)
    pairs = zip(fit.segments, fit.initial_states, strict=True)
    return [state for segment, state in pairs if segment.record in wanted]


def _std(fit: OutputErrorResult, name: str) -> float:
    """Return the wider standard deviation; infinite at a bound."""
    if name in fit.uncertainty.at_bound:
        return float("inf")
    return max(fit.std(name), fit.std(name, robust=True))
