"""A sensor of velocity or acceleration that contradicts the position is named."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import (
    ForceBench,
    Grade,
    InputHold,
    NoController,
    Recording,
    check_records,
    read_case,
)
from pneumo_casadi.virtual_bench import Laboratory, make_case

pytest.importorskip("numba")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensors") / "case"
    laboratory = Laboratory(v_noise=5e-3, a_noise=0.3)
    make_case(folder, 3, fs=1000.0, duration=4.0, laboratory=laboratory)
    return read_case(folder)


def findings_with(case, channel, change):
    record = case.identify[0]
    changed = record.with_channels({channel: change(record[channel])})
    names = {f"{what} of {channel}" for what in ("sensor", "zero")}
    return [f for f in check_records([changed], case.bench) if f.name in names]


def test_sensors_that_agree_raise_no_finding(case):
    assert not [finding for finding in case.findings if finding.about in ("v", "a")]
    assert not findings_with(case, "v", lambda v: 1.04 * v + 0.002)  # a certificate's own error


@pytest.mark.parametrize(
    ("channel", "change", "text", "entry"),
    [
        ("v", lambda v: 1e3 * v, "correct its unit", {"unit": "mm/s"}),
        ("v", lambda v: -v, "correct its sign", {"scale": -1.0}),
        ("v", lambda v: 1.3 * v, "correct its gain", None),
        ("a", lambda a: a / 9.80665, "correct its unit", {"unit": "g"}),
    ],
)
def test_a_sensor_that_contradicts_the_position_is_named_with_its_remedy(
    case, channel, change, text, entry
):
    (finding,) = findings_with(case, channel, change)
    assert finding.grade is Grade.SEVERE and text in finding.text
    (suggestion,) = finding.suggestion.values()
    if entry is not None:
        assert entry.items() <= suggestion.items()
    else:
        assert suggestion["scale"] == pytest.approx(1 / 1.3, rel=0.02)


@pytest.mark.parametrize(("channel", "zero"), [("v", 0.1), ("a", 0.3), ("a", -9.81)])
def test_a_zero_of_a_sensor_is_named_and_taken_off(case, channel, zero):
    (finding,) = findings_with(case, channel, lambda values: values + zero)
    assert finding.grade is Grade.SEVERE and "at rest" in finding.text
    (suggestion,) = finding.suggestion.values()
    assert suggestion["offset"] == pytest.approx(-zero, rel=0.1)


def test_the_remedy_of_a_unit_takes_the_zero_off_as_well(case):
    (finding,) = findings_with(case, "v", lambda v: 1e3 * (v + 0.1))
    (suggestion,) = finding.suggestion.values()
    assert suggestion["unit"] == "mm/s" and suggestion["offset"] == pytest.approx(-0.1, rel=0.1)


def test_another_channel_in_its_place_is_named(case):
    (finding,) = findings_with(case, "v", lambda v: np.roll(v, v.size // 3))
    assert "does not follow the derivative of `x`" in finding.text


def test_a_sensor_that_only_some_records_have_is_not_used(case, tmp_path):
    assert "v" in case.bench.signals
    assert replace(case.bench, signals=frozenset()).kind.outputs == ("p_P", "p_N", "x")


@pytest.mark.parametrize(
    ("channel", "factor", "unit"), [("v", 1e3, "mm/s"), ("v", -1.0, None), ("F_load", -1.0, None)]
)
def test_sensors_of_a_force_driven_axis_are_checked_too(channel, factor, unit):
    t = np.arange(4000) / 1000.0
    x = 0.1 * np.sin(2 * np.pi * t)
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    F_load = 20 * np.sin(2 * np.pi * 1.7 * t)
    F = 10 * a + 5 * v + 8 * np.sign(v) - F_load
    good = Recording(
        t, {"F": F, "x": x, "v": v, "F_load": F_load}, "good", "memory", InputHold.ZERO
    )
    bench = ForceBench(1000.0, None, NoController(), signals=frozenset({"v", "F_load"}))
    assert not check_records([good], bench)
    (finding,) = check_records([good.with_channels({channel: factor * good[channel]})], bench)
    (suggestion,) = finding.suggestion.values()
    assert finding.grade is Grade.SEVERE and finding.about == channel
    assert suggestion.get("unit") == unit and (unit or suggestion["scale"] == -1.0)
