"""Output error with the recorded controller simulated inside the fit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pneumo_casadi.data import (
    CascadeController,
    CustomController,
    InputHold,
    PidController,
    Recording,
)
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, fit_output_error
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.simulation import simulate_closed_loop
from pneumo_casadi.model.stepping import stepping_for
from pneumo_casadi.validation.errors import loop_errors

DT = 1e-3


def looped(made, axis, start, seed, noise, N=1000, added=None):
    """A record of an axis under its own sampled controller, sensors noisy outside the loop."""
    x_ref = made.reference(np.arange(N) * DT, seed)
    run = simulate_closed_loop(axis, x_ref, DT, start, disturbance=added)
    rng = np.random.default_rng(seed)
    channels = {n: run[n] for n in axis.inputs} | {"x_ref": x_ref}
    for name, size in zip(axis.outputs, noise, strict=True):
        channels[name] = run[name] + size * rng.standard_normal(N)
    if added is not None:
        channels["F_pulse"] = added
    return Recording(run.t, channels, "loop", "made", InputHold.ZERO)


@pytest.fixture(scope="module")
def servo_record(made):
    axis = made.true_axis()
    return looped(made, axis, [3.5e5, 4.7e5, 0.0, 0.0], 3, (150.0, 150.0, 1.5e-5))


@pytest.fixture(scope="module")
def force_record(made):
    added = np.where((np.arange(1000) // 200) % 2, 5.0, 0.0)
    return looped(made, made.true_force_axis(), [0.0, 0.0], 4, (2e-6,), added=added)


def chi2_share(result, truth):
    names = result.uncertainty.names
    d = np.array([result.parameters[n].value - truth[n] for n in names])
    return stats.chi2.sf(d @ np.linalg.solve(result.uncertainty.covariance, d), d.size)


def options(made, v_s, **more):
    return OutputErrorOptions(closed_loop=True, widths=(v_s,), **more)


@pytest.mark.slow
def test_a_proportional_loop_gives_back_the_truth_without_looking_at_the_inputs(
    made, start, servo_record
):
    table, begin = start(3)
    begin = made.perturbed(begin, {"X_s1": 1.1, "X_s5": 0.9, "M": 1.1, "F_c_plus": 0.8})
    blind = {n: servo_record[n] for n in servo_record.names if n not in begin.inputs}
    blind |= {name: np.zeros(servo_record.N) for name in begin.inputs}
    without = Recording(servo_record.t, blind, "blind", "made", InputHold.ZERO)
    chosen = options(made, made.TRUE["v_s"])
    result = fit_output_error(begin, [servo_record], table, chosen)
    assert 1e-3 < chi2_share(result, made.true_axis().parameters.as_dict()) < 1 - 1e-3
    again = fit_output_error(begin, [without], table, chosen)
    np.testing.assert_allclose(again.parameters.values, result.parameters.values, rtol=1e-9)


@pytest.mark.slow
def test_a_nested_loop_with_pulses_gives_back_the_truth(made, force_record):
    begin = made.ForceAxis(made.FORCE_BENCH)
    chosen = options(made, made.FORCE_TRUE["v_s"])
    result = fit_output_error(begin, [force_record], options=chosen)
    assert 1e-3 < chi2_share(result, made.FORCE_TRUE) < 1 - 1e-3
    ipopt = fit_output_error(begin, [force_record], options=replace(chosen, method=Method.IPOPT))
    apart = ipopt.parameters.values - result.parameters.values
    assert np.abs(apart[:4] / result.uncertainty.std).max() < 0.01
    assert result.initial_states[0].size == 2


def filtered_proportional(memory, x_ref, x):
    kept = 0.8 * memory + 0.2 * (x_ref - x)
    return [2.4 * kept, -2.4 * kept], kept


LAWS = {
    "slow pid": PidController(
        2.4,
        0.3,
        k_i=1.0,
        k_d=0.05,
        derivative_filter=0.01,
        anti_windup="clamping",
        sample_time=4e-3,
    ),
    "cascade": CascadeController(4.0, 0.5, 5.0, k_i=1.0, velocity_filter=0.005),
    "own": CustomController(filtered_proportional, memory=[0.0]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_any_law_closes_the_loop_of_the_fit(made, name):
    """The record begins while the law is at work: what it remembers is told by its commands."""
    axis = made.true_axis()
    bench = replace(axis.bench, controller=LAWS[name])
    axis = replace(axis, bench=bench)
    noise = (150.0, 150.0, 1.5e-5)
    record = looped(made, axis, [3.5e5, 4.7e5, 0.0, 0.0], 3, noise, 1200)
    late = record.window(0.301, 1.2)
    assert loop_errors(axis, [late])["u_P"].percent < 1.0
    begin = made.perturbed(axis, {"X_s1": 1.1, "M": 1.1, "F_c_plus": 0.8})
    begin = made.free_only(begin, "X_s1", "X_s5", "M", "F_c_plus")
    result = fit_output_error(begin, [late], options=options(made, made.TRUE["v_s"]))
    assert 1e-3 < chi2_share(result, made.true_axis().parameters.as_dict()) < 1 - 1e-3


@pytest.mark.slow
def test_pulses_that_are_not_added_are_missed(made, force_record):
    channels = {n: force_record[n] for n in force_record.names if n != "F_pulse"}
    without = Recording(force_record.t, channels, "loop", "made", InputHold.ZERO)
    begin = made.ForceAxis(made.FORCE_BENCH)
    chosen = options(made, made.FORCE_TRUE["v_s"])
    right, wrong = (fit_output_error(begin, [r], options=chosen) for r in (force_record, without))
    assert wrong.rms[0] > 3 * right.rms[0]


def test_a_controller_remembers_the_last_positions(made, force_record):
    axis = made.true_force_axis()
    model = SampledAxis(axis, stepping_for(axis, DT), made.FORCE_BENCH.controller)
    states = np.array([[1.0, 1.5, 2.5, 4.0], [500.0, 0.0, 0.0, 0.0]])
    found = model.with_controller_memory(states, force_record)
    np.testing.assert_allclose(found[2], [0.5, 1.0, 1.5, 2.5])
    np.testing.assert_allclose(found[3], [0.0, 0.5, 1.0, 1.5])


def test_what_cannot_be_closed_is_refused(made, start, servo_record, force_record):
    table, begin = start(3)
    chosen = options(made, made.TRUE["v_s"])
    channels = {n: servo_record[n] for n in servo_record.names if n != "x_ref"}
    without = Recording(servo_record.t, channels, "plain", "made", InputHold.ZERO)
    with pytest.raises(ModelError, match="x_ref"):
        fit_output_error(begin, [without], table, chosen)
    linear = Recording(
        force_record.t,
        {n: force_record[n] for n in force_record.names},
        "linear",
        "made",
        InputHold.LINEAR,
    )
    with pytest.raises(ModelError, match="holds its output"):
        fit_output_error(made.ForceAxis(made.FORCE_BENCH), [linear], options=chosen)
