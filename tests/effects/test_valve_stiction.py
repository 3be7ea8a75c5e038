"""A spool that sticks and jumps: the same law in simulations, along records, and in a fit."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.effects import EFFECTS, ValveStiction
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.driven_states import states_along
from pneumo_casadi.export import linearise, write_c, write_functions
from pneumo_casadi.export.casadi_functions import read_functions
from pneumo_casadi.export.model import IdentifiedModel
from pneumo_casadi.model.simulation import simulate

H, Z, DT = 0.07, 0.4, 1e-3


def sticking(u, h, z):
    """The law of a spool, written as a loop: where it is before each command."""
    s, before = u[0] + z * h, []
    for command in u:
        before.append(s)
        s = command if abs(command - s) > h else s
    return np.array(before)


@pytest.fixture(scope="module")
def axis(made):
    values = {"valve_stiction.h": H, "valve_stiction.z_P": Z, "valve_stiction.z_N": -Z}
    return made.true_axis(ValveStiction()).with_parameters(values)


@pytest.fixture(scope="module")
def run(axis):
    t = np.arange(3000) * DT
    u = 0.8 * np.sin(2 * np.pi * (0.7 + 0.4 * t) * t) + 0.02 * np.sin(900 * t)
    start = axis.rest([4e5, 4.5e5, 0.0, 0.0], [u[0], -u[0]], axis.parameters.values)
    return simulate(axis, np.column_stack([u, -u]), DT, start.full().ravel())


def test_a_simulation_moves_each_spool_from_sample_to_sample_alone(run):
    for chamber, z in (("P", Z), ("N", -Z)):
        expected = sticking(run[f"u_{chamber}"], H, z)
        np.testing.assert_array_equal(run[f"valve_stiction.s_{chamber}"], expected)
        assert 50 < np.count_nonzero(np.diff(expected)) < 500


def test_along_a_record_the_spool_remembers_what_filters_have_taken(axis, run):
    channels = {name: run[name] for name in ("u_P", "u_N", "p_P", "p_N", "x")}
    record = Recording(run.t, channels, "sines", "simulated", InputHold.ZERO)
    (states,) = states_along(axis, [record])
    first, last = 60, 2900  # the filters take less at either end
    for row, (chamber, z) in zip(states, (("P", Z), ("N", -Z)), strict=True):
        expected = sticking(run[f"u_{chamber}"], H, z)
        np.testing.assert_array_equal(row[first:last], expected[first:last])


def test_a_threshold_is_found_though_the_cost_is_a_staircase(made_case):
    study, _ = prepare_study(made_case(47, 8.0, valve_hysteresis_stiction={"width": 0.12}))
    nominal = fit_model(study, ())
    stuck = fit_model(study, (EFFECTS["valve_stiction"](),), nominal.values)
    play = fit_model(study, (EFFECTS["valve_hysteresis"](),), nominal.values)
    assert stuck.values["valve_stiction.h"] == pytest.approx(0.06, rel=0.02)
    assert stuck.cost < play.cost - 500 < nominal.cost - 1000


def test_equations_of_continuous_time_are_refused_and_a_step_is_written(axis, run, tmp_path):
    model = IdentifiedModel(axis, DT)
    with pytest.raises(ModelError, match=r"valve_stiction.s_P.*jump from sample to sample.*casadi"):
        linearise(axis)
    with pytest.raises(ModelError, match="C code"):
        write_c(model, tmp_path)
    write_functions(model, tmp_path)
    step = read_functions(tmp_path).step.mapaccum(200)
    u = np.column_stack([run["u_P"], run["u_N"]])
    states = step(run.x[:, 0], u[:200].T).full()
    np.testing.assert_array_equal(states[-2:], run.x[-2:, 1:201])
