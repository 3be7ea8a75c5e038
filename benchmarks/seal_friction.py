"""Friction of an O-ring over pressure: identified at 1, 3 and 5 bar, predicted at 7 bar.

Real measurements (E. Zillen, CC0) of a cylinder that a machine moves while a regulator holds its
pressure. Weighted least squares of the force balance

    0 = S_P (p_P - p_ext) + F_load - F_c sign(v) - k_p (p_P - p_ext) sign(v)

gives the piston area, Coulomb friction and friction per pressure. The regulator lets the pressure
rise by some hundredths of a bar while the rod is pushed in, and fall while it is drawn out; so
half the force loop is friction and S_P times half that difference. Both slopes are given: that of
friction alone, with the pressure as measured, and that of half the force loop, with the mean
pressure of each record in its place.

The same records are then diagnosed with the whole catalogue: the cause is found at 1, 3 and 5 bar,
and its closure is that of the gap at 7 bar.
"""

import argparse
import json
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import provenance

from pneumo_casadi.data import Case, Recording
from pneumo_casadi.data.seal_friction import HELD_OUT, P_EXT, read_seal_friction
from pneumo_casadi.diagnosis import diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.wls import WLSResult, fit_wls
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.servosystem import PressureAxis
from pneumo_casadi.signals import FilterPlan, filter_recording, plan_filters

SEED = 0
#: The machine reverses about every three seconds: its strokes are slower than this [Hz].
F_DYN = 0.5
#: Shortest stretch between gaps that the filters leave something of [s].
SHORTEST = 6.0
#: Below this velocity the machine reverses [m/s]; it moves at 10 to 15 mm/s.
REVERSING = 5e-3
SLOPE = "pressure_friction.k_p"
PARAMETERS = ("S_P", "F_c_plus", "F_c_minus", SLOPE)
BAR = 1e5


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the author's files")
    parser.add_argument("--json", type=Path, help="file to write; printed if it is left out")
    arguments = parser.parse_args()
    case = read_seal_friction(arguments.data)
    result = run(case) | {"diagnosis": told(case)}
    if arguments.json is None:
        print(json.dumps(result, indent=1))
    else:
        provenance.write(arguments.json, result)


def run(case: Case) -> dict[str, Any]:
    """Return areas and slopes of both fits, and the prediction of the held-out record."""
    axis = PressureAxis(case.bench, [EFFECTS["pressure_friction"]()])
    plan = plan_filters(case.bench.sampling_frequency, F_DYN)
    case = _long_enough(case)
    measured = _fit(axis, case.identify, plan)
    held = _fit(axis, [_at_mean_pressure(record) for record in case.identify], plan)
    return {
        **provenance.made(SEED, quick=False),
        "measured_pressure": _estimates(measured),
        "mean_pressure": _estimates(held),
        f"prediction_at_{HELD_OUT}_bar": _prediction(measured, case.validate, plan),
    }


def told(case: Case) -> dict[str, Any]:
    """Return what the diagnosis says of the records that filters leave something of."""
    diagnosis = diagnose(_long_enough(case))
    first = diagnosis.ranking[0]
    assert first.closure is not None
    return {
        "verdict": diagnosis.verdict.value,
        "named": [effect.name for effect in diagnosis.effects],
        "probability": [effect.probability for effect in diagnosis.effects],
        "k_p_N_per_bar": BAR * diagnosis.effects[0].parameters["k_p"].value,
        "second": {
            "names": diagnosis.ranking[1].names,
            "probability": diagnosis.ranking[1].probability,
        },
        "closes_of_force_balance": {
            "value": first.closure.value,
            "interval": [first.closure.lower, first.closure.upper],
        },
        "gap_percent": {"before": diagnosis.gap.before, "after": diagnosis.gap.after},
    }


def _long_enough(case: Case) -> Case:
    identify, validate = (
        tuple(record for record in records if record.duration >= SHORTEST)
        for records in (case.identify, case.validate)
    )
    return replace(case, identify=identify, validate=validate)


def _fit(axis: Axis, records: Sequence[Recording], plan: FilterPlan) -> WLSResult:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # mass and viscous friction do not show at one speed
        return fit_wls(axis, records, names=PARAMETERS, plan=plan, velocity_threshold=REVERSING)


def _at_mean_pressure(record: Recording) -> Recording:
    return record.with_channels({"p_P": np.full(record.N, record["p_P"].mean())})


def _estimates(fit: WLSResult) -> dict[str, Any]:
    value = dict(zip(fit.names, fit.estimate, strict=True))
    std = dict(zip(fit.names, fit.std_hac, strict=True))
    scales = {"S_P": ("S_P_cm2", 1e4), SLOPE: ("k_p_N_per_bar", BAR)}
    known = {name: scales.get(name, (f"{name}_N", 1.0)) for name in fit.names}
    return {
        label: {"value": float(scale * value[name]), "std": float(scale * std[name])}
        for name, (label, scale) in known.items()
    }


def _prediction(
    fit: WLSResult, records: Sequence[Recording], plan: FilterPlan
) -> dict[str, dict[str, float]]:
    """Return mean force that holds the rod, measured and predicted [N], by direction."""
    value = dict(zip(fit.names, fit.estimate, strict=True))
    rows = []
    for record in records:
        filtered = filter_recording(record, plan)
        inputs, v = filtered.inputs[0], filtered.states["v"]
        gauge = inputs["p_P"] - P_EXT
        coulomb = np.where(v > 0, value["F_c_plus"], value["F_c_minus"])
        friction = np.sign(v) * (coulomb + value[SLOPE] * gauge)
        rows.append(np.column_stack([v, -inputs["F_load"], value["S_P"] * gauge - friction]))
    v, measured, predicted = np.concatenate(rows).T
    directions = {"drawn_out": v > REVERSING, "pushed_in": v < -REVERSING}
    return {
        name: {
            "measured_N": float(measured[at].mean()),
            "predicted_N": float(predicted[at].mean()),
            "error_N": float((predicted[at] - measured[at]).mean()),
        }
        for name, at in directions.items()
    }


if __name__ == "__main__":
    main()
