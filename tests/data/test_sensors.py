"""Sensors and chambers: what is odd but possible becomes a finding, not an error."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import (
    CascadeController,
    Grade,
    PidController,
    ProportionalController,
    Recording,
    SensorNoise,
    check_recording,
    check_records,
)
from pneumo_casadi.data.checks.continuity import check_continuity
from pneumo_casadi.data.checks.sensors import check_sensors
from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.errors import CaseError


def changed(recording: Recording, channel: str, rows: slice, value: float) -> Recording:
    values = recording[channel].copy()
    values[rows] = value
    return recording.with_channels({channel: values})


def test_a_good_record_earns_no_note(recording, bench):
    assert check_recording(recording, bench) == ()


def test_notes_are_logged(recording, bench, caplog):
    findings = check_records([changed(recording, "p_P", slice(100, 200), 4e5)], bench)
    assert [record.message for record in caplog.records] == [
        f"{finding.grade}: {finding.sentence}" for finding in findings
    ]


def test_a_sensor_that_sticks_for_a_while_is_noted_with_its_row(recording, bench):
    (finding,) = check_recording(changed(recording, "x", slice(100, 160), 0.02), bench)
    assert (
        "row 101: `x` stays at 0.02 m for 60 rows although its noise is 1.5e-05 m" in finding.text
    )


def test_a_still_channel_is_no_fault_where_the_noise_is_unknown(recording, bench):
    quiet = replace(bench, noise=None)
    assert check_recording(changed(recording, "x", slice(100, 160), 0.02), quiet) == ()


@pytest.mark.parametrize(("channel", "size"), [("p_P", 2.8e5), ("x", -0.02)])
def test_a_single_row_far_off_is_named_with_its_value(recording, bench, channel, size):
    value = recording[channel][2000] + size
    spoilt = changed(recording, channel, slice(2000, 2001), value)
    finding = check_recording(spoilt, bench)[0]
    assert (finding.name, finding.grade, finding.source) == ("spike", Grade.CAUTION, "identify")
    assert f"row 2001: `{channel}` = {value:.6g} " in finding.text
    assert "(1 such row)" in finding.text


def without_rows(recording, first, count):
    """The record as a logger leaves it that lost rows and numbers those that are left."""
    kept = np.delete(np.arange(recording.N), slice(first, first + count))
    channels = {name: recording[name][kept] for name in recording.names}
    t = recording.t[: kept.size]
    return Recording(t, channels, recording.name, recording.source, recording.hold)


@pytest.mark.parametrize("first", [600, 1500, 2500])
def test_rows_that_were_lost_show_though_the_clock_runs_on(recording, first):
    (finding,) = check_continuity(without_rows(recording, first, 40))
    assert (finding.name, finding.grade) == ("lost rows", Grade.CAUTION)
    assert f"row {first + 1}: within one row `x` by " in finding.text


def coarse(step):
    return lambda values: step * np.round(values / step)


HARMLESS = {
    "encoder of 0.1 mm": {"x": coarse(1e-4)},
    "encoder of 2 mm": {"x": coarse(2e-3)},
    "converter of 12 bits": {name: coarse(250.0) for name in ("p_P", "p_N")},
    "sensor read every 10th row": {"x": lambda x: np.repeat(x[::10], 10)[: x.size]},
    "sensor read every 50th row": {"x": lambda x: np.repeat(x[::50], 50)[: x.size]},
    "hit at an end stop": {"x": lambda x: np.clip(x, -0.02, 0.02)},
    "play of 1 mm": {"x": lambda x: np.clip(x, None, 0.03) + 1e-3 * (np.gradient(x) > 0)},
}
"""What real sensors and axes do; the play is rounded off by noise of the direction of motion."""


@pytest.mark.parametrize("name", [*HARMLESS])
def test_what_real_sensors_do_is_neither_a_spike_nor_lost_rows(recording, name):
    changes = {channel: change(recording[channel]) for channel, change in HARMLESS[name].items()}
    assert list(check_continuity(recording.with_channels(changes))) == []


@pytest.mark.parametrize("rows", [5, 20])
def test_coarse_sampling_is_neither_a_spike_nor_lost_rows(recording, rows):
    channels = {name: recording[name][::rows] for name in recording.names}
    slow = Recording(recording.t[::rows], channels, "slow", "simulated", recording.hold)
    assert list(check_continuity(slow)) == []


def test_pressure_edges_of_single_milliseconds_are_no_spikes(recording):
    """A chamber of a few millilitres fills within some rows at 1 kHz."""
    k = np.arange(recording.N)
    edge = 3e5 * (1 - np.exp(-np.maximum(k - 1000, 0) / 2.0)) * (k < 1800)
    assert list(check_continuity(recording.with_channels({"p_P": recording["p_P"] + edge}))) == []


def test_coarse_quantisation_is_noted_with_its_step(recording, bench):
    coarse = recording.with_channels({"p_N": 2e3 * np.round(recording["p_N"] / 2e3)})
    (finding,) = check_recording(coarse, bench)
    assert "`p_N` is quantised to 2e+03 Pa, more than its noise of 150 Pa" in finding.text


def test_a_record_too_short_to_tell_the_chambers_apart_says_so(recording, bench):
    (finding,) = check_recording(recording.window(0.0, 0.3), bench)
    assert "too short or too quiet to tell the chambers apart" in finding.text


def test_noise_alone_tells_no_chambers_apart(recording, bench):
    rng = np.random.default_rng(0)
    noise = bench.noise
    still = recording.with_channels(
        {
            "p_P": 4e5 + noise.p * rng.standard_normal(recording.N),
            "p_N": 5e5 + noise.p * rng.standard_normal(recording.N),
            "x": noise.x * rng.standard_normal(recording.N),
        }
    )
    assert any("too quiet to tell" in finding.text for finding in check_recording(still, bench))


def test_one_chamber_recorded_twice_is_refused(recording, bench):
    twice = recording.with_channels({"p_N": recording["p_P"] + 0.1})
    with pytest.raises(CaseError, match="the chambers contradict each other"):
        check_recording(twice, bench)


def test_small_motion_in_mm_is_told_by_the_control_law(recording, bench):
    """Motion of less than the stroke in metres when read in mm: only the law can tell."""
    small = {name: 1e3 * (1e-3 * recording[name]) for name in ("x", "x_ref")}
    commands = {"u_P": 1e-3 * recording["u_P"], "u_N": 1e-3 * recording["u_N"]}
    with pytest.raises(CaseError, match=r"`u_P` is 0\.001 times gain .*are `x` and `x_ref` in mm"):
        check_recording(recording.with_channels(small | commands), bench)


def test_commands_of_another_law_are_noted(recording, bench):
    other = replace(bench, controller=replace(bench.controller, gain=3.2))
    (finding,) = check_recording(recording, other)
    assert "differs from gain (x_ref − x) by 33 % rms" in finding.text


def test_noise_finer_than_the_data_is_quantisation(recording, bench):
    fine = replace(bench, noise=SensorNoise(p=150.0, x=1e-9))
    rounded = recording.with_channels({"x": np.round(recording["x"], 5)})
    noise, coarse = sorted(check_recording(rounded, fine), key=lambda finding: finding.name)[::-1]
    assert "`x` is quantised to 1e-05 m" in coarse.text and noise.name == "stated noise"


def test_an_encoder_that_only_rounds_has_no_noise_to_state(recording, bench):
    fine = replace(bench, noise=SensorNoise(p=150.0, x=1e-9))
    rounded = recording.with_channels({"x": np.round(recording["x"], 3)})
    assert "stated noise" not in {finding.name for finding in check_recording(rounded, fine)}


def held_back(recording, controller):
    """The record with the commands that a law gives on its positions."""
    law = ControlLaw(controller, recording.dt)
    x_ref, x = recording["x_ref"], recording["x"]
    u, _ = law.replay(x_ref, x, law.rest(x_ref[0], x[0], 0.0))
    return recording.with_channels(dict(zip(("u_P", "u_N"), u, strict=True)))


LAWS = [
    ProportionalController(2.4, 5.0, u_0=0.2),
    ProportionalController(2.4, 5.0, u_0=0.2, sample_time=5e-3),
    PidController(3.0, 0.2, k_i=2.0, k_d=0.05, derivative_filter=0.01, u_0=-0.1),
    CascadeController(4.0, 0.5, 5.0, k_i=1.0, velocity_filter=0.005, sample_time=4e-3),
]


@pytest.mark.parametrize("controller", LAWS)
def test_commands_are_held_against_the_law_that_is_stated(recording, bench, controller):
    record = held_back(recording, controller)
    law = ("u_P, controller", "u_P, u_N")
    right = check_sensors(record, replace(bench, controller=controller))
    assert not [finding for finding in right if finding.about in law]
    gain = "gain" if isinstance(controller, ProportionalController) else "k_p"
    other = replace(controller, **{gain: 0.7 * getattr(controller, gain)})
    wrong = check_sensors(record, replace(bench, controller=other))
    assert [finding.name for finding in wrong] == ["off the control law"]


def test_valves_that_are_not_opposed_about_the_null_voltage_are_named(recording, bench):
    record = held_back(recording, LAWS[0])
    apart = record.with_channels({"u_N": -record["u_P"]})
    findings = check_sensors(apart, replace(bench, controller=LAWS[0]))
    assert "valves not in opposition" in [finding.name for finding in findings]


def test_a_law_that_holds_its_commands_is_not_taken_for_a_late_one(recording, bench):
    slow = replace(bench, controller=ProportionalController(2.4, 5.0, sample_time=8e-3))
    record = held_back(recording, slow.controller)
    findings = check_recording(record, slow)
    assert "delay of u" not in [finding.name for finding in findings]
