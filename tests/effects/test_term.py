"""A discovered term as a file, a formula and an effect."""

import json
import pickle

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.data import ForceBench, NestedController
from pneumo_casadi.effects.term import (
    FORMULAS,
    Term,
    read_catalogue,
    read_term,
    term_effect,
    write_term,
    write_term_source,
)
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.servosystem import ForceAxis
from pneumo_casadi.model.simulation import simulate

VALUES = {
    "level": 0.5,
    "slope": 2.0,
    "square": -3.0,
    "cube": 4.0,
    "height": 1.5,
    "vertex": 0.1,
    "edge": 0.05,
    "centre": 0.02,
    "width": 0.03,
    "decay": 0.4,
    "amplitude": 2.5,
    "phase": 0.3,
    "period": 0.02,
}


def term(formula="sine", **changes):
    parameters = {name: VALUES[name] for name in FORMULAS[formula].parameters}
    given = {"name": "cogging", "balances": ("force",), "factor": "1", "driver": "x"} | changes
    return Term(**given, formula=formula, parameters=parameters)


@pytest.mark.parametrize("name", FORMULAS)
def test_a_formula_is_the_same_for_numbers_and_symbols(name):
    d = np.linspace(-0.2, 0.2, 9)
    parameters = term(name).parameters
    symbol = ca.SX.sym("d")
    f = ca.Function("f", [symbol], [FORMULAS[name].value(ca, symbol, parameters)])
    expected = FORMULAS[name].value(np, d, parameters)
    assert np.ptp(expected) > 0 or name == "constant"
    assert np.array(f(d[None, :])).ravel() == pytest.approx(expected)


@pytest.mark.parametrize("name", FORMULAS)
def test_the_coefficients_alone_make_a_term_vanish(name):
    effect = term_effect(term(name))()
    null = {item.name: item.null for item in effect.parameters}
    assert not np.any(FORMULAS[name].value(np, np.linspace(-0.2, 0.2, 9), null))


def test_a_term_survives_its_file(tmp_path):
    assert read_term(write_term(term(), tmp_path / "term.json")) == term()


def test_source_written_for_a_term_gives_its_effect(tmp_path):
    made = read_catalogue(write_term_source(term(), tmp_path / "term.py"))
    assert made["cogging"]().equation == term().text


def test_a_term_as_data_is_a_catalogue_of_one_effect(tmp_path):
    assert list(read_catalogue(write_term(term(), tmp_path / "term.json"))) == ["cogging"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("term.txt", "", "a catalogue is a"),
        ("none.py", "x = 1\n", "define EFFECTS"),
        ("wrong.py", "EFFECTS = {'a': int}\n", "must be an effect class"),
    ],
)
def test_a_file_without_effects_is_refused(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text, "utf-8")
    with pytest.raises(ModelError, match=f"{name}: .*{message}"):
        read_catalogue(path)


def test_an_effect_of_a_term_can_be_sent_to_another_process():
    effect = term_effect(term())()
    assert pickle.loads(pickle.dumps(effect)).parameters == effect.parameters


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("driver", "colour", "no driver 'colour'"),
        ("formula", "spiral", "no formula 'spiral'"),
        ("factor", "q_m", "no factor 'q_m'"),
        ("driver", "u", "driver 'u' does not exist in force"),
        ("name", "two words", "must be an identifier"),
        ("parameters", {"amplitude": "__import__('os')"}, "must hold a number"),
        ("parameters", {"amplitude": 1.0}, "needs the parameters amplitude, phase, period"),
    ],
)
def test_a_file_that_is_no_term_is_refused_by_name(tmp_path, key, value, message):
    path = write_term(term(), tmp_path / "term.json")
    path.write_text(json.dumps(json.loads(path.read_text("utf-8")) | {key: value}), "utf-8")
    with pytest.raises(ModelError, match=f"term.json.*{message}"):
        read_term(path)


def test_time_as_a_driver_is_a_state_that_grows_with_it():
    bench = ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0))
    push = Term("push", ("force",), "1", "t", "line", {"slope": 3.0})
    axis = ForceAxis(bench).with_effects(term_effect(push)()).at_starting_values()
    free = {"M": 2.0, "f_v": 0.0, "F_c_plus": 0.0, "F_c_minus": 0.0}
    t = np.arange(1000) / 1e3
    run = simulate(axis.with_parameters(free), 0 * t[:, None], 1e-3, [0.0, 0.0, 0.0])
    assert run["x"][-1] == pytest.approx(3.0 / 2.0 * t[-1] ** 3 / 6, rel=1e-3)


SHIFTS = [
    (("mass_flow_P",), "dq_m/du", (1, 0)),
    (("mass_flow_N",), "dq_m/du", (0, 1)),
    (("mass_flow_P", "mass_flow_N"), "dq_m/du", (1, 1)),
    (("mass_flow_P", "mass_flow_N"), "±dq_m/du", (1, -1)),
]


@pytest.mark.parametrize(("balances", "factor", "signs"), SHIFTS)
def test_a_shifted_command_survives_a_file_and_moves_the_spool(
    made, tmp_path, balances, factor, signs
):
    own = term("constant", balances=balances, factor=factor, driver="t")
    write_term(own, tmp_path / "term.json")
    write_term_source(own, tmp_path / "term.py")
    assert read_term(tmp_path / "term.json") == own
    (made_of,) = read_catalogue(tmp_path / "term.py").values()
    plain = made.true_axis()
    x, u = [4e5, 5e5, 0.0, 0.1], np.array([1.0, -1.5])
    moved = plain.rhs(x, u + 0.5 * np.array(signs), plain.parameters.values).full()
    for effect in (term_effect(own)(), made_of()):
        axis = made.true_axis(effect).at_starting_values()
        full = axis.rest(x, u, axis.parameters.values)
        assert axis.rhs(full, u, axis.parameters.values).full()[:4] == pytest.approx(moved)
    assert own.text.startswith("u_") and own.unit == "V"


@pytest.mark.parametrize("factor", ["dq_m/du", "p_supply"])
def test_what_acts_on_both_ports_has_no_driver_of_one_chamber(factor):
    with pytest.raises(ModelError, match="driver 'u' does not exist"):
        term("line", balances=("mass_flow_P", "mass_flow_N"), factor=factor, driver="u")
