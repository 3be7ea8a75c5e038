"""From a model and recordings to the linear system of eq. 13."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

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
#: Reach of a row's low-pass to each side, in decimated rows: its edge is at 0.8 times the new
#: Nyquist frequency, so the main lobe ends after 1.25 rows, and it rings on.
REACH = 1.5


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
    """Leave out every decimated row to whose low-pass a slow sample contributed."""
    WEIGHT = "weight"
    """Weight a row with the square of the share of moving samples in its low-pass."""
    KEEP = "keep"
    """Keep all rows alike, as for an axis that never rests."""


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
    moving : (m,) array
        Share of the samples in a row's low-pass at which the axis moved, from 0 to 1.
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
    moving: FloatArray
    names: tuple[str, ...]
    equations: tuple[str, ...]
    plan: FilterPlan
    velocity_threshold: float
    source: str
    dropped: tuple[int, int]

    def weights(self, stick: StickPhases) -> FloatArray:
        """Return the weight of each row of each equation, shape (ne, m)."""
        weight = np.ones_like(self.Y)
        force = self.equations.index("force")
        if stick is StickPhases.OMIT:
            weight[force] = self.moving >= 1.0
        elif stick is StickPhases.WEIGHT:
            weight[force] = self.moving**2
        return weight

    def system(self, stick: StickPhases) -> LinearSystem:
        """Return the rows that count as a linear system."""
        weight = self.weights(stick)
        ne, m = self.Y.shape
        equation = np.repeat(np.arange(ne), m)
        instant = np.tile(np.arange(m), ne)
        used = weight.ravel() > 0
        return LinearSystem(
            Y=self.Y.ravel()[used],
            W=self.W.reshape(ne * m, -1)[used],
            names=self.names,
            equations=self.equations,
            equation=equation[used],
            instant=instant[used],
            weight=weight.ravel()[used],
            shared_error=self.flow_error.reshape(ne * m, -1)[used],
        )


def observe(
    model: LinearModel,
    recording: Recording,
    names: Sequence[str],
    plan: FilterPlan,
    *,
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
    ne, N, n = W.shape
    rows = decimated_rows(N, plan.factor)
    low = np.zeros((ne, rows.size, n + 1))
    for e in range(ne):
        # Most columns belong to another equation and are zero throughout.
        used = np.flatnonzero(W[e].any(axis=0))
        columns = np.column_stack([Y[e], W[e][:, used]])
        low[e][:, [0, *(used + 1)]] = parallel_decimate(columns, plan.factor, plan.decimation)
    v = np.abs(filtered.states["v"])
    if velocity_threshold is None:
        velocity_threshold = max(
            NOISE_MULTIPLE * filtered.velocity_noise, LEAST_SHARE * float(v.max())
        )
    return Observation(
        t=filtered.t[rows],
        Y=low[:, :, 0],
        W=low[:, :, 1:],
        flow_error=flow_map_error(model, filtered, plan),
        moving=_moving_share(v >= velocity_threshold, plan.factor)[rows],
        names=tuple(names),
        equations=model.equations,
        plan=plan,
        velocity_threshold=velocity_threshold,
        source=filtered.name,
        dropped=filtered.dropped,
    )


def _moving_share(moving: NDArray[np.bool_], factor: int) -> FloatArray:
    """Return the share of moving samples among those that a row's low-pass draws on."""
    if factor == 1:
        return moving.astype(float)
    reach = round(REACH * factor)
    window = 2 * reach + 1
    padded = np.pad(moving.astype(float), reach, mode="edge")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return np.asarray((total[window:] - total[:-window]) / window)
