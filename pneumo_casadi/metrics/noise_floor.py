"""Noise floor: the error that the sensors' noise alone leaves with a perfect model.

Of a simulated output it is the standard deviation of the sensor's noise, as the bench states it or
as the record shows it (`output_noise`). Of a balance's residual it is that noise after the filters,
derivatives and averaging that the residual has gone through (`balance_noise`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.estimation.statistics import stated_or_estimated_noise
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Samples of the noise realisation that `sampled_row_gains` filters.
REALISATION = 4096


def output_noise(axis: Axis, records: Sequence[Recording], output: str) -> float:
    """Return the noise floor of a simulated output, in its unit; see `stated_or_estimated_noise`.

    Parameters
    ----------
    axis : Axis
        Axis with its bench, which may state the noise of its sensors.
    records : sequence of Recording
        Records from which the noise is estimated otherwise.
    output : str
        Name of the output, for example ``"p_P"``.
    """
    return stated_or_estimated_noise(axis.bench, records, output)


def signal_std(records: Sequence[Recording], channel: str) -> float:
    """Return the standard deviation of a channel about its mean in each record, in its unit.

    Parameters
    ----------
    records : sequence of Recording
        Records, pooled.
    channel : str
        Name of the channel.
    """
    parts = [record[channel] - record[channel].mean() for record in records]
    return float(np.std(np.concatenate(parts)))


@dataclass(frozen=True, slots=True)
class RowGains:
    """Standard deviations that white noise of unit variance leaves in a row of the residuals.

    Parameters
    ----------
    level, rate, acceleration : float
        Of the smoothed signal [1], of its first [1/s] and of its second derivative [1/s²].
    """

    level: float
    rate: float
    acceleration: float


def sampled_row_gains(data: SmoothedMotion) -> RowGains:
    """Return the gains as one realisation of noise shows them.

    Thresholds of the verdicts are multiples of a floor computed in this way, which scatters by
    some per cent about that of `exact_row_gains`; it stays until they are calibrated anew.
    """
    N = min(data.N, REALISATION)
    windows = data.weak[: max(1, data.m * N // data.N - 4), :N]
    level = data.smooth(np.random.default_rng(0).normal(size=N))
    rate = data.derivative(level)
    acceleration = data.derivative(rate)
    return RowGains(*(float(np.std(windows @ part)) for part in (level, rate, acceleration)))


def exact_row_gains(data: SmoothedMotion) -> RowGains:
    """Return the gains from the impulse response of filter, derivative and windows."""
    impulse = np.zeros(data.N)
    impulse[data.N // 2] = 1.0
    level = data.smooth(impulse)
    rate = data.derivative(level)
    acceleration = data.derivative(rate)
    return RowGains(
        *(
            float(np.sqrt(np.sum(data.averaged(part) ** 2) * data.stride))
            for part in (level, rate, acceleration)
        )
    )


def balance_noise(
    data: SmoothedMotion,
    gains: RowGains,
    mass: float,
    areas: Sequence[float] = (),
    velocity_slopes: Sequence[float] = (),
) -> FloatArray:
    """Return the noise floor of each balance.

    Parameters
    ----------
    data : SmoothedMotion
        Record with the noise of its sensors: the pressures, if any, and the position.
    gains : RowGains
        From `sampled_row_gains` or `exact_row_gains`.
    mass : float
        Factor on the acceleration: the mass [kg]; 1 where the force balance is per unit of mass.
    areas : sequence of float, optional
        Piston areas [m²]: with them the force balance includes the noise of the pressures. The
        floor that verdicts use includes it; the one that locates unknown inputs leaves it out,
        because there the pressures are states that are estimated too.
    velocity_slopes : sequence of float, optional
        Root mean square of ∂ṗ/∂v [Pa/m] of each chamber: with them the mass flow balances include
        the noise of the velocity. The floor that locates unknown inputs includes it; the one that
        verdicts use leaves it out, because its thresholds were set without.

    Returns
    -------
    (ne,) array
        Standard deviations, ṗ in Pa/s and the force in N, or in m/s² per unit of mass.
    """
    *pressures, x = data.noise
    slopes = velocity_slopes or [0.0] * len(pressures)
    flows = [
        np.hypot(p, slope * x) * gains.rate for p, slope in zip(pressures, slopes, strict=True)
    ]
    loads = [S * p * gains.level for S, p in zip(areas, pressures, strict=bool(areas))]
    force = np.sqrt((mass * gains.acceleration * x) ** 2 + sum(load**2 for load in loads))
    return np.array([*flows, float(force)])
