"""A force on the rod that is measured runs on between its samples: held, it would act late."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, InputHold, NestedController, Recording
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error import fit_equation_error
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate, simulate_closed_loop

BENCH = ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 40.0, 200.0))
TRUTH = {"M": 10.0, "f_v": 20.0, "F_c_plus": 8.0, "F_c_minus": 8.0}
#: Of the spring whose force is measured [N/m]; held over samples it adds k dt/2 = 2.5 N s/m to f_v.
STIFFNESS = 5e3


@pytest.fixture(scope="module")
def sprung():
    """The axis on a spring that it does not know, and the one that does."""
    spring = EFFECTS["spring_load"]()
    real = ForceAxis(BENCH).with_effects(spring)
    return real.with_parameters({**TRUTH, "spring_load.k": STIFFNESS})


def recorded(run, **channels):
    x = run["x"] + 1e-6 * np.random.default_rng(0).standard_normal(run.t.size)
    load = -STIFFNESS * run["x"]
    channels = {**channels, "F": run["F"], "F_load": load, "x": x}
    return Recording(run.t, channels, "sprung", "simulated", InputHold.ZERO)


@pytest.fixture(scope="module")
def record(sprung):
    t = np.arange(5000) / 1e3
    F = 60 * np.sin(2 * np.pi * 1.3 * t) + 90 * np.sin(2 * np.pi * 2.9 * t)
    return recorded(simulate(sprung, F[:, None], 1e-3, [0.0, 0.0]))


@pytest.fixture(scope="module")
def axis():
    start = {"M": 9.0, "f_v": 15.0, "F_c_plus": 5.0, "F_c_minus": 5.0}
    measured = replace(BENCH, signals=frozenset({"F_load"}))
    return ForceAxis(measured).with_parameters(start)


@pytest.mark.slow
def test_no_estimator_takes_a_measured_force_for_friction(axis, record):
    linear = fit_wls(axis, [record])
    assert dict(zip(linear.names, linear.estimate, strict=True)) == pytest.approx(TRUTH, rel=5e-3)
    along = fit_equation_error(axis, [record]).parameters
    assert {name: along[name].value for name in TRUTH} == pytest.approx(TRUTH, rel=2e-3)
    simulated = fit_output_error(axis, [record], options=OutputErrorOptions(window=0.5)).parameters
    assert {name: simulated[name].value for name in TRUTH} == pytest.approx(TRUTH, rel=2e-3)


@pytest.mark.slow
def test_nor_does_a_fit_of_the_closed_loop(axis, sprung):
    t = np.arange(3000) / 1e3
    x_ref = 0.03 * np.sin(2 * np.pi * 1.3 * t) + 0.02 * np.sin(2 * np.pi * 2.9 * t)
    run = simulate_closed_loop(sprung, x_ref, 1e-3, [0.0, 0.0])
    record = recorded(run, x_ref=x_ref)
    options = OutputErrorOptions(window=0.5, closed_loop=True)
    fitted = fit_output_error(axis, [record], options=options).parameters
    assert fitted["f_v"].value == pytest.approx(TRUTH["f_v"], rel=0.02)
    assert fitted["M"].value == pytest.approx(TRUTH["M"], rel=5e-3)
    again = simulate_closed_loop(
        axis.with_parameters(TRUTH), x_ref, 1e-3, [0.0, 0.0],
        disturbance=np.column_stack([0 * t, record["F_load"]]),
    )  # fmt: skip
    assert np.abs(again["x"] - run["x"]).max() < 2e-3 * np.ptp(run["x"])
