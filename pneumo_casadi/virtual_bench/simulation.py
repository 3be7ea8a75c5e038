"""One run of the bench: from an excitation to what the sensors show, and the true states."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, radians, sin

import numpy as np

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.effect import VirtualEffect, longest_step
from pneumo_casadi.virtual_bench.experiment import Excitation, Experiment
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.kernels.motion import STANDARD_GRAVITY
from pneumo_casadi.virtual_bench.kernels.run import run
from pneumo_casadi.virtual_bench.kernels.valve import meter
from pneumo_casadi.virtual_bench.parameters import kernel_parameters

#: Time in closed loop on the first reference before the record begins [s].
SETTLING = 0.5
#: Scatter of a metered flow, of the greatest [1], and the grid of the metering.
METERING_NOISE = 1e-3
METERED_U, METERED_P, METERED_REACH = 41, 25, 3.0
#: Farthest from its place that jitter takes an instant, in steps, so that their order stays.
FARTHEST = 0.4
#: Decimals with which a converter's values are written: [V], [Pa], [m].
DECIMALS = {"u_P": 4, "u_N": 4, "p_P": 0, "p_N": 0, "x": 7}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What happened on the bench.

    Parameters
    ----------
    t : (N,) array
        [s].
    rows : (N, 5) array
        u_P, u_N [V], p_P, p_N [Pa], x [m] as sampled.
    states : (N, SIZE) array
        True states at the same instants, in the order of ``kernels.layout``.
    modes : (N,) array
        What the piston does: −1 moves down, 0 is held, 1 moves up, 2 on bristles.
    accelerations : (N,) array
        Of the piston [m/s²].
    par : record
        Parameters of the run.
    """

    t: FloatArray
    rows: FloatArray
    states: FloatArray
    modes: FloatArray
    accelerations: FloatArray
    par: object


def rest_pressures(axis: VirtualAxis) -> tuple[float, float]:
    """Return pressures [Pa] that balance the piston about the null pressure of the valves.

    The null pressure is where a closed valve lets in as much as out.
    """
    p = np.linspace(axis.p_ext, axis.p_supply, 400)
    q = np.zeros_like(p)
    meter(kernel_parameters(axis), np.zeros_like(p), p, 1.0, q)
    null = float(np.interp(0.0, -q, p)) if q[0] > 0.0 > q[-1] else float(p.mean())
    ambient = (axis.S_P - axis.S_N) * axis.p_ext
    ambient += axis.M * STANDARD_GRAVITY * sin(radians(axis.angle_deg))
    force = (axis.S_P + axis.S_N) / 2 * null
    return (force + ambient / 2) / axis.S_P, (force - ambient / 2) / axis.S_N


def simulate_axis(
    axis: VirtualAxis,
    drive: Excitation,
    effects: Sequence[VirtualEffect] = (),
    fs: float = 1000.0,
    seed: int = 0,
    step: float | None = None,
    start: tuple[float, float, float] | None = None,
    settling: float = SETTLING,
    keep_states: bool = True,
    jitter: float = 0.0,
) -> Run:
    """Run the axis under its sampled controller.

    Parameters
    ----------
    axis : VirtualAxis
        Whose.
    drive : Excitation
        Reference and common-mode command, one value a sample.
    effects : sequence of VirtualEffect, optional
        Hidden effects.
    fs : float, optional
        Sampling frequency of controller and record [Hz].
    seed : int, optional
        Of the noise.
    step : float, optional
        Longest time step [s]; by default what the effects bear, at most 0.1 ms.
    start : (x, p_P, p_N), optional
        Where the run starts, at rest [m, Pa, Pa]; by default at the first reference, balanced.
    settling : float, optional
        Time in closed loop on the first reference before the record [s].
    keep_states : bool, optional
        Whether to keep the true states.
    jitter : float, optional
        Standard deviation of the instants about those of a uniform clock, in steps; none strays
        by more than `FARTHEST` steps.

    Raises
    ------
    ModelError
        If the run leaves the finite numbers, if two effects have one cause, or if the position is
        to be delayed under a clock with jitter.
    """
    N, dt = drive.x_ref.size, 1.0 / fs
    substeps = max(1, ceil(dt / (step or longest_step(effects)) - 1e-9))
    par = kernel_parameters(axis, effects, dt)
    if jitter and par["position_delay_T"] > 0.0:
        raise ModelError(
            "position_delay: the bench counts its delay in equal steps; record without jitter"
        )
    sigma = np.array([axis.sensors.p_noise, axis.sensors.p_noise, axis.sensors.x_noise])
    noise = np.random.default_rng([seed, 4]).standard_normal((N, 3)) * sigma
    rows = np.full((N, layout.ROW), np.nan)
    kept = N if keep_states else 0
    states, modes = np.full((kept, layout.SIZE), np.nan), np.zeros(kept)
    accelerations = np.zeros(kept)
    t: FloatArray = dt * np.arange(N, dtype=float)
    intervals = np.full(N, dt)
    if jitter:
        away = np.random.default_rng([seed, 7]).normal(0.0, jitter, N).clip(-FARTHEST, FARTHEST)
        t = t + dt * away
        intervals[:-1] = np.diff(t)
    half = axis.stroke / 2
    begin = np.array(start or (np.clip(drive.x_ref[0], -half, half), *rest_pressures(axis)))
    if not abs(begin[0]) <= half:
        raise ModelError(f"start at x = {begin[0]:g} m: beyond the end stop at {half:g} m")
    run(
        par, begin, drive.x_ref, drive.common, noise, t, intervals, dt, substeps,
        round(settling * fs), rows, states, modes, accelerations,
    )  # fmt: skip
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        named = ", ".join(effect.name for effect in effects) or "no effect"
        raise ModelError(
            f"the bench with {named} leaves the finite numbers at t = {bad.argmax() * dt:g} s; "
            "shorten the step, or make the effect smaller"
        )
    return Run(t, rows, states, modes, accelerations, par)


def record(
    axis: VirtualAxis,
    experiment: Experiment | Excitation,
    effects: Sequence[VirtualEffect] = (),
    fs: float = 1000.0,
    duration: float = 20.0,
    seed: int = 0,
    name: str = "bench",
) -> Recording:
    """Record an experiment on an axis.

    Parameters
    ----------
    axis : VirtualAxis
        Whose.
    experiment : Experiment or Excitation
        The excitation: parts to be drawn, or every sample.
    effects : sequence of VirtualEffect, optional
        Hidden effects, see `effects_for`.
    fs, duration : float, optional
        Sampling frequency [Hz] and length [s].
    seed : int, optional
        Of reference and noise.
    name : str, optional
        Name of the recording.

    Returns
    -------
    Recording
        With u_P, u_N, p_P, p_N, x and x_ref; u[k] is held from t[k] on, y[k] belongs to t[k].
    """
    drive = experiment.excitation(axis, fs, duration, seed)
    simulated = simulate_axis(axis, drive, effects, fs, seed, keep_states=False)
    channels = shown_channels(axis, simulated.rows)
    return Recording(
        simulated.t, {**channels, "x_ref": drive.x_ref}, name, "virtual bench", InputHold.ZERO
    )


def shown_channels(axis: VirtualAxis, rows: FloatArray) -> dict[str, FloatArray]:
    """Return the channels of the rows of a run, with the decimals that a converter writes."""
    return {
        channel: np.round(rows[:, i], decimals) if axis.sensors.u_quantum else rows[:, i]
        for i, (channel, decimals) in enumerate(DECIMALS.items())
    }


def metered_map(
    axis: VirtualAxis, effects: Sequence[VirtualEffect] = (), seed: int = 0, gain: float = 1.0
) -> dict[str, FloatArray]:
    """Meter the valve: columns of ``flow_map.csv`` on a grid of commands and pressures.

    Of the effects only those that belong to the shape of the valve are there when it is metered.

    Parameters
    ----------
    axis : VirtualAxis
        Whose valve.
    effects : sequence of VirtualEffect, optional
        What is wrong with the axis.
    seed : int, optional
        Of the meter's noise.
    gain : float, optional
        Of the supply edge over that of valve P; for valve N 1 + g of the effect `valve_mismatch`.

    Returns
    -------
    dict of str to (n,) array
        ``u_V``, ``p_Pa`` (absolute), ``q_m_kg_per_s``, one value a point.
    """
    u, p = np.meshgrid(
        np.linspace(-METERED_REACH, METERED_REACH, METERED_U),
        np.linspace(axis.p_ext, axis.p_supply, METERED_P),
        indexing="ij",
    )
    u, p = np.round(u.ravel(), 4), np.round(p.ravel())
    q = np.zeros_like(u)
    shape = [effect for effect in effects if effect.form.metered]
    meter(kernel_parameters(axis, shape), u, p, gain, q)
    noise = np.random.default_rng([seed, 5]).standard_normal(q.size)
    q += METERING_NOISE * np.abs(q).max() * noise
    return {"u_V": u, "p_Pa": p, "q_m_kg_per_s": np.round(q, 9)}
