"""The clock: rounding is forgiven, loss, repetition, jitter and drift are not."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.data import Clock, InputHold, Recording
from pneumo_casadi.data.record_checks import _check_clock
from pneumo_casadi.data.recording.clock import sample_time, split_rows
from pneumo_casadi.data.recording.curves import Curves, curves_of
from pneumo_casadi.errors import CaseError


def row(k):
    return f"row {k + 1}"


rates = st.sampled_from([50.0, 200.0, 1000.0, 1024.0, 3000.0, 5000.0])
lengths = st.integers(100, 800)


@given(rates, lengths, st.integers(-10, 10))
def test_time_rounded_to_four_decimals_gives_the_sample_time(rate, rows, start):
    t = np.round(start + np.arange(rows) / rate, 4)
    assert sample_time(t, row) == pytest.approx(1 / rate, rel=1e-3)


@given(rates, lengths, st.floats(0.0, 1e4))
def test_exact_time_gives_the_sample_time_exactly(rate, rows, start):
    t = start + np.arange(rows) / rate
    assert sample_time(t, row) == pytest.approx(1 / rate, rel=1e-8)


@pytest.mark.parametrize("rows", [7, 777, 8000])
def test_a_record_that_starts_at_zero_starts_at_zero_and_is_named_so(rows):
    t = np.arange(rows) * 1e-3
    record = Recording(t, {"x": t}, "ramp", "memory", InputHold.ZERO)
    assert str(record.t[0]) == "0.0"
    assert record.window(record.t[0], 1.0).name == "ramp[0:1 s]"
    moved = Recording(t - t[3], {"x": t}, "ramp", "memory", InputHold.ZERO)
    assert str(moved.t[3]) == "0.0"


@given(rates, lengths, st.data())
def test_a_clock_that_jumps_is_named_with_its_row_and_the_samples_lost(rate, rows, data):
    k = data.draw(st.integers(1, rows - 1))
    lost = data.draw(st.integers(1, 30))
    t = np.arange(rows) / rate
    t[k:] += lost / rate
    with pytest.raises(CaseError, match=rf"^row {k + 1}: `t` jumps .*: {lost} samples? of"):
        sample_time(np.round(t, 4), row)


@given(rates, lengths, st.data())
def test_a_clock_that_repeats_or_runs_backward_is_named_with_its_row(rate, rows, data):
    k = data.draw(st.integers(1, rows - 1))
    back = data.draw(st.integers(1, k))
    t = np.arange(rows) / rate
    t[k:] -= back / rate
    with pytest.raises(CaseError, match=rf"^row {k + 1}: `t` (repeats|runs backward from)"):
        sample_time(np.round(t, 4), row)


@given(rates, lengths, st.data())
def test_a_stutter_of_a_third_of_a_step_is_named_with_its_row(rate, rows, data):
    k = data.draw(st.integers(1, rows - 1))
    t = np.arange(rows) / rate
    t[k:] += data.draw(st.sampled_from([-1, 1])) / (3 * rate)
    with pytest.raises(CaseError, match=rf"^row {k + 1}: .*the clock is irregular"):
        sample_time(t, row)


def test_a_clock_that_slowly_drifts_is_refused_although_every_step_is_nearly_right():
    t = np.cumsum(np.full(2000, 1e-3) + np.linspace(0, 2e-5, 2000))
    assert np.abs(np.diff(t) / 1e-3 - 1.01).max() < 0.011
    with pytest.raises(CaseError, match="the clock drifts; write"):
        sample_time(t, row)


def test_rounding_as_coarse_as_the_step_is_refused_with_the_remedy():
    t = np.round(np.arange(400) / 8000.0, 4)
    with pytest.raises(CaseError, match=r"row 4: .*irregular.*or t with more decimals"):
        sample_time(t, row)


def test_the_stored_clock_is_the_uniform_one_that_the_file_rounds():
    stamps = np.round(np.arange(3000) / 3000.0, 4)
    t = Recording(stamps, {}, "a", "memory", InputHold.ZERO).t
    assert np.ptp(np.diff(t)) < 1e-12
    assert np.abs(t - stamps).max() < 0.6e-4
    # a rounding error of up to 5e-5 s a stamp shrinks with N^1.5 in the slope
    assert np.diff(t).mean() == pytest.approx(1 / 3000, rel=1e-6)


def test_a_time_of_day_that_passes_midnight_is_told_from_repeated_rows():
    t = (86399.9 + np.arange(300) / 1000.0) % 86400.0
    with pytest.raises(CaseError, match=r"^row 101: .*passes midnight; cut .* or add 86400 s"):
        sample_time(t, row)
    with pytest.raises(CaseError, match="remove the repeated rows"):
        sample_time(np.r_[t[:50], t[:50]], row)
    counter = (65.5 + np.arange(300) / 1000.0) % 65.536
    with pytest.raises(CaseError, match="remove the repeated rows"):
        sample_time(1000 * counter, row)  # 16 bits of ms, read as s: 18 hours back


def test_a_clock_taken_as_recorded_keeps_its_stamps_and_splits_at_gaps():
    stamps = np.cumsum([0.0, 1e-3, 1.2e-3, 0.8e-3, 0.5, 1e-3])
    record = Recording(
        stamps, {"x": range(6)}, "a", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED
    )
    assert record.t.tolist() == stamps.tolist()
    assert record.dt == pytest.approx(1e-3)
    assert record.intervals == pytest.approx(np.diff(stamps))
    assert record.duration == pytest.approx(stamps[-1] + 1e-3)
    assert split_rows(record.t) == [slice(0, 4), slice(4, 6)]
    assert record.window(1e-3, 3e-3)["x"].tolist() == [1.0, 2.0]


def test_a_step_of_a_few_milliseconds_is_no_gap_however_fast_the_clock():
    """Stalls of 2 ms cut a record of 2 kHz into ninety stretches, none of them long enough."""
    steps = np.where(np.arange(200) % 50 == 25, 2.5e-3, 5e-4)
    assert split_rows(np.cumsum(steps)) == [slice(0, 200)]
    assert len(split_rows(np.cumsum(np.where(steps > 1e-3, 6e-3, 5e-4)))) == 5


def as_recorded(recording, rate, lost=()):
    """Return the record with its stamps taken as they are, at another rate and without some."""
    rows = np.setdiff1d(np.arange(300), lost)
    jitter = 2e-5 * np.random.default_rng(0).standard_normal(rows.size)
    channels = {name: recording[name][rows] for name in recording.names}
    return Recording(
        rows / rate + jitter, channels, "a", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED
    )


def test_a_lost_sample_does_not_make_a_clock_as_recorded_another_one(recording, bench):
    _check_clock(as_recorded(recording, 1000.0, lost=[150]), bench)


@pytest.mark.parametrize(
    "lateness",
    [
        lambda rng, N: rng.exponential(0.3e-3, N),
        lambda rng, N: np.where(np.arange(N) % 100 == 50, 1.6e-3, 0.0),  # it catches up
        lambda rng, N: np.where(np.arange(N) % 2 == 1, 0.6e-3, 0.0),
    ],
    ids=["all stamps", "stalls", "every second one"],
)
def test_stamps_that_come_late_and_catch_up_keep_the_clock(bench, lateness):
    t = np.arange(20000) / 1000.0
    late = np.maximum.accumulate(t + lateness(np.random.default_rng(1), t.size)) + 1e-9 * t
    channels = {name: np.sin(t) for name in ("u_P", "u_N", "p_P", "p_N", "x")}
    record = Recording(late, channels, "late", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED)
    _check_clock(record, bench)


def test_single_samples_that_come_late_and_do_not_catch_up_keep_the_clock(bench):
    """Now and then half a sample more lay between two rows: the mean was 0.3 % off."""
    rng = np.random.default_rng(2)
    steps = np.where(rng.uniform(size=20000) < 0.01, 1.4e-3, 1e-3)
    steps += 2e-5 * rng.standard_normal(steps.size)
    channels = {name: np.sin(np.cumsum(steps)) for name in ("u_P", "u_N", "p_P", "p_N", "x")}
    record = Recording(
        np.cumsum(steps), channels, "late", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED
    )
    _check_clock(record, bench)


@pytest.mark.parametrize(
    "steps",
    [
        lambda rng: np.where(rng.uniform(size=2000) < 0.4, 1.4e-3, 1e-3),  # 860 Hz
        lambda rng: np.diff(np.arange(301) / 980.0 + 1e-4 * rng.standard_normal(301)),
    ],
    ids=["two steps", "slow and scattered"],
)
def test_another_clock_is_refused_however_usual_one_of_its_steps_is(bench, steps):
    t = np.cumsum(steps(np.random.default_rng(3)))
    channels = {name: np.sin(t) for name in ("u_P", "u_N", "p_P", "p_N", "x")}
    record = Recording(t, channels, "other", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED)
    with pytest.raises(CaseError, match="the bench samples at 1000 Hz"):
        _check_clock(record, bench)


@pytest.mark.parametrize("rate", [990.0, 1010.0, 500.0])
def test_a_clock_as_recorded_of_another_frequency_is_refused(recording, bench, rate):
    with pytest.raises(CaseError, match=r"Hz, but the bench samples at 1000 Hz; correct `t` or"):
        _check_clock(as_recorded(recording, rate, lost=[150]), bench)


def test_stamps_that_count_from_1970_stay_apart_where_curves_are_stored():
    t = 1.7e9 + np.arange(50) / 1000.0
    x = {"measured": np.arange(50.0), "open loop": np.arange(50.0)}
    stored = json.loads(json.dumps(Curves("run", t, {"x": "m"}, {"x": 0.0}, {"x": x}).as_dict()))
    assert np.diff(curves_of(stored).t) == pytest.approx(1e-3, abs=1e-6)
