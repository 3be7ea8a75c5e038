"""Windows, splits, thinning and alignment: nothing lost, nothing twice, inputs as they were."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.data import Clock, Column, InputHold, Recording
from pneumo_casadi.data.readers.recordings import read_stretches
from pneumo_casadi.errors import CaseError


def ramp(rows, dt=0.01, hold=InputHold.ZERO):
    k = np.arange(rows, dtype=float)
    return Recording(k * dt, {"u": k, "y": -k}, "ramp", "memory", hold, first_line=2)


@pytest.mark.slow
@given(st.integers(2, 300), st.data())
def test_parts_hold_every_row_once_and_in_order(rows, data):
    recording = ramp(rows)
    parts = recording.split(data.draw(st.integers(1, rows // 2)))
    assert np.array_equal(np.concatenate([part["u"] for part in parts]), recording["u"])
    assert max(part.N for part in parts) - min(part.N for part in parts) <= 1


@given(st.integers(2, 300), st.integers(2, 320))
def test_a_split_by_duration_holds_every_row_once_and_in_order(rows, length):
    recording = ramp(rows)
    parts = recording.split(duration=length * recording.dt)
    assert np.array_equal(np.concatenate([part["u"] for part in parts]), recording["u"])
    assert all(length == part.N for part in parts[:-1])
    assert 2 <= parts[-1].N <= length + 1


@given(st.integers(4, 200), st.data())
def test_windows_that_share_an_end_share_no_row(rows, data):
    recording = ramp(rows)
    cut = data.draw(st.integers(2, rows - 2))
    time = cut * recording.dt
    before, after = recording.window(0.0, time), recording.window(time, 1e9)
    assert np.array_equal(np.concatenate([before["u"], after["u"]]), recording["u"])
    assert after["u"][0] == cut and after.t[0] == recording.t[cut]


@given(st.integers(3, 200), st.data())
def test_thinning_keeps_exact_samples(rows, data):
    n = data.draw(st.integers(1, (rows - 1)))
    thin = ramp(rows).decimate(n)
    assert np.array_equal(thin["u"], np.arange(0, rows, n))
    assert thin.dt == pytest.approx(n * 0.01)


def test_an_averaged_input_carries_the_integral_of_the_held_one():
    recording = ramp(10)
    thin = recording.decimate(4, average=["u"])
    assert np.array_equal(thin["u"], [1.5, 5.5, 8.5]) and np.array_equal(thin["y"], [0, -4, -8])


@given(st.integers(12, 100), st.integers(-5, 5), st.integers(-5, 5))
def test_alignment_undoes_delays_and_keeps_the_common_rows(rows, late_u, late_y):
    k = np.arange(rows, dtype=float)
    measured = Recording(k, {"u": k - late_u, "y": k - late_y, "z": k}, "a", "m", InputHold.ZERO)
    aligned = measured.aligned({"u": late_u, "y": late_y})
    for name in ("u", "y", "z"):
        assert np.array_equal(aligned[name], aligned.t.round(9))
    assert rows - (max(0, late_u, late_y) - min(0, late_u, late_y)) == aligned.N


def test_one_channel_shifts_as_alignment_does():
    recording = ramp(20)
    assert np.array_equal(recording.shifted("y", 3)["y"], recording.aligned({"y": 3})["y"])
    assert np.array_equal(recording.shifted("y", 3)["y"], recording["y"][3:])


def test_inputs_are_neither_changed_nor_kept():
    t, u = np.arange(10) * 0.1, np.arange(10.0)
    before = t.copy(), u.copy()
    recording = Recording(t, {"u": u}, "a", "memory", InputHold.ZERO)
    recording.split(2), recording.shifted("u", 1), recording.decimate(2, average=["u"])
    assert np.array_equal(t, before[0]) and np.array_equal(u, before[1])
    u[0] = 99.0
    assert recording["u"][0] == 0.0


def test_a_recording_cannot_be_written_to():
    recording = ramp(10)
    for array in (recording.t, recording["u"], recording.window(0, 0.05)["u"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(TypeError):
        recording.channels["u"] = recording["y"]
    with pytest.raises(AttributeError):
        recording.dt = 1.0


def test_pieces_know_the_lines_of_the_file_they_came_from():
    piece = ramp(100).window(0.5, 0.7)
    assert piece.where(0) == "memory: row 1 (line 52)"
    assert piece.decimate(2).where(0) == "memory: row 1"


def test_pieces_keep_hold_and_sample_time():
    recording = ramp(100, hold=InputHold.LINEAR)
    for piece in (*recording.split(7), recording.window(0.1, 0.3), recording.shifted("u", 2)):
        assert piece.hold is InputHold.LINEAR and piece.dt == recording.dt


def test_a_recording_survives_pickling():
    recording = ramp(50)
    copy = pickle.loads(pickle.dumps(recording))
    assert np.array_equal(copy["u"], recording["u"]) and copy.dt == recording.dt
    assert not copy["u"].flags.writeable


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda rec: rec["q"], "memory: no channel `q`; there are u, y"),
        (lambda rec: rec.window(5.0, 6.0), "0 rows; the record covers 0 s to 0.49 s"),
        (lambda rec: rec.split(26), "50 rows do not give 26 parts"),
        (lambda rec: rec.split(), "a number of parts or by a duration"),
        (lambda rec: rec.split(duration=0.001), "less than two rows"),
        (lambda rec: rec.decimate(0), "cannot keep every 0-th of 50 rows"),
        (lambda rec: rec.decimate(2.5, ()), "every 2.5-th of 50 rows; give a whole number from 1"),
        (lambda rec: rec.window(np.nan, 2), "ramp: a window at nan s; give times on its clock"),
        (lambda rec: rec.aligned({"u": 0.5}), "`u` by 0.5 rows; shift by whole rows"),
        (lambda rec: rec.shifted("u", 49), "50 rows are too few for shifts"),
        (lambda rec: rec.with_channels({"z": [1.0]}), r"`z` has shape \(1,\), expected \(50,\)"),
        (lambda rec: Recording([0, 1], {}, "a", "m", "zero"), "state InputHold.ZERO or .LINEAR"),
        (lambda rec: Recording([0], {}, "a", "m", InputHold.ZERO), "at least 2"),
    ],
)
def test_what_cannot_be_cut_says_why(ask, message):
    with pytest.raises(CaseError, match=message):
        ask(ramp(50))


def test_a_window_without_end_goes_to_the_end_of_the_record():
    assert ramp(50).window(0.4, np.inf).N == 10


def test_a_copy_without_some_channels_keeps_the_rest():
    recording = ramp(20)
    fewer = recording.without({"y", "z"})
    assert fewer.names == ("u",) and fewer.name == recording.name
    assert np.array_equal(fewer["u"], recording["u"]) and np.array_equal(fewer.t, recording.t)
    assert fewer.where(3) == recording.where(3)
    assert recording.without({"z"}) is recording


def test_delays_are_undone_within_each_stretch_between_gaps():
    t = np.r_[np.arange(100), np.arange(100) + 600] * 1e-3
    rows = np.arange(200.0)
    gapped = Recording(
        t, {"u": rows, "y": rows}, "a", "memory", InputHold.ZERO, clock=Clock.AS_RECORDED
    )
    aligned = gapped.aligned({"y": 2})
    assert np.array_equal(aligned["y"], aligned["u"] + 2)
    assert aligned["u"].tolist() == [*range(98), *range(100, 198)]
    assert np.array_equal(aligned.t, t[aligned["u"].astype(int)])


def test_late_columns_of_a_file_are_aligned_between_its_gaps(tmp_path):
    t = np.r_[np.arange(100), np.arange(100) + 600] * 1e-3
    lines = [f"{t[k]:.4f},{k},{k}" for k in range(200)]
    (tmp_path / "run.csv").write_text("\n".join(["t_s,u,x_m", *lines]) + "\n", "utf-8")
    columns = {"u": Column("u", rows_late=3)}
    content = read_stretches(tmp_path / "run.csv", InputHold.ZERO, columns, Clock.AS_RECORDED)
    first, second = content.stretches
    assert (first["u_P"][-1], first["x"][-1], first.N) == (99.0, 96.0, 97)
    assert (second["u_P"][0], second["x"][0], second.first_line) == (103.0, 100.0, 102)


@pytest.mark.parametrize(
    "change",
    [
        lambda rec: rec.window(1.7e9 + 0.1, 1.7e9 + 0.9),
        lambda rec: rec.split(3)[1],
        lambda rec: rec.aligned({"x": 1}),
        lambda rec: rec.with_channels({"y": rec["x"]}),
    ],
    ids=["window", "split", "aligned", "with_channels"],
)
def test_stamps_that_count_from_1970_at_5_khz_are_cut_and_aligned(change):
    t = 1.7e9 + np.arange(5000) / 5000.0
    recording = Recording(t, {"x": np.arange(5000.0)}, "a", "memory", InputHold.ZERO)
    assert change(recording).dt == recording.dt
