"""Small axes of known truth and records made with the package's own equations.

Records are integrated with many more Runge-Kutta steps than a fit takes, so that the fit's own
stepping is under test too.
"""

from dataclasses import replace

import numpy as np

from pneumo_casadi.data import (
    Bench,
    ForceBench,
    InputHold,
    NestedController,
    ProportionalController,
    Recording,
    SensorNoise,
)
from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.model.integration import held_inputs, step_function
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.model.machine_code.compilation import compile_functions
from pneumo_casadi.model.servosystem import ForceAxis, Servosystem
from pneumo_casadi.model.stepping import Stepping
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve import FlowMap, fit_polynomials, fit_spline, orifice_flow

FS = 1e3
P_SUPPLY, P_EXT = 7e5, 1e5
NOISE = SensorNoise(p=150.0, x=1.5e-5)
BENCH = Bench(
    FS,
    8.75e-4,
    6.03e-4,
    0.5,
    P_EXT,
    P_SUPPLY,
    293.15,
    287.0,
    ProportionalController(4.0, 3.0),
    {"M_kg": 17.0},
    NOISE,
)
FORCE_BENCH = ForceBench(
    FS, 0.5, NestedController(30.0, 60.0, 1.0, 60.0), {"M_kg": 20.0}, SensorNoise(0.0, 2e-6)
)
TRUE = {
    "X_s1": 3.49e-9,
    "X_s2": 9.95e-9,
    "X_s3": 1.04e-8,
    "X_s4": 1.78e-9,
    "X_s5": 7.00e-9,
    "X_s6": 7.17e-9,
    "M": 16.9,
    "f_v": 11.0,
    "F_c_plus": 10.3,
    "F_c_minus": 23.8,
    "v_s": 5e-3,
}
FORCE_TRUE = {"M": 18.0, "f_v": 25.0, "F_c_plus": 12.0, "F_c_minus": 17.0, "v_s": 5e-3}
MAP_NOISE = 8e-6


class ValveLag(Effect):
    """A spool of first order on both valves: an effect with as few states as can be.

    Spool over command is (1 + τ₀ s) / (1 + (τ₀ + τ) s) with τ₀ = 1 ms.
    """

    name = "valve_lag"
    parameters = (Parameter("tau", 0.0, "s", lower=0.0, upper=0.2, scale=5e-3, null=0.0),)
    states = (State("u_P", "V"), State("u_N", "V"))
    tau_0 = 1e-3

    def rest(self, entering, at):
        return {"u_P": entering["spool"].P, "u_N": entering["spool"].N}

    def rates(self, entering, at):
        u, total = entering["spool"], self.tau_0 + at["tau"]
        return {"u_P": (u.P - at["u_P"]) / total, "u_N": (u.N - at["u_N"]) / total}

    def spool(self, u, at):
        share = at["tau"] / (self.tau_0 + at["tau"])
        return Pair(u.P - share * (u.P - at["u_P"]), u.N - share * (u.N - at["u_N"]))


def _orifices():
    u, p = (
        a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 13), np.linspace(P_EXT, P_SUPPLY, 13))
    )
    inlet = orifice_flow(1.0, 0.3, 0.5, P_SUPPLY, p) * (3e-9 * np.maximum(u, 0) + 2e-10)
    outlet = orifice_flow(1.0, 0.3, 0.5, p, P_EXT) * (4e-9 * np.maximum(-u, 0) + 2e-10)
    return u, p, inlet - outlet


def smooth_map():
    """A map without noise."""
    return FlowMap(*_orifices(), P_SUPPLY, P_EXT, source="made")


def true_flow(degrees=(3, 3, 3)):
    """Polynomials that count as the truth of a valve."""
    return fit_polynomials(smooth_map(), degrees)


def measured_map(seed, degrees=(3, 3, 3)):
    """Meter the true polynomials with noise."""
    u, p, _ = _orifices()
    q_m = true_flow(degrees)(u, p) + MAP_NOISE * np.random.default_rng(seed).standard_normal(u.size)
    return FlowMap(u, p, q_m, P_SUPPLY, P_EXT, source="made")


def true_axis(*effects, flow=None):
    return Servosystem(BENCH, flow or true_flow(), effects).with_parameters(TRUE)


def supplied_axis(*effects):
    """The same with a recorded supply pressure: an input that no controller sets."""
    axis = true_axis(*effects)
    return replace(axis, bench=replace(axis.bench, signals={"p_supply"}))


def spline_axis(*effects):
    return true_axis(*effects, flow=fit_spline(smooth_map(), segments_p=6))


def true_force_axis(*effects):
    return ForceAxis(FORCE_BENCH, effects).with_parameters(FORCE_TRUE)


def states(axis, rng):
    """A random state (nx,) and input (nu,) within the axis' reach."""
    motion = [rng.uniform(-0.15, 0.15), rng.uniform(-0.5, 0.5)]
    if not axis.kind.chambers:
        return np.array(motion), rng.uniform(-100, 100, 1)
    u = rng.uniform(-2, 2, 2)
    extra = [u[0] + 0.3, u[1] - 0.2][: len(axis.states) - 4]
    return np.array([*rng.uniform(2e5, 6e5, 2), *motion, *extra]), u


def steps(axis, u, x_0, hold=InputHold.ZERO, dt=1 / FS, substeps=20):
    """Integrate finely; returns (nx, N) states at the samples of u (N, nu)."""
    (step,) = compile_functions([step_function(axis, Stepping(dt, hold, substeps))])
    w = held_inputs(axis, u, hold)
    chain = step.mapaccum(w.shape[1])
    after = chain(x_0, w, np.tile(axis.parameters.values[:, None], (1, w.shape[1])))
    return np.hstack([np.reshape(x_0, (-1, 1)), after.full()])


def reference(t, seed=0):
    phase = 0.7 * seed
    chirp = 0.07 * np.sin(2 * np.pi * (0.8 + 0.5 * t) * t + phase)
    return chirp + 0.05 * np.sign(np.sin(2 * np.pi * 0.9 * t + phase))


def controlled(axis, N, seed=0, substeps=20):
    """Close the loop on the true position; returns u (N, nu) and x (nx, N)."""
    (step,) = compile_functions([step_function(axis, Stepping(1 / FS, InputHold.ZERO, substeps))])
    theta, law = axis.parameters.values, axis.bench.controller
    x_ref = reference(np.arange(N) / FS, seed)
    if not axis.kind.chambers:
        x = np.array([0.0, 0.0])
    else:
        x = np.array([3.5e5, 4.7e5, 0.0, 0.0, *([0.0] * (len(axis.states) - 4))])
    at = axis.states.index("x")
    all_x, all_u = [], []
    for k in range(N):
        u = law.command(x_ref[k], x[at], x[at + 1])
        all_x.append(x)
        all_u.append(u)
        x = step(x, u, theta).full().ravel()
    return np.array(all_u), np.array(all_x).T


def recorded(axis, u, x, seed=0, noise=1.0, hold=InputHold.ZERO, name="made"):
    """Sample a trajectory with sensor noise."""
    rng = np.random.default_rng(seed)
    theta = np.tile(axis.parameters.values[:, None], (1, len(u)))
    y = axis.output.map(len(u))(x, u.T, theta).full()
    sizes = [getattr(axis.bench.noise, channel[0]) for channel in axis.outputs]
    y = y + noise * np.array(sizes)[:, None] * rng.standard_normal(y.shape)
    channels = dict(zip(axis.outputs, y, strict=True)) | dict(zip(axis.inputs, u.T, strict=True))
    return Recording(np.arange(len(u)) / FS, channels, name, "made", hold)


def perturbed(axis, factors, names=None):
    """The axis started elsewhere: parameters times factors."""
    names = names or list(factors)
    return axis.with_parameters({n: axis.parameters[n].value * factors[n] for n in names})


def free_only(axis, *names):
    return axis.with_parameters(axis.parameters.fix_all().release(*names))


def with_noise(axis, noise):
    return replace(axis, bench=replace(axis.bench, noise=noise))
