"""Question: does weighted least squares reproduce a published benchmark on real data.

Data: the electro-mechanical positioning system (EMPS) of Janot, Gautier and Brunot (2019), read
from the user's own copy. Nothing is random; the seed is stated because all benchmarks state one.

The authors' recipe: Butterworth of order 4 at 100 Hz forward and backward, central differences
that are one-sided at the ends, the first 49 samples dropped and none at the back, parallel
decimation by 10, force and state paired sample by sample, no sample left out.

Closed loop: nested controller at 1 kHz, velocity as the difference of the mean of two positions,
limit of 10 V; the drive holds its force over a sample. `pulses_N` is a voltage: it adds to the
limited controller output, and the recorded `vir` is the sum of the two.
"""

import argparse
import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import provenance

from pneumo_casadi.data import Case, Recording, read_emps
from pneumo_casadi.effects import AsymmetricViscousFriction
from pneumo_casadi.estimation.wls import (
    StickPhases,
    WLSResult,
    cross_validate,
    fit_wls,
    linear_combinations,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.sampled_axis import added_inputs
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate_closed_loop
from pneumo_casadi.signals import (
    FilterPlan,
    InputPairing,
    central_difference,
    zero_phase_lowpass,
)

SEED = 0
FRONT = 49
PLAN = FilterPlan(1000.0, cutoff=100.0, order=4, factor=10, f_dyn=20.0, drop=(FRONT, 0))
SIGNALS = ("position", "velocity", "acceleration", "force")
#: Width of the smoothed friction in the simulation [m/s].
V_S = 1e-4
SLOPE = "asymmetric_viscous_friction.delta_f_v"
SYMMETRIC = {
    "M": {"M": 1.0},
    "F_v": {"f_v": 1.0},
    "F_c": {"F_c_plus": 0.5, "F_c_minus": 0.5},
    "offset": {"F_c_plus": 0.5, "F_c_minus": -0.5},
}
ASYMMETRIC = {
    "M": {"M": 1.0},
    "F_v_plus": {"f_v": 1.0, SLOPE: 1.0},
    "F_c_plus": {"F_c_plus": 1.0},
    "F_v_minus": {"f_v": 1.0, SLOPE: -1.0},
    "F_c_minus": {"F_c_minus": 1.0},
}
AUTHORS = {
    "symmetric": {
        "parameters": {"M": 95.1089, "F_v": 203.5034, "F_c": 20.3935, "offset": -3.1648},
        "standard_errors": {"M": 0.1085, "F_v": 1.146, "F_c": 0.1012, "offset": 0.0444},
        "relative_error_percent": 4.0834,
        "cross_validation_percent": 5.9824,
    },
    "asymmetric": {
        "parameters": {
            "M": 95.154,
            "F_v_plus": 166.7061,
            "F_c_plus": 20.144,
            "F_v_minus": 240.4236,
            "F_c_minus": 20.6277,
        },
        "standard_errors": {
            "M": 0.0827,
            "F_v_plus": 1.2326,
            "F_c_plus": 0.1088,
            "F_v_minus": 1.2346,
            "F_c_minus": 0.1091,
        },
        "relative_error_percent": 3.1117,
    },
    "closed_loop": {
        "identification": {
            "position": 0.013752,
            "velocity": 0.22911,
            "acceleration": 8.6036,
            "force": 5.848,
        },
        "pulses": {
            "position": 0.0080248,
            "velocity": 0.47888,
            "acceleration": 19.8152,
            "force": 8.9409,
        },
    },
}


def main() -> None:
    """Run the benchmark from the command line."""
    arguments = _arguments()
    logging.disable(logging.WARNING)
    case = read_emps(arguments.data)
    result = run(case, seconds=3.0 if arguments.quick else None)
    if arguments.json is None:
        print(json.dumps(result, indent=1))
        return
    provenance.write(arguments.json, result)


def run(case: Case, seconds: float | None = None) -> dict[str, Any]:
    """Return all figures; `seconds` shortens the simulations."""
    axis = ForceAxis(case.bench)
    wider = axis.with_effects(AsymmetricViscousFriction())
    recipe: dict[str, Any] = {
        "plan": PLAN,
        "stick": StickPhases.KEEP,
        "pairing": InputPairing.SAMPLE,
    }
    fits = {
        "symmetric": (fit_wls(axis, case.identify, **recipe), SYMMETRIC),
        "asymmetric": (fit_wls(wider, case.identify, **recipe), ASYMMETRIC),
    }
    own = {
        "symmetric": (fit_wls(axis, case.identify), SYMMETRIC),
        "asymmetric": (fit_wls(wider, case.identify), ASYMMETRIC),
    }
    loops = {
        "closed_loop": (axis, fits["symmetric"][0]),
        "closed_loop_asymmetric": (wider, fits["asymmetric"][0]),
    }
    records = {"identification": case.identify[0], "pulses": case.validate[0]}
    return {
        **{name: wls_figures(fit, case, combined) for name, (fit, combined) in fits.items()},
        **{
            key: {
                name: closed_loop_errors(model, fit, record, seconds)
                for name, record in records.items()
            }
            for key, (model, fit) in loops.items()
        },
        "default_settings": {
            name: wls_figures(fit, case, combined) for name, (fit, combined) in own.items()
        },
        "authors": AUTHORS,
        **provenance.made(SEED, quick=seconds is not None),
    }


def wls_figures(
    fit: WLSResult, case: Case, combined: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Return the estimates in the authors' parameters, with errors on both records."""
    derived = linear_combinations(fit, combined)
    robust = linear_combinations(fit, combined, covariance=fit.covariance_hac)
    validated = cross_validate(fit, case.validate)[0]
    return {
        "parameters": dict(zip(derived.names, map(float, derived.values), strict=True)),
        "standard_errors": dict(zip(derived.names, map(float, derived.std), strict=True)),
        "standard_errors_hac": dict(zip(robust.names, map(float, robust.std), strict=True)),
        "relative_error_percent": fit.relative_error_percent["force"],
        "cross_validation_percent": validated.relative_error_percent["force"],
        "condition_number": fit.condition_number,
        "rows": fit.rows_used["force"],
    }


def closed_loop_errors(
    axis: Axis, fit: WLSResult, record: Recording, seconds: float | None = None
) -> dict[str, float]:
    """Simulate the loop and compare with the filtered measurements, as the authors do."""
    if seconds is not None:
        record = record.window(record.t[0], record.t[0] + seconds)
    model = axis.with_parameters({**fit.parameters.as_dict(), "v_s": V_S})
    pulses = added_inputs(model, record).T
    start = [record["x"][0], 0.0]
    run = simulate_closed_loop(model, record["x_ref"], record.dt, start, disturbance=pulses)
    theta = model.parameters.values[:, None]
    rates = np.asarray(model.rhs.map(record.N)(run.x, run.u, theta))
    simulated = (run["x"], run["v"], rates[model.states.index("v")], run["F"])
    q = zero_phase_lowpass(record["x"], PLAN.cutoff, PLAN.sampling_frequency, PLAN.order)
    v = central_difference(q, record.dt)
    measured = (q, v, central_difference(v, record.dt), record["F"])
    return {
        name: 100 * float(np.linalg.norm(y[FRONT:] - z[FRONT:]) / np.linalg.norm(y[FRONT:]))
        for name, y, z in zip(SIGNALS, measured, simulated, strict=True)
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the authors' files")
    parser.add_argument("--json", type=Path, help="file to write; printed if it is left out")
    parser.add_argument("--quick", action="store_true", help="simulate three seconds only")
    return parser.parse_args()


if __name__ == "__main__":
    main()
