"""Question: is the virtual bench sound, and is it the model's axis when every effect is off.

Part one stays within the bench: balances of mass and energy, convergence with the step, rest,
end stops. Part two sets it beside the CasADi model on the same inputs: a valve that both can
describe (no clearance, one subsonic index) with its known parameters, sensors that show the state,
without Coulomb friction and with it, for friction ever closer to set-valued (v_s → 0). Part three
identifies the nominal model on effect-free cases of the bench (20 s at 1 kHz) and reports its error
on the held-out record in closed loop. Axes are random; seeds are counted from 0.
"""

import argparse
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import provenance

from pneumo_casadi.errors import FitError
from pneumo_casadi.identification.identify import identify
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.model.simulation import simulate
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.valve import FlowISO6358
from pneumo_casadi.virtual_bench import (
    Experiment,
    VirtualAxis,
    make_case,
    random_axis,
    sanity,
    simulate_axis,
)
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.sanity import STEPS

FS = 1000.0
WIDTHS = (1e-2, 1e-3, 1e-4)
#: Length of the comparison with the model [s]: a narrow tanh costs it many small steps.
AGREEMENT_SECONDS = 2.0


def common_axis(axis: VirtualAxis) -> VirtualAxis:
    """Return the axis with a valve that the model can describe too, and ideal sensors."""
    valve = replace(
        axis.valve, lap_supply=0.0, lap_exhaust=0.0, clearance=0.0, m_supply=0.5, m_exhaust=0.5
    )
    return replace(axis, valve=valve).with_ideal_sensors()


def known_flow(axis: VirtualAxis) -> FlowISO6358:
    """Return the model's valve with the parameters of the bench's."""
    valve = axis.valve
    values: dict[str, float] = {}
    for side in ("supply", "exhaust"):
        values |= {
            f"k_{side}": getattr(valve, f"k_{side}"),
            f"u_0_{side}": 0.0,
            f"w_{side}": 1e-9,
            f"h_{side}": 0.0,
            f"C_leak_{side}": getattr(valve, f"leak_{side}"),
            f"b_{side}": getattr(valve, f"b_{side}"),
        }
    values["m"] = valve.m_supply
    known = Parameters([Parameter(name, value, "1") for name, value in values.items()])
    return FlowISO6358(
        known,
        np.zeros((len(known), len(known))),
        0.0,
        (axis.p_ext, axis.p_supply),
        (-3.0, 3.0),
        axis.p_supply,
        axis.p_ext,
        T=axis.T,
    )


def differences(
    axis: VirtualAxis, v_s: float, duration: float, seed: int, mass: float | None = None
) -> dict[str, float]:
    """Return how far model and bench part on the same inputs, in per cent of the signal's range.

    The model has the bench's parameters, and the friction width `v_s` [m/s]; another `mass` [kg]
    shows how sharp the comparison is.
    """
    drive = Experiment.of("chirp_and_squares").excitation(axis, FS, duration, seed)
    result = simulate_axis(axis, drive, (), FS)
    order = [layout.GAS_P, layout.GAS_N, layout.X, layout.V]
    states = result.states[:, order]
    truth: Mapping[str, float] = {**axis.truth, "v_s": v_s, "M": mass or axis.M}
    bench = replace(
        axis.bench_description(FS, axis.M), S_P=axis.S_P, S_N=axis.S_N, p_supply=axis.p_supply
    )
    model = Servosystem(bench, known_flow(axis)).with_parameters(truth)
    simulated = simulate(model, result.rows[:, :2], 1 / FS, states[0])
    # The simulation goes on for one sample more, over which the last input is held.
    apart = np.abs(simulated.x[:, : len(states)].T - states).max(axis=0)
    percent = 100 * apart / np.ptp(states, axis=0)
    return dict(zip(("p_P", "p_N", "x", "v"), percent.tolist(), strict=True))


def agreement(seed: int, duration: float) -> dict[str, Any]:
    """Compare model and bench without and with Coulomb friction."""
    axis = common_axis(random_axis(seed))
    smooth = replace(axis, F_c_plus=0.0, F_c_minus=0.0)
    return {
        "without_coulomb_friction": differences(smooth, 1e-3, duration, seed),
        "with_coulomb_friction": {
            f"v_s = {v_s:g} m/s": differences(axis, v_s, duration, seed) for v_s in WIDTHS
        },
    }


def nominal_fit(seed: int, duration: float) -> dict[str, Any]:
    """Identify an effect-free case and return what is left on the held-out record."""
    with tempfile.TemporaryDirectory() as scratch:
        made = make_case(Path(scratch) / "case", seed, duration=duration)
        try:
            result = identify(made.case)
        except FitError as error:
            return {"failed": str(error)}
    validation = result.validation
    if validation is None or validation.closed_loop is None:
        raise RuntimeError("the case has no held-out record or no controller")
    error, motion = validation.closed_loop["x"], float(np.ptp(made.case.validate[0]["x"]))
    truth = made.axis.truth
    return {
        "closed_loop_x_rms_m": error.rms,
        "closed_loop_x_percent_of_motion": 100 * error.rms / motion,
        "closed_loop_x_percent_of_standard_deviation": error.percent,
        "motion_m": motion,
        "flow_map_misfit_percent": 100 * result.flow.sigma / result.flow_map.q_max,
        "parameter_errors_percent": {
            name: 100.0 * (result.output_error.parameters[name].value / value - 1)
            for name, value in truth.items()
        },
        "seconds": result.seconds,
    }


def speed() -> dict[str, float]:
    """Return the times of a run of 20 s at 5 kHz, sensors and all [s]: first and best of three."""
    axis = random_axis(0)
    drive = Experiment.of("chirp_and_squares").excitation(axis, 5000.0, 20.0, 0)
    times = []
    for _ in range(4):
        began = time.perf_counter()
        simulate_axis(axis, drive, (), 5000.0, keep_states=False)
        times.append(time.perf_counter() - began)
    return {"first_seconds": times[0], "seconds": min(times[1:])}


def run(axes: int, duration: float, fits: int) -> dict[str, Any]:
    """Examine random axes, and identify the first of them; print each as it is done."""
    result: dict[str, Any] = {"speed_20_s_at_5_kHz": speed(), "axes": {}, "nominal_fit": {}}
    print(f"20 s at 5 kHz: {result['speed_20_s_at_5_kHz']['seconds']:.2f} s", flush=True)
    for seed in range(axes):
        apart = agreement(seed, min(duration, AGREEMENT_SECONDS))
        row = {**asdict(sanity(seed=seed, duration=duration)), "agreement_percent": apart}
        result["axes"][str(seed)] = row
        print(
            f"axis {seed}: balances of mass {row['mass_error']:.1e}, energy "
            f"{row['energy_error']:.1e}; step {STEPS[-1]:g} s: {row['step_errors'][-1]:.1e} of the "
            f"motion, order {row['order']:.1f}; model x: "
            f"{apart['without_coulomb_friction']['x']:.1e} % without friction, "
            f"{list(apart['with_coulomb_friction'].values())[-1]['x']:.3f} % with "
            f"v_s = {WIDTHS[-1]:g} m/s",
            flush=True,
        )
    for seed in range(fits):
        row = result["nominal_fit"][str(seed)] = nominal_fit(seed, duration)
        if "failed" in row:
            print(f"nominal fit {seed} failed: {row['failed']}", flush=True)
            continue
        print(
            f"nominal fit {seed}: closed-loop x {row['closed_loop_x_percent_of_motion']:.3f} % of "
            f"the motion, {row['closed_loop_x_percent_of_standard_deviation']:.3f} % of its "
            f"standard deviation; {row['seconds']:.0f} s",
            flush=True,
        )
    return result


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--fits", type=int, default=3, help="how many axes to identify")
    parser.add_argument("--quick", action="store_true", help="one axis, four seconds, no fit")
    arguments = parser.parse_args()
    axes, duration, fits = (1, 4.0, 0) if arguments.quick else (5, 20.0, arguments.fits)
    result = run(axes, duration, fits)
    result |= provenance.made(None, arguments.quick, "numba")
    result |= {"seed": list(range(axes)), "duration_seconds": duration}
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
