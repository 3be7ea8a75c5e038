"""Question: what does output error, in closed and in open loop, make of a real axis.

Data: the electro-mechanical positioning system (EMPS) of Janot, Gautier and Brunot (2019), read
from the user's own copy; identified on one record, tried on both. Nothing is random.

Closed loop: the nested controller is simulated on the recorded reference, 25 s in one piece. Open
loop: the force as recorded drives the axis; double integration without feedback drifts, so the fit
goes over windows of 5 s. The open-loop error on the pulses takes the first sample as known and the
force as measured over the whole record, as the nonlinear benchmark prescribes; published black
boxes stand beside it.
"""

import argparse
import logging
from pathlib import Path
from typing import Any

import emps
import numpy as np
import provenance
import tables

from pneumo_casadi.data import Case, Recording, read_emps
from pneumo_casadi.effects import AsymmetricViscousFriction
from pneumo_casadi.estimation.output_error import (
    OutputErrorOptions,
    OutputErrorResult,
    fit_output_error,
)
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate

#: Root mean square open-loop position error on the pulses, published for black boxes [mm].
BLACK_BOXES = {"linear state space": 5.53, "polynomial NARX": 5.17, "LSTM": 74.1}
ESTIMATORS = {
    "closed-loop OE": OutputErrorOptions(closed_loop=True, widths=(emps.V_S,)),
    "open-loop OE, 5 s windows": OutputErrorOptions(window=5.0, widths=(emps.V_S,)),
}


def run(case: Case, seconds: float | None) -> dict[str, Any]:
    """Return all figures; `seconds` shortens the records."""
    plain = ForceAxis(case.bench)
    axes = {"symmetric": plain, "asymmetric": plain.with_effects(AsymmetricViscousFriction())}
    learn, pulses = (_cut(record, seconds) for record in (case.identify[0], case.validate[0]))
    records = {"identification": learn, "pulses": pulses}
    results: dict[str, Any] = {}
    for friction, axis in axes.items():
        wls = fit_wls(axis, [learn])
        start = axis.started_at(wls.parameters)
        fits: dict[str, Any] = {"WLS": wls}
        for name, options in ESTIMATORS.items():
            fits[name] = fit_output_error(start, [learn], options=options)
        for name, fit in fits.items():
            results[f"{name}, {friction} friction"] = _figures(axis, fit, records)
    return {"estimators": results, "black_boxes_mm": BLACK_BOXES, "authors": emps.AUTHORS}


def _cut(record: Recording, seconds: float | None) -> Recording:
    return record if seconds is None else record.window(record.t[0], record.t[0] + seconds)


def _figures(axis: Axis, fit: Any, records: dict[str, Recording]) -> dict[str, Any]:
    names = [n for n in fit.parameters.names if n != "v_s"]
    refined = isinstance(fit, OutputErrorResult)
    model = axis.with_parameters({**fit.parameters.as_dict(), "v_s": emps.V_S})
    return {
        "parameters": {n: fit.parameters[n].value for n in names},
        "standard_errors_robust": {n: fit.std(n, robust=True) for n in names} if refined else None,
        "iterations": fit.iterations if refined else None,
        "closed_loop_percent": {
            name: emps.closed_loop_errors(axis, fit, record) for name, record in records.items()
        },
        "open_loop_mm": {name: _open_loop(model, record) for name, record in records.items()},
    }


def _open_loop(model: Axis, record: Recording) -> float:
    """Simulate the recorded force from the first sample on; return the position error [mm]."""
    start = [record["x"][0], 0.0]
    run = simulate(model, record.stack(model.inputs), record.dt, start, record.hold)
    return 1e3 * float(np.sqrt(np.mean((record["x"] - run["x"]) ** 2)))


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the authors' files")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="six seconds only")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    result = run(read_emps(arguments.data), 6.0 if arguments.quick else None)
    result |= provenance.made(None, arguments.quick)
    print(tables.emps_output_error(result))
    provenance.write(arguments.json, result)


if __name__ == "__main__":
    main()
