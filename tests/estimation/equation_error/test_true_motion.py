"""The motion behind sensors that are late: worked out once where nothing of theirs changes."""

import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, InputHold, NestedController, Recording
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error import true_motion
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.smoothed_motion import smooth_motion
from pneumo_casadi.model.servosystem import ForceAxis

DELAY = "position_delay.T"


@pytest.fixture(scope="module")
def model():
    bench = ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0))
    return BalanceFunctions(ForceAxis(bench).with_effects(EFFECTS["position_delay"]()))


@pytest.fixture(scope="module")
def data(model):
    t = np.arange(4000) / 1e3
    x = 0.1 * np.sin(2 * np.pi * t)
    record = Recording(t, {"F": 60 * x, "x": x}, "sine", "simulated", InputHold.ZERO)
    return smooth_motion(model.axis, record)


@pytest.fixture
def worked_out(monkeypatch):
    """How many motions have been worked out at once, call by call."""
    counts, before = [], true_motion._without_sensors
    monkeypatch.setattr(true_motion, "_last", type(true_motion._last)())
    monkeypatch.setattr(
        true_motion,
        "_without_sensors",
        lambda model, data, variants: counts.append(len(variants)) or before(model, data, variants),
    )
    return counts


def at(model, **values):
    names = {"delay": DELAY, "M": "M"}
    given = {names[name]: value for name, value in values.items()}
    return model.axis.parameters.with_values(given).values


def test_values_of_other_parameters_share_the_motion_behind_the_sensors(model, data, worked_out):
    ((x, dx),) = true_motion.true_motions(model, data, [at(model, delay=4e-3, M=18.0)])
    others = [at(model, delay=4e-3, M=M) for M in (10.0, 30.0)]
    for motion in true_motion.true_motions(model, data, others):
        assert motion[0] is x and motion[1] is dx
    assert worked_out == [1]


def test_another_delay_has_a_motion_of_its_own(model, data, worked_out):
    thetas = [at(model, delay=delay) for delay in (4e-3, 8e-3, 4e-3)]
    first, second, again = (true_motion.true_motions(model, data, [theta])[0] for theta in thetas)
    assert worked_out == [1, 1, 1]  # the last one alone is kept
    assert np.max(np.abs(first[0] - second[0])) > 1e-4
    assert np.array_equal(first[0], again[0])


def test_motions_of_a_difference_quotient_are_corrected_equally_often(model, data, worked_out):
    theta, moved = at(model, delay=4e-3), at(model, delay=4.001e-3)
    true_motion.true_motions(model, data, [theta])
    true_motion.true_motions(model, data, [theta, moved])
    assert worked_out == [1, 2]


def test_another_model_has_a_motion_of_its_own(model, data, worked_out):
    theta = at(model, delay=4e-3)
    others = [model, BalanceFunctions(model.axis), model]
    motions = [true_motion.true_motions(each, data, [theta])[0] for each in others]
    assert worked_out == [1, 1, 1]
    assert all(np.array_equal(motion[0], motions[0][0]) for motion in motions)


def test_a_sensor_that_feels_a_parameter_of_the_axis_moves_with_it(model, data, worked_out):
    """No effect of the catalogue does; one of a user may."""
    kind = type(model.axis.effects[0])

    class ByMass(kind):
        def output(self, y, at):
            late = super().output(y, at)["x"] - y["x"]
            return {**y, "x": y["x"] + late * at.axis["M"] / 18.0}

    axis = ForceAxis(model.axis.bench).with_effects(ByMass())
    felt = BalanceFunctions(axis)
    light, heavy = (
        true_motion.true_motions(felt, data, [at(felt, delay=4e-3, M=M)])[0] for M in (18.0, 36.0)
    )
    assert worked_out == [1, 1]
    assert np.max(np.abs(light[0] - heavy[0])) > 1e-4


def test_without_sensor_effects_the_motion_is_the_smoothed_one(model, data, worked_out):
    plain = BalanceFunctions(ForceAxis(model.axis.bench))
    ((x, dx),) = true_motion.true_motions(plain, data, [plain.axis.parameters.values])
    assert x is data.x and dx is data.dx and worked_out == []
