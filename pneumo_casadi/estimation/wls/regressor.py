"""From a model and recordings to the linear system of eq. 13."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.wls.evaluation import evaluate_regressor
from pneumo_casadi.estimation.wls.flow_map_error import flow_map_error
from pneumo_casadi.estimation.wls.linear_system import LinearSystem
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.signals import (
    FilterPlan,
    InputPairing,
    decimated_rows,
    filter_recording,
    parallel_decimate,
)

#: Threshold of the velocity in standard deviations of its noise after filtering ...
NOISE_MULTIPLE = 5.0
#: ... and at least this share of the largest velocity, for sensors that show no noise.
LEAST_SHARE = 2e-3
#: Length of the edge of a stretch of motion, in decimated rows: a sharp one would fold noise
#: from above the low-pass into the rows.
EDGE = 1.0
#: Zeros that continue a windowed record at both ends, in decimated rows: for the parallel filter to
#: die away.
TAIL = 8
#: A row counts if more than this share of its low-pass does.
LEAST_COUNTED = 0.5


class LinearModel(Protocol):
    """What regression asks of a model; `Servosystem` and `ForceAxis` offer it."""

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the balances."""

    @property
    def motion_states(self) -> tuple[str, ...]:
        """Names of the states that are measured or differentiated."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the input channels."""

    @property
    def parameters(self) -> Parameters:
        """All parameters."""

    @property
    def regressor_names(self) -> tuple[str, ...]:
        """Parameters in which the balances are linear."""

    def regressor(self, names: Sequence[str] | None = None) -> Any:
        """Return the CasADi function (x, dx, u) -> (Y, W)."""


class StickPhases(Enum):
    """What to do with samples at which the axis hardly moves, in the force balance.

    At standstill static friction takes any value between -F_c⁻ and F_c⁺, but the regressor of
    eq. 7 has it at one of them, by the sign of what is mostly noise: such rows contradict the
    rest and ruin f_v and F_c.
    """

    OMIT = "omit"
    """Multiply both sides of the balance by zero at rest, before the low-pass.

    What holds for Y = W X then holds for the low-pass of both sides, whatever its reach. The ends
    of the record are treated alike, in all balances.
    """
    KEEP = "keep"
    """Keep all samples alike, those at the ends of the record included."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Y and W of one record, after the parallel filter.

    Parameters
    ----------
    t : (m,) array
        Instants of the decimated rows [s].
    Y : (ne, m) array
        Measured side of each equation.
    W : (ne, m, n) array
        Regressor of each equation.
    flow_error : (ne, m, k) array
        Change of Y by each error of the flow map, of standard deviation one (`flow_map_error`).
    share : (ne, m) array
        Share of each row's low-pass that counts (`_windows`), but for the filter's ripple.
    stick : StickPhases
        How samples at rest were treated.
    names, equations : tuple of str
        Parameters and equations.
    plan : FilterPlan
        What was done to the measurements.
    velocity_threshold : float
        Below it a sample counts as at rest [m/s].
    source : str
        Name of the recording.
    dropped : tuple of int
        Raw samples dropped at the front and back.
    """

    t: FloatArray
    Y: FloatArray
    W: FloatArray
    flow_error: FloatArray
    share: FloatArray
    stick: StickPhases
    names: tuple[str, ...]
    equations: tuple[str, ...]
    plan: FilterPlan
    velocity_threshold: float
    source: str
    dropped: tuple[int, int]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Rows that count, (ne, m)."""
        return self.share > LEAST_COUNTED

    def system(self) -> LinearSystem:
        """Return the rows that count as a linear system."""
        ne, m = self.Y.shape
        equation = np.repeat(np.arange(ne), m)
        instant = np.tile(np.arange(m), ne)
        used = self.used.ravel()
        return LinearSystem(
            Y=self.Y.ravel()[used],
            W=self.W.reshape(ne * m, -1)[used],
            names=self.names,
            equations=self.equations,
            equation=equation[used],
            instant=instant[used],
            shared_error=self.flow_error.reshape(ne * m, -1)[used],
        )


def observe(
    model: LinearModel,
    recording: Recording,
    names: Sequence[str],
    plan: FilterPlan,
    *,
    stick: StickPhases = StickPhases.OMIT,
    velocity_threshold: float | None = None,
    pairing: InputPairing | None = None,
) -> Observation:
    """Sample the model's regressor along a recording and filter it in parallel.

    Parameters
    ----------
    model : LinearModel
        Supplies the regressor, derived from its balances.
    recording : Recording
        With the model's inputs, the position and, for chambers, the pressures.
    names : sequence of str
        Parameters to estimate.
    plan : FilterPlan
        Both filters.
    stick : StickPhases, optional
        Treatment of samples at rest.
    velocity_threshold : float, optional
        Below it a sample counts as at rest [m/s]; by default 5 standard deviations of the
        velocity's noise after filtering, so that the sign of a moving sample is certain.
    pairing : InputPairing, optional
        By default what the recording's input hold asks for.

    Returns
    -------
    Observation
    """
    filtered = filter_recording(recording, plan, pairing)
    Y, W = evaluate_regressor(model, filtered, names)
    v = np.abs(filtered.states["v"])
    if velocity_threshold is None:
        velocity_threshold = max(
            NOISE_MULTIPLE * filtered.velocity_noise, LEAST_SHARE * float(v.max())
        )
    windows = None
    if stick is StickPhases.OMIT:
        windows = _windows(model.equations, v >= velocity_threshold, plan.factor)
    low = _low_passed(Y, W, plan, windows)
    share = np.ones(low.shape[:2]) if windows is None else _decimated(windows.T, plan).T
    return Observation(
        t=filtered.t[decimated_rows(v.size, plan.factor)],
        Y=low[:, :, 0],
        W=low[:, :, 1:],
        flow_error=flow_map_error(model, filtered, plan),
        share=share,
        stick=stick,
        names=tuple(names),
        equations=model.equations,
        plan=plan,
        velocity_threshold=velocity_threshold,
        source=filtered.name,
        dropped=filtered.dropped,
    )


def _windows(equations: Sequence[str], moving: NDArray[np.bool_], factor: int) -> FloatArray:
    """Return what both sides of each balance are multiplied with before the low-pass, (ne, N).

    It is zero at the ends of the record, of the force balance at rest as well. Most noise of an
    acceleration cancels between neighbours when a low-pass averages it, but not where the record
    breaks off: rows there had most of the error of f_v and F_c.
    """
    everywhere = _smooth_edged(np.ones(moving.size, dtype=bool), factor)
    in_motion = _smooth_edged(moving, factor)
    return np.stack([in_motion if name == "force" else everywhere for name in equations])


def _smooth_edged(inside: NDArray[np.bool_], factor: int) -> FloatArray:
    """Return a window over time, zero outside stretches, with edges of one decimated row."""
    if factor == 1:
        return inside.astype(float)
    length = 2 * max(1, round(EDGE * factor / 2)) + 1
    core = ndimage.minimum_filter1d(inside.astype(float), length, mode="constant")
    edge = np.hanning(length + 2)[1:-1]
    return np.asarray(ndimage.convolve1d(core, edge / edge.sum(), mode="constant"))


def _low_passed(
    Y: FloatArray, W: FloatArray, plan: FilterPlan, windows: FloatArray | None
) -> FloatArray:
    """Return Y and the columns of W, windowed, after the parallel filter, shape (ne, m, n + 1)."""
    ne, N, n = W.shape
    low = np.zeros((ne, decimated_rows(N, plan.factor).size, n + 1))
    for e in range(ne):
        # Most columns belong to another equation and are zero throughout.
        used = np.flatnonzero(W[e].any(axis=0))
        columns = np.column_stack([Y[e], W[e][:, used]])
        low[e][:, [0, *(used + 1)]] = (
            parallel_decimate(columns, plan.factor, plan.decimation)
            if windows is None
            else _decimated(columns * windows[e][:, None], plan)
        )
    return low


def _decimated(windowed: FloatArray, plan: FilterPlan) -> FloatArray:
    """Return columns that vanish at both ends after the parallel filter, continued by zeros."""
    continued = np.pad(windowed, ((TAIL * plan.factor,) * 2, (0, 0)))
    return parallel_decimate(continued, plan.factor, plan.decimation)[TAIL:-TAIL]
