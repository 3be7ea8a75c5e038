"""The output-error problem: data, model and unknowns, before any solver is chosen.

Unknowns are the free parameters θ and the states x_k where the intervals begin, tied within a
segment by x_{k+1} = F(x_k, w_k, θ). The model's mean outputs over the blocks of an interval are
m_k = H(x_k, w_k, θ).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.output_error.shooting.interval import IntervalFunctions
from pneumo_casadi.estimation.output_error.shooting.segments import Segment
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.machine_code.calls import ResultMemory, call_side_by_side
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.parameters import FloatArray, Parameters


@dataclass(frozen=True, slots=True)
class Unknowns:
    """A point of the problem, in SI units.

    Parameters
    ----------
    theta : (n,) array
        All parameters of the axis, fixed ones included.
    x : (nx, I) array
        States where the intervals begin, segment after segment.
    """

    theta: FloatArray
    x: FloatArray


@dataclass(frozen=True, slots=True)
class IntervalData:
    """What all I intervals are given, padded to one length; see `IntervalFunctions`.

    Parameters
    ----------
    w : (nw, I B n) array
        Inputs.
    h : (1, I B) array
        Sampling period of each block [s], zero in the padding.
    y : (ny, I B) array
        Measured mean outputs.
    real : (I B,) array of bool
        Which blocks are no padding.
    """

    w: FloatArray
    h: FloatArray
    y: FloatArray
    real: NDArray[np.bool_]

    def without_padding(self, values: FloatArray) -> FloatArray:
        """Return the columns of values (..., I B) that belong to blocks of the data."""
        count = np.count_nonzero(self.real)
        # One record is padded at its end alone: nothing is copied.
        return values[:, :count] if self.real[:count].all() else values[:, self.real]


@dataclass(frozen=True, eq=False)
class Problem:
    """Functions and data of one output-error problem.

    Parameters
    ----------
    model : SampledAxis
        The axis from one sample to the next.
    parameters : Parameters
        Values, bounds, scales and freedom.
    segments : tuple of Segment
        Data.
    functions : IntervalFunctions
        Compiled interval with sensitivities to the free parameters.
    anchor : Anchor or None
        Residuals of the flow map.
    """

    model: SampledAxis
    parameters: Parameters
    segments: tuple[Segment, ...]
    functions: IntervalFunctions
    anchor: Anchor | None

    @property
    def axis(self) -> Axis:
        """The model's axis."""
        return self.model.axis

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return self.parameters.free_names

    @property
    def n(self) -> int:
        """Samples a block."""
        return self.functions.n

    @property
    def n_blocks(self) -> int:
        """Blocks over all segments."""
        return sum(segment.K for segment in self.segments)

    @cached_property
    def I(self) -> int:  # noqa: E743 - the number of intervals, as in the equations
        """Intervals, and nodes, over all segments."""
        return sum(segment.intervals for segment in self.segments)

    @cached_property
    def firsts(self) -> tuple[int, ...]:
        """First interval of each segment."""
        counts = np.cumsum([0, *(segment.intervals for segment in self.segments)])
        return tuple(int(i) for i in counts[:-1])

    @cached_property
    def joined(self) -> NDArray[np.intp]:
        """Intervals whose end is the beginning of the next one."""
        lasts = {a + s.intervals - 1 for a, s in zip(self.firsts, self.segments, strict=True)}
        return np.array([i for i in range(self.I) if i not in lasts], dtype=np.intp)

    @cached_property
    def rounds(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.bool_]], ...]:
        """The intervals that are simulated side by side, and which of them the next one follows.

        First the first ones of all segments, then the second ones of those that have one, ...
        """
        counts = np.array([segment.intervals for segment in self.segments])
        firsts = np.array(self.firsts)
        longest = int(counts.max())
        return tuple((firsts[counts > i] + i, counts[counts > i] > i + 1) for i in range(longest))

    @cached_property
    def data(self) -> IntervalData:
        """Inputs, measured outputs and block lengths of all intervals, padded."""
        B, n = self.functions.blocks, self.n
        w, h, y = [], [], []
        for segment in self.segments:
            pad = segment.intervals * B - segment.K
            w.append(np.pad(segment.w, ((0, 0), (0, pad * n)), mode="edge"))
            y.append(np.pad(segment.y, ((0, 0), (0, pad)), mode="edge"))
            h.append(np.repeat([self.model.stepping.dt, 0.0], [segment.K, pad]))
        lengths = np.concatenate(h)
        # In the order in which compiled functions read them: no call copies them.
        w_all, y_all = (np.asfortranarray(np.hstack(part)) for part in (w, y))
        return IntervalData(w_all, lengths[None], y_all, lengths > 0)

    @cached_property
    def memory(self) -> ResultMemory:
        """Memory that linearisations use in turn."""
        return ResultMemory()

    def of_intervals(self, at: NDArray[np.intp], data: FloatArray) -> FloatArray:
        """Return the columns of data (..., I k) that belong to some intervals, side by side."""
        return data.reshape(len(data), self.I, -1)[:, at].reshape(len(data), -1)

    @cached_property
    def y(self) -> FloatArray:
        """Measured mean outputs, shape (ny, n_blocks)."""
        return np.hstack([segment.y for segment in self.segments])

    @property
    def free_scales(self) -> FloatArray:
        """Scales of the free parameters, shape (n_free,)."""
        return self.parameters.scales[self.parameters.free_mask]

    def start(self) -> Unknowns:
        """Return the measured start: states from smoothed data."""
        return Unknowns(self.parameters.values, np.hstack([s.x for s in self.segments]))

    def anchor_residuals(self, theta: FloatArray) -> FloatArray:
        """Return the map's residuals over its noise; empty without an anchor."""
        if self.anchor is None:
            return np.zeros(0)
        return self.anchor(self.anchor.coefficients(self.parameters, theta))

    def cost(self, theta: FloatArray, m: FloatArray, sigma: FloatArray) -> float:
        """Return ½ Σ (residual/σ)² over all samples and the flow map, m being mean outputs."""
        g = self.anchor_residuals(theta)
        with np.errstate(over="ignore"):  # a trial may run away: then it costs infinitely much
            e = (self.y - m) / sigma[:, None]
            return 0.5 * float(self.n * np.sum(e**2) + np.sum(g**2))


def evaluate_intervals(problem: Problem, point: Unknowns) -> tuple[FloatArray, FloatArray]:
    """Return ends (nx, I) of all intervals and mean outputs (ny, n_blocks)."""
    data = problem.data
    theta = np.tile(point.theta[:, None], problem.I)
    ends, m = call_side_by_side(problem.functions.value, point.x, data.w, theta, data.h)
    return ends, data.without_padding(m)


def shoot_segments(
    problem: Problem, theta: FloatArray, x_0: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Simulate every segment from its initial state, all segments side by side.

    Parameters
    ----------
    theta : (n,) array
        All parameters.
    x_0 : (nx, segments) array
        Initial states.

    Returns
    -------
    tuple
        States (nx, I) where the intervals begin, and mean outputs (ny, n_blocks).
    """

    def run(at: NDArray[np.intp], x: FloatArray) -> tuple[FloatArray, ...]:
        w, h = (problem.of_intervals(at, part) for part in (problem.data.w, problem.data.h))
        tiled = np.tile(theta[:, None], at.size)
        return call_side_by_side(problem.functions.value, x, w, tiled, h)

    x, (_, m) = shoot_in_rounds(problem, x_0, run)
    return x, problem.data.without_padding(m)


def shoot_in_rounds(
    problem: Problem,
    x_0: FloatArray,
    run: Callable[[NDArray[np.intp], FloatArray], Sequence[FloatArray]],
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Run every segment from its initial state, interval after interval; see `Problem.rounds`.

    Parameters
    ----------
    x_0 : (nx, segments) array
        Initial states.
    run : callable
        ``run(at, x)`` returns what becomes of intervals that begin at states x (nx, ...), side by
        side, the states at their ends first.

    Returns
    -------
    tuple
        States (nx, I) where the intervals begin, and what `run` has returned, of all intervals.
    """
    x = np.zeros((problem.model.nx, problem.I))
    x[:, list(problem.firsts)] = x_0
    results: list[FloatArray] = []
    for at, followed in problem.rounds:
        parts = [part.reshape(len(part), at.size, -1) for part in run(at, x[:, at])]
        if not results:
            results = [np.zeros((len(part), problem.I, part.shape[2])) for part in parts]
        for whole, part in zip(results, parts, strict=True):
            whole[:, at] = part
        x[:, at[followed] + 1] = parts[0][:, followed, 0]
    return x, tuple(whole.reshape(len(whole), -1) for whole in results)
