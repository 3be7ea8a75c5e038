"""A spool that sticks and jumps: the same law in simulations, along records, and in a fit."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.prepare_study import prepare_study
from pneumo_casadi.effects import EFFECTS, ValveStiction
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error.driven_states import states_along
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.estimation.output_error.stages import write_problem
from pneumo_casadi.export import linearise, write_c, write_functions
from pneumo_casadi.export.casadi_functions import read_functions
from pneumo_casadi.export.model import IdentifiedModel
from pneumo_casadi.identification.starting_axis import refuse_unscanned
from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.model.simulation import simulate
from pneumo_casadi.parameters import Parameter

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
    u = 0.8 * np.sin(2 * np.pi * (2.5 + 0.4 * t) * t) + 0.02 * np.sin(900 * t)
    start = axis.rest([4e5, 4.5e5, 0.0, 0.0], [u[0], -u[0]], axis.parameters.values)
    return simulate(axis, np.column_stack([u, -u]), DT, start.full().ravel())


def recorded(run):
    channels = {name: run[name] for name in ("u_P", "u_N", "p_P", "p_N", "x")}
    return Recording(run.t, channels, "sines", "simulated", InputHold.ZERO)


def test_a_simulation_moves_each_spool_from_sample_to_sample_alone(run):
    for chamber, z in (("P", Z), ("N", -Z)):
        expected = sticking(run[f"u_{chamber}"], H, z)
        np.testing.assert_array_equal(run[f"valve_stiction.s_{chamber}"], expected)
        assert 50 < np.count_nonzero(np.diff(expected)) < 500


def test_along_a_record_the_spool_remembers_what_filters_have_taken(axis, run):
    (states,) = states_along(axis, [recorded(run)])
    last = 2900  # the filters take less
    for row, (chamber, z) in zip(states, (("P", Z), ("N", -Z)), strict=True):
        expected = sticking(run[f"u_{chamber}"], H, z)
        np.testing.assert_array_equal(row[:last], expected[:last])


@pytest.mark.slow
def test_a_threshold_is_found_though_the_cost_is_a_staircase(made_case):
    study, _ = prepare_study(made_case(47, 4.0, valve_hysteresis_stiction={"width": 0.12}))
    nominal = fit_model(study, ())
    stuck = fit_model(study, (EFFECTS["valve_stiction"](),), nominal.values)
    play = fit_model(study, (EFFECTS["valve_hysteresis"](),), nominal.values)
    assert stuck.values["valve_stiction.h"] == pytest.approx(0.06, rel=0.02)
    assert stuck.cost < play.cost - 250 < nominal.cost - 500


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


def test_windows_of_a_record_start_where_the_spool_is(axis, run):
    record = recorded(run)
    options = OutputErrorOptions(window=0.5, widths=(axis.parameters["v_s"].value,))
    held = axis.with_parameters(axis.parameters.fix(*axis.flow_parameters))
    problem = write_problem(held, [record], None, options)
    rows = [axis.states.index(f"valve_stiction.s_{c}") for c in "PN"]
    for segment in problem.segments:
        expected = run.x[rows, segment.first]
        np.testing.assert_array_equal(segment.x[rows, 0], expected)


def test_commands_that_are_no_longer_single_are_refused(axis, run):
    faster = Recording(run.t / 5, recorded(run).channels, "sines", "simulated", InputHold.ZERO)
    linear = Recording(run.t, recorded(run).channels, "sines", "simulated", InputHold.LINEAR)
    for record in (faster, linear):
        with pytest.raises(
            ModelError, match=r"sines: valve_stiction.s_P.*clock of less than 2 kHz"
        ):
            states_along(axis, [record])


def test_what_only_a_diagnosis_finds_must_be_given_to_identify(axis):
    with pytest.raises(ModelError, match=r"z_N, valve_stiction.h: found by scans .*diagnose"):
        refuse_unscanned(axis, {"valve_stiction.z_P": 0.0})
    refuse_unscanned(axis, {f"valve_stiction.{name}": 0.0 for name in ("h", "z_P", "z_N")})


H_FREE = Parameter("h", 0.0, "V", null=0.0)
S = State("s", "V", sampled=True)


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"staircase": ("h",), "stairs": dict}, "h in staircase, needs free=False"),
        ({"staircase": ("h",), "parameters": (replace(H_FREE, free=False),)}, "override `stairs`"),
        ({"states": (S,)}, "override `renewed`"),
        ({"states": (replace(S, clock=True),), "renewed": dict}, "a clock is no sampled state"),
    ],
)
def test_a_wrong_declaration_is_refused(declared, message):
    with pytest.raises(ModelError, match=message):
        type("Own", (Effect,), {"name": "own", "parameters": (H_FREE,), **declared})


@pytest.mark.parametrize(
    ("method", "given"), [("renewed", {}), ("rates", {"s": 1.0}), ("rest", {"t": 0.0})]
)
def test_states_that_are_missing_or_do_not_belong_are_named(made, method, given):
    methods = {"renewed": {"s": 0.0}, "rates": {}, "rest": {"s": 0.0}, method: given}
    laws = {name: lambda self, e, at, v=values: v for name, values in methods.items()}
    own = type("Own", (Effect,), {"name": "own", "states": (S,), **laws})
    with pytest.raises(ModelError, match=f"effect own: `{method}` returns"):
        made.true_axis(own()).rhs.name()
