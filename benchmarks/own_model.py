"""Records of the package's own model, the axis of Table 1, for benchmarks of its estimators."""

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.signal import chirp, lfilter, square

from pneumo_casadi.data import Case, InputHold, Recording, read_case
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.model.simulation import simulate_closed_loop
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.report.tables import paper
from pneumo_casadi.valve import FlowMap, fit_polynomials, read_flow_map

RATE = 1000.0
DURATION = 4.0
NOISE_P, NOISE_X = 150.0, 1.5e-5
#: A recorded disturbance of the commands: pulses of this height [V] and length [s] ...
PULSE, PULSE_LENGTH = 0.3, 0.05
#: ... so many a second at most, of either sign.
PULSES = 5
#: Noise of one metered flow, as a share of the largest [1].
NOISE_MAP = 0.002
#: Width of the smoothed friction, in data and fit alike [m/s].
V_S = 1e-3
TABLE_1 = {name: value for name, (value, _) in paper.TABLE_1.items()}
RATIOS = {"k_P": ("X_s3", "X_s2"), "k_N": ("X_s6", "X_s5")}


@dataclass(frozen=True)
class Truth:
    """The axis that makes the data, and where its flow map is metered."""

    axis: Axis
    u: FloatArray
    p: FloatArray
    x_0: FloatArray


def truth(v_s: float = V_S) -> Truth:
    """Return the axis of Table 1 with the polynomials of the embedded flow map."""
    case = read_case(Path(str(resources.files("pneumo_casadi"))) / "data" / "examples" / "table1")
    table = read_flow_map(case.flow_map_path)
    axis = Servosystem(case.bench, fit_polynomials(table)).with_parameters({**TABLE_1, "v_s": v_s})
    record = case.identify[0]
    x_0 = np.array([record["p_P"][:50].mean(), record["p_N"][:50].mean(), 0.0, 0.0])
    return Truth(axis, table.u, table.p, x_0)


def true_values() -> dict[str, float]:
    """Return the true parameters, and k_P and k_N that follow from them."""
    values = truth().axis.parameters.as_dict()
    return values | {k: values[upper] / values[lower] for k, (upper, lower) in RATIOS.items()}


def reference(duration: float = DURATION, rate: float = RATE) -> FloatArray:
    """Return a chirp of 0-2 Hz, then squares of two amplitudes [m], over and over every 4 s."""
    t = np.arange(round(duration * rate)) / rate
    phase = t % DURATION
    half = DURATION / 2
    sweep = 0.12 * chirp(phase, 0.0, half, 2.0, phi=-90)
    steps = np.where(phase < 1.5 * half, 0.06, 0.13) * square(2 * np.pi * 1.0 * t)
    return np.where(phase < half, sweep, steps)


def noise(size: float, N: int, rng: np.random.Generator, correlation: float = 0.0) -> FloatArray:
    """Return Gaussian noise of a standard deviation; neighbours correlate by `correlation`."""
    white = rng.normal(0.0, size, N)
    if correlation == 0.0:
        return white
    white[1:] *= np.sqrt(1 - correlation**2)
    coloured: FloatArray = lfilter([1.0], [1.0, -correlation], white)
    return coloured


def disturbance(N: int, rate: float, rng: np.random.Generator) -> FloatArray:
    """Return pulses that both commands take on opposite signs [V], shape (N, 2)."""
    slot, length = round(rate / PULSES), round(rate * PULSE_LENGTH)
    signs = rng.integers(-1, 2, -(-N // slot))
    pulses = PULSE * np.repeat(signs, slot)[:N] * (np.arange(N) % slot < length)
    return np.stack([pulses, -pulses], axis=1)


def record_with_noise(
    true: Truth,
    rng: np.random.Generator,
    duration: float = DURATION,
    rate: float = RATE,
    correlation: float = 0.0,
    disturbed: bool = False,
) -> Recording:
    """Simulate one record; the controller reads the noisy position.

    With `disturbed` pulses are added to what it sets; the commands are recorded with them.
    """
    axis, x_ref = true.axis, reference(duration, rate)
    e = noise(NOISE_X, x_ref.size, rng, correlation)
    gain = axis.bench.controller.gain
    through_loop = np.stack([-gain * e, gain * e], axis=1)
    if disturbed:
        through_loop += disturbance(x_ref.size, rate, rng)
    run = simulate_closed_loop(axis, x_ref, 1 / rate, true.x_0, disturbance=through_loop)
    channels = {
        "u_P": run["u_P"],
        "u_N": run["u_N"],
        "p_P": run["p_P"] + noise(NOISE_P, x_ref.size, rng, correlation),
        "p_N": run["p_N"] + noise(NOISE_P, x_ref.size, rng, correlation),
        "x": run["x"] + e,
        "x_ref": x_ref,
    }
    return Recording(run.t, channels, "own model", "simulated", InputHold.ZERO)


def metered(true: Truth, rng: np.random.Generator, share: float = NOISE_MAP) -> FlowMap:
    """Meter the flow of the true valve, with noise as a share of the largest flow."""
    exact = true.axis.flow(true.u, true.p)
    q_m = exact + rng.normal(0.0, share * np.abs(exact).max(), exact.size)
    bench = true.axis.bench
    return FlowMap(true.u, true.p, q_m, bench.p_supply, bench.p_ext)


def nominal(true: Truth, table: FlowMap, v_s: float = V_S) -> Axis:
    """Return the axis as one knows it before a fit: geometry and the fitted map."""
    return Servosystem(true.axis.bench, fit_polynomials(table)).with_parameters({"v_s": v_s})


def metered_case(
    clean: Truth,
    true: Truth,
    lengths: tuple[float, float],
    folder: Path,
    rng: np.random.Generator,
    correlation: float = 0.0,
    disturbed: bool = False,
) -> Case:
    """Return a case of two records [s], to identify on and held out, whose bench knows no effect.

    The flow map is that of `clean`, the axis that has none either, and stands in `folder`.
    """
    identify, validate = (
        replace(
            record_with_noise(true, rng, length, correlation=correlation, disturbed=disturbed),
            name=f"{length:g} s",
        )
        for length in lengths
    )
    table = metered(clean, rng)
    path = folder / "flow_map.csv"
    columns = np.column_stack([table.u, table.p, table.q_m])
    np.savetxt(path, columns, "%.10g", ",", header="u_V,p_Pa,q_m_kg_per_s", comments="")
    return Case(folder, clean.axis.bench, (identify,), (validate,), path)
