"""Validation of the true axis leaves the sensor noise; any disagreement leaves more."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import Recording
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error.shooting.segments import measured_states
from pneumo_casadi.model.simulation import simulate, simulate_closed_loop
from pneumo_casadi.validation import validate
from pneumo_casadi.validation.simulations import window_curves, window_runs

SCALE = {"p_P": 150.0, "p_N": 150.0, "x": 1.5e-5}


@pytest.fixture(scope="module")
def record(made, simulated):
    axis, u, x = simulated
    return made.recorded(axis, u, x, seed=1)


@pytest.fixture(scope="module")
def honest(simulated, record):
    return validate(simulated[0], [record], windows=(0.1, 0.5, 1.0))


@pytest.mark.slow
def test_the_true_axis_leaves_the_noise_in_open_loop(honest, record):
    for channel, sigma in SCALE.items():
        error = honest.open_loop[channel]
        assert error.rms == pytest.approx(sigma, rel=0.12)
        assert error.percent == pytest.approx(100 * error.rms / np.std(record[channel]))
        assert error.noise_percent == pytest.approx(100 * sigma / np.std(record[channel]))


def test_every_window_leaves_the_noise_less_what_its_initial_state_takes(honest):
    assert tuple(honest.windows) == (0.1, 0.5, 1.0)
    for window, errors in honest.windows.items():
        samples = window * 1e3
        for channel, sigma in SCALE.items():
            assert sigma * np.sqrt(1 - 4 / samples) * 0.95 < errors[channel].rms < 1.1 * sigma


def test_one_sample_of_misalignment_shows(simulated, record, honest):
    late = validate(simulated[0], [record.shifted("x", 1)], windows=(0.1, 0.5))
    # A shift of constant velocity hides in the initial state; the rest of it does not.
    assert late.windows[0.1]["x"].rms > 1.2 * honest.windows[0.1]["x"].rms
    assert late.open_loop["x"].rms > 1.5 * honest.open_loop["x"].rms


def test_a_wrong_mass_shows_in_both_loops(made, simulated, record, honest):
    heavier = simulated[0].with_parameters({"M": 1.1 * made.TRUE["M"]})
    wrong = validate(heavier, [record], windows=(0.5,))
    assert wrong.open_loop["x"].rms > 5 * honest.open_loop["x"].rms
    assert wrong.windows[0.5]["x"].rms > 2 * honest.windows[0.5]["x"].rms


def test_a_window_as_long_as_the_record_is_left_out(simulated, record):
    short = record.window(record.t[0], record.t[0] + 1.0)
    assert short.N == 1000
    alone = validate(simulated[0], short, windows=(0.5, 1.0))  # one record need not be listed
    assert tuple(alone.windows) == (0.5,)


def test_no_record_is_refused(simulated):
    with pytest.raises(ModelError, match="no record"):
        validate(simulated[0], [])


def test_the_loop_closed_by_hand_is_the_simulated_loop(made, simulated):
    axis = simulated[0]
    t = np.arange(400) / made.FS
    x_ref = 0.05 * np.sin(2 * np.pi * t)
    x_0 = np.array([4e5, 5e5, 0.0, 0.0])
    loop = simulate_closed_loop(axis, x_ref, 1 / made.FS, x_0)
    u = axis.bench.controller.command(x_ref, loop["x"])
    np.testing.assert_allclose(loop.u.T, u, atol=1e-12)  # u_k answers the position of instant k
    again = simulate(axis, u, 1 / made.FS, x_0)
    np.testing.assert_allclose(again.x, loop.x, rtol=1e-9, atol=1e-12)


def test_windows_and_loop_begin_at_the_pressures_behind_a_biased_sensor(simulated, record):
    axis, *_ = simulated
    channels = {name: record[name] for name in record.channels}
    channels |= {"p_P": record["p_P"] + 2e4, "p_N": record["p_N"] - 1e4}
    biased = Recording(record.t, channels, "biased", record.source, record.hold)
    offset = {"pressure_sensor_bias.b_P": 2e4, "pressure_sensor_bias.b_N": -1e4}
    behind = axis.with_effects(EFFECTS["pressure_sensor_bias"]()).with_parameters(offset)
    true = measured_states(axis, record, axis.parameters)
    np.testing.assert_allclose(measured_states(behind, biased, behind.parameters), true, rtol=1e-9)


def test_windows_that_are_no_whole_number_of_blocks_share_no_sample(simulated, record):
    """At 1250 Hz, blocks of 2 ms are 3 samples and windows of 0.1 s are 125."""
    channels = {name: record[name][:700] for name in record.names}
    faster = Recording(np.arange(700) / 1250.0, channels, "faster", "made", record.hold)
    ((_, rows, run),) = window_runs(simulated[0], [faster], 0.1)
    assert np.unique(rows).size == rows.size == run.t.size
    assert np.ptp(rows) > 500


def test_windows_apart_from_each_other_are_simulated_as_those_that_follow_each_other(
    simulated, record
):
    axis = simulated[0]
    ((_, all_rows, all_runs),) = window_runs(axis, [record], 0.1)
    ((_, rows, runs),) = window_runs(axis, [record], 0.1, apart=0.3)
    np.testing.assert_array_equal(rows, all_rows[::3])
    x = all_runs["x"].reshape(all_rows.shape)[::3]
    np.testing.assert_allclose(runs["x"].reshape(rows.shape), x, rtol=0, atol=1e-9)


def test_curves_over_windows_show_the_outputs_of_all_models(made, simulated, record):
    """A model without a recorded sensor simulates the others."""
    axis = simulated[0]
    part = record.window(0.0, 0.5).with_channels({"v": np.gradient(record["x"][:500], record.dt)})
    bench = replace(made.BENCH, signals=frozenset({"v"}), noise=None)
    richer = replace(axis, bench=bench)
    runs = {"with": window_runs(richer, [part], 0.1), "without": window_runs(axis, [part], 0.1)}
    (curves,) = window_curves(richer, runs)
    assert tuple(curves.values) == ("p_P", "p_N", "x") and curves.simulations == tuple(runs)
