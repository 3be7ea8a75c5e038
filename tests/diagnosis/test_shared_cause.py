"""Sensors that err by one amount, where the catalogue has no effect of what they share."""

from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis.decide.shared_cause import rather_one_cause
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.effects import EFFECTS, without_causes

OUTPUTS = ("p_P", "p_N", "x")
DELAYS = {
    "pressure_sensor_lag": "tau",
    "position_delay": "T",
    "pressure_sensor_second_order": "tau",
}
WITHOUT = without_causes(["valve_dynamics"])


def note(delays, std=1e-3, catalogue=WITHOUT, others=("hose",)):
    """Ask for effects with these delays [ms], each known to within `std`."""
    values = {f"{name}.{DELAYS[name]}": value / 1e3 for name, value in delays.items()}
    fitted = SimpleNamespace(values=values, std=dict.fromkeys(values, std))
    effects = [EFFECTS[name]() for name in (*delays, *others)]
    return rather_one_cause(effects, fitted, OUTPUTS, catalogue, CRITERIA)


def test_equal_delays_of_all_sensors_are_one_of_the_command():
    assert "7.5 ms: rather the command acts" in note(
        {"pressure_sensor_lag": 7.6, "position_delay": 7.4}
    )
    assert note({"pressure_sensor_second_order": 7.6, "position_delay": 6.5}, std=5e-5)  # forms


@pytest.mark.parametrize(
    ("delays", "given"),
    [
        ({"pressure_sensor_lag": 7.6, "position_delay": 4.0}, {}),  # not equal
        ({"pressure_sensor_lag": 7.6, "position_delay": 5.9}, {"std": 5e-5}),  # known to differ
        ({"pressure_sensor_lag": 7.6}, {}),  # the position is not late
        ({"position_delay": 7.6}, {}),
        ({}, {}),
        # A late valve was fitted as well, and was the worse.
        ({"pressure_sensor_lag": 7.6, "position_delay": 7.4}, {"catalogue": EFFECTS}),
    ],
)
def test_otherwise_sensors_are_late_themselves(delays, given):
    assert note(delays, **given) == ""


NO_SUPPLY = without_causes(["supply_droop"])


def note_on_offsets(b_P, b_N, std=0.5, catalogue=NO_SUPPLY, names=("pressure_sensor_bias",)):
    """Ask for offsets [kPa] of both pressure sensors."""
    values = {"pressure_sensor_bias.b_P": 1e3 * b_P, "pressure_sensor_bias.b_N": 1e3 * b_N}
    fitted = SimpleNamespace(values=values, std=dict.fromkeys(values, 1e3 * std))
    effects = [EFFECTS[name]() for name in names]
    return rather_one_cause(effects, fitted, OUTPUTS, catalogue, CRITERIA)


def test_equal_offsets_of_both_pressures_are_one_of_the_supply():
    assert "-12.0 kPa: rather the supply" in note_on_offsets(-12.5, -11.5)
    assert note_on_offsets(20.0, 17.0)  # a fifth apart
    assert note_on_offsets(3.0, 1.0, std=1.5)  # not known to differ


@pytest.mark.parametrize(
    ("b_P", "b_N", "given"),
    [
        (-12.5, -9.0, {}),  # not equal
        (0.5, -0.5, {"std": 2.0}),  # of two signs
        (-25.0, 12.5, {}),
        (-12.5, -11.5, {"names": ("stribeck",)}),
        (-12.5, -11.5, {"catalogue": EFFECTS}),  # a supply that droops was fitted as well
    ],
)
def test_otherwise_sensors_have_offsets_themselves(b_P, b_N, given):
    assert note_on_offsets(b_P, b_N, **given) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "rather_the_command"),
    [
        ({"valve_dynamics": "medium"}, True),
        ({"position_delay": "large", "pressure_sensor_lag": "small"}, False),
    ],
)
def test_a_slow_valve_gives_all_sensors_one_delay(made_case, hidden, rather_the_command):
    study, _ = prepare_study(made_case(12, 2.0, **hidden))
    effects = EFFECTS["pressure_sensor_lag"](), EFFECTS["position_delay"]()
    fitted = fit_model(study, effects, fit_model(study, ()).values)
    assert bool(rather_one_cause(effects, fitted, OUTPUTS, WITHOUT, CRITERIA)) is rather_the_command


@pytest.mark.parametrize("name", ["hose_travel_time", "hose_travel_time_per_chamber"])
def test_all_flow_that_is_late_may_be_a_late_command(name):
    assert "all flow would arrive late" in note({}, others=(name,))
    assert not note({}, others=(name,), catalogue=EFFECTS)
    assert not note({}, others=("hose_per_chamber",))
