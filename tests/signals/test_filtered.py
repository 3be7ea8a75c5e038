import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.errors import CaseError
from pneumo_casadi.signals import (
    FilterPlan,
    InputPairing,
    SamplingWarning,
    filter_recording,
    plan_filters_for,
)

FS = 1e3
PLAN = FilterPlan(FS, cutoff=100.0, factor=10)


def recording(channels, hold=InputHold.ZERO):
    N = next(iter(channels.values())).size
    return Recording(np.arange(N) / FS, channels, "made", "made.csv", hold)


def sampled_drive(M, f_v, w, N=8000):
    """A mass with drag under F = sin(w t), sampled and held; integrated exactly."""
    F = np.sin(w * np.arange(N) / FS)
    decay = np.exp(-f_v / M / FS)
    x, v = np.zeros(N), np.zeros(N)
    for k in range(N - 1):
        final = F[k] / f_v
        v[k + 1] = final + (v[k] - final) * decay
        x[k + 1] = x[k] + final / FS + (v[k] - final) * (1 - decay) * M / f_v
    return recording({"x": x, "F": F})


@pytest.mark.parametrize("pairing", list(InputPairing))
def test_pairing_a_held_input_with_its_own_sample_biases_friction_by_half_a_sample(pairing):
    M, f_v, w = 1.0, 3.0, 2 * np.pi * 5.0
    result = filter_recording(sampled_drive(M, f_v, w), PLAN, pairing)
    F = np.mean([held["F"] for held in result.inputs], axis=0)
    W = np.column_stack([result.derivatives["v"], result.states["v"]])
    estimate = np.linalg.lstsq(W, F, rcond=None)[0]
    # An input ahead of the state by τ: F(t + τ) = M a + f_v v + τ (M ä + f_v a), ä = -w² v.
    tau = 0.0 if pairing is InputPairing.MEAN_OF_HOLDS else 0.5 / FS
    expected = [M + tau * f_v, f_v - tau * M * w**2]
    assert abs(expected[1] / f_v - 1) == pytest.approx(0.1645 * (tau > 0), abs=1e-3)
    np.testing.assert_allclose(estimate, expected, rtol=0.01)


def test_the_pairing_follows_the_hold_of_the_recording():
    channels = {"x": np.sin(np.arange(2000) / 50), "F": np.zeros(2000)}
    held = filter_recording(recording(channels), PLAN)
    running = filter_recording(recording(channels, InputHold.LINEAR), PLAN)
    assert held.pairing is InputPairing.MEAN_OF_HOLDS and len(held.inputs) == 2
    assert running.pairing is InputPairing.SAMPLE and len(running.inputs) == 1


def test_the_edges_are_dropped_and_counted():
    rec = recording({"x": np.sin(np.arange(2000) / 50), "F": np.arange(2000.0)})
    result = filter_recording(rec, PLAN)
    front, back = result.dropped
    assert front == back == PLAN.drop[0] > 0
    assert 2000 - front - back == result.N
    np.testing.assert_array_equal(result.t, rec.t[front:-back])
    before, after = result.inputs
    np.testing.assert_array_equal(after["F"], np.arange(front, 2000 - back))
    np.testing.assert_array_equal(before["F"], np.arange(front - 1, 2000 - back - 1))


def test_derivatives_belong_to_their_states():
    t = np.arange(4000) / FS
    rec = recording({"x": np.sin(5 * t), "p_P": 3e5 + 1e5 * np.cos(4 * t), "F": 0 * t})
    result = filter_recording(rec, PLAN)
    x, v, a = result.states["x"], result.states["v"], result.derivatives["v"]
    np.testing.assert_allclose(x, np.sin(5 * result.t), atol=1e-6)
    np.testing.assert_allclose(v, 5 * np.cos(5 * result.t), atol=1e-3)
    inside = slice(10, -10)
    np.testing.assert_allclose(a[inside], -25 * np.sin(5 * result.t)[inside], atol=0.03)
    np.testing.assert_allclose(result.derivatives["p_P"], -4e5 * np.sin(4 * result.t), atol=20)


def test_a_plan_for_another_clock_is_refused():
    rec = recording({"x": np.zeros(2000), "F": np.zeros(2000)})
    with pytest.raises(CaseError, match="planned for 5000 Hz"):
        filter_recording(rec, FilterPlan(5e3, cutoff=100.0))


def test_a_record_shorter_than_its_edges_is_refused():
    rec = recording({"x": np.zeros(60), "F": np.zeros(60)})
    with pytest.raises(CaseError, match="60 samples are too few"):
        filter_recording(rec, PLAN)


def test_the_plan_for_several_records_serves_the_fastest():
    t = np.arange(20_000) / FS
    slow, fast = (recording({"x": 0.1 * np.sin(2 * np.pi * f * t), "F": 0 * t}) for f in (1, 3))
    assert (
        plan_filters_for([slow, fast]).f_dyn
        == plan_filters_for([fast]).f_dyn
        > plan_filters_for([slow]).f_dyn
    )


def test_records_of_two_sampling_frequencies_have_no_common_plan():
    x = 0.1 * np.sin(2 * np.pi * np.arange(20_000) / FS)
    fast = recording({"x": x, "F": 0 * x})
    words = f"sampled at {FS:g} Hz, but .* at {FS / 2:g} Hz; .* decimate the faster one"
    with pytest.raises(CaseError, match=words):
        plan_filters_for([fast, fast.decimate(2)])


def test_results_are_read_only():
    rec = recording({"x": np.sin(np.arange(2000) / 50), "F": np.zeros(2000)})
    with pytest.raises(ValueError, match="read-only"):
        filter_recording(rec, PLAN).states["x"][0] = 1.0


def test_a_record_too_slow_for_its_bandwidth_is_named_with_the_remedy():
    t = np.arange(2000) / 100.0
    x = 0.1 * np.sin(2 * np.pi * 12.0 * t)
    rec = Recording(t, {"x": x, "F": 0 * t}, "run", "run.csv", InputHold.ZERO)
    words = r"run\.csv: `x` moves at up to 12.* too fast for accelerations at 100 Hz.*plan="
    with pytest.warns(SamplingWarning), pytest.raises(CaseError, match=words):
        plan_filters_for([rec])
