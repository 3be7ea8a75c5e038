"""The problems of the comparison, made from records of the package's own model."""

import pickle
import warnings
from dataclasses import dataclass, replace

import numpy as np
import own_model
from numpy.polynomial import Chebyshev, Polynomial

from peer_tools.estimation import Estimation, FlowPoints
from peer_tools.judging import MECHANICAL
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.estimation.output_error.shooting.segments import measured_states
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.valve.polynomials import parts

SEED = 20050704


@dataclass(frozen=True)
class Kind:
    """One problem: a record of `duration` [s] at `rate` [Hz], its windows and what is free."""

    title: str
    duration: float
    rate: float = own_model.RATE
    windows: int = 1
    flow_free: bool = False
    steps: int = 2

    def make(self, quick: bool = False) -> Estimation:
        """Return the problem; half a second a window at most where it is `quick`."""
        kind = replace(self, duration=0.5, windows=min(self.windows, 2)) if quick else self
        return _make(kind)


KINDS = {
    "common": Kind("4 s at 1 kHz, 10 parameters", own_model.DURATION),
    "windows": Kind("40 windows of 0.5 s at 1 kHz, 10 parameters", 20.0, windows=40),
    "long": Kind("60 s at 5 kHz, 31 parameters", 60.0, 5000.0, flow_free=True, steps=1),
}


def _make(kind: Kind) -> Estimation:
    true = own_model.truth()
    rng = np.random.default_rng([SEED, 0])
    record = own_model.record_with_noise(true, rng, kind.duration, kind.rate)
    noise = SensorNoise(p=own_model.NOISE_P, x=own_model.NOISE_X)
    flow_map, points = None, None
    axis = true.axis
    if kind.flow_free:
        flow_map = own_model.metered(true, rng)
        axis = own_model.nominal(true, flow_map)
        points = FlowPoints(flow_map.u, flow_map.p, flow_map.q_m, axis.flow.sigma)
    else:
        axis = axis.with_parameters(axis.parameters.fix(*axis.flow.parameters.names))
    axis = replace(axis, bench=replace(axis.bench, noise=noise))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a clipped start is no news here
        axis = axis.started_at(fit_wls(axis, [record]).parameters)
    free = axis.parameters.free_names
    names = tuple(own_model.TABLE_1) + tuple(n for n in free if n not in own_model.TABLE_1)
    start = axis.parameters.select(names).values
    bench = axis.bench
    return Estimation(
        names,
        start,
        true.axis.parameters.select(names).values,
        record.dt,
        record.stack(axis.inputs),
        record.stack(axis.outputs),
        measured_states(axis, record, axis.parameters).T,
        np.array([own_model.NOISE_P, own_model.NOISE_P, own_model.NOISE_X]),
        *_powers(axis),
        axis.flow.p_range,
        {"S_P": bench.S_P, "S_N": bench.S_N, "p_ext": bench.p_ext, "v_s": own_model.V_S},
        pickle.dumps((axis, record, flow_map)),
        kind.windows,
        kind.steps,
        _scales(axis, names, start),
        points,
    )


def _powers(axis: Axis) -> list[np.ndarray]:
    """Return φ, ψ⁺ and ψ⁻ at the start in powers of the scaled pressure."""
    flow = axis.flow.parameters
    values = axis.parameters.select(flow.names).values
    cuts = parts(axis.flow.degrees).values()
    return [Chebyshev(values[part]).convert(kind=Polynomial).coef for part in cuts]


def _scales(axis: Axis, names: tuple[str, ...], start: np.ndarray) -> np.ndarray:
    """Return sizes of the parameters; a polynomial's coefficients have that of its largest."""
    scales = np.abs(start)
    if len(names) > MECHANICAL:
        for part in parts(axis.flow.degrees).values():
            own = slice(MECHANICAL + part.start, MECHANICAL + part.stop)
            scales[own] = scales[own].max()
    return scales
