"""A model survives its file; what a file cannot hold, or should not, is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import Load
from pneumo_casadi.effects import EFFECTS, ValveMismatch
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.export import IdentifiedModel, identified_model, read_model, write_model
from pneumo_casadi.export.model import balanced_state
from pneumo_casadi.identification.model_file import axis_dict, axis_from_dict
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import fit_iso6358, fit_iso6358_curve


def same(result, axis, rng):
    """Whether two axes have the same equations, tried at a random state."""
    motion = np.array([3e5, 4e5, 0.05, 0.2][-len(axis.motion_states) :])
    x = np.concatenate([motion, rng.normal(size=len(axis.states) - motion.size)])
    x *= 1 + 0.01 * rng.normal(size=x.size)
    u, theta = rng.uniform(0.2, 1.0, len(axis.inputs)), axis.parameters.values
    assert result.states == axis.states and result.parameters.names == axis.parameters.names
    assert np.array_equal(result.parameters.values, theta)
    for name in ("rhs", "output"):
        both = [getattr(a, name)(x, u, theta).full() for a in (result, axis)]
        assert np.array_equal(*both, equal_nan=True)
    return True


def through_json(axis):
    return axis_from_dict(json.loads(json.dumps(axis_dict(axis), allow_nan=False)))


def test_every_kind_of_axis_survives(model):
    assert same(through_json(model.axis), model.axis, np.random.default_rng(0))


@pytest.mark.parametrize("fit", [fit_iso6358, fit_iso6358_curve])
def test_a_valve_of_iso_6358_survives(made, fit):
    axis = Servosystem(made.BENCH, fit(made.smooth_map()))
    result = through_json(axis)
    assert same(result, axis, np.random.default_rng(1))
    assert np.array_equal(result.flow.covariance, axis.flow.covariance)


@pytest.mark.parametrize(
    ("fit", "lost"), [(fit_iso6358, "h_supply"), (fit_iso6358_curve, "k_3_exhaust")]
)
def test_a_valve_of_iso_6358_without_one_of_its_parameters_is_told(made, fit, lost):
    content = axis_dict(Servosystem(made.BENCH, fit(made.smooth_map())))
    flow = content["flow"]
    at = flow["parameters"].index(lost)
    flow["parameters"].remove(lost)
    flow["covariance"] = np.delete(np.delete(np.array(flow["covariance"]), at, 0), at, 1).tolist()
    with pytest.raises(CaseError, match=f"not those of an ISO 6358 valve.*'{lost}'"):
        axis_from_dict(content)


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_of_the_catalogue_survives(made, name):
    effect = EFFECTS[name]()
    make = made.true_force_axis if "drive" in effect.junctions else made.true_axis
    axis = make(effect).at_starting_values()
    assert same(through_json(axis), axis, np.random.default_rng(2))


def test_bounds_and_freedom_survive(made):
    axis = made.free_only(made.true_axis(ValveMismatch()), "M")
    axis = axis.with_parameters(axis.parameters.bounded("M", 10.0, np.inf))
    for item, expected in zip(through_json(axis).parameters, axis.parameters, strict=True):
        for part in ("name", "value", "unit", "lower", "upper", "scale", "free", "null"):
            assert getattr(item, part) == getattr(expected, part)


def test_an_effect_of_ones_own_is_refused_with_the_way_out(made):
    with pytest.raises(ModelError, match=r"valve_lag is not of the catalogue.*export functions, C"):
        axis_dict(made.true_axis(made.ValveLag()))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("bench"), r"missing key `model\.bench`"),
        (lambda c: c["bench"].update(stroke_m=250.0), "`stroke_m`: expected m between"),
        (lambda c: c["parameters"].pop("M"), "do not match the axis: M"),
        (
            lambda c: c["parameters"]["M"].update(value="heavy"),
            r"`model\.parameters\.M\.value`: expected",
        ),
        (lambda c: c["parameters"]["M"].update(value=-1.0), "outside its bounds"),
        (lambda c: c.update(effects=["os.system"]), "'os.system' is not of the catalogue"),
        (lambda c: c["flow"].update(form="__import__"), "'__import__'; known are polynomials"),
        (lambda c: c["flow"].update(degrees=[3, 3]), r"`model\.flow\.degrees`: expected a list"),
        (lambda c: c.update(flow=None), "a servo axis needs the static flow"),
    ],
)
def test_what_is_no_model_is_told(models, change, message):
    content = axis_dict(models["nominal"].axis)
    change(content)
    with pytest.raises(CaseError, match=message):
        axis_from_dict(content)


def test_a_spline_that_is_none_is_told(models):
    content = axis_dict(models["spline"].axis)
    content["flow"]["knots_p"] = content["flow"]["knots_p"][:3]
    with pytest.raises(CaseError, match="no model of an axis"):
        axis_from_dict(content)


def test_a_result_holds_the_model_and_where_it_comes_from(quick, tmp_path):
    write_json(result_dict(quick), tmp_path / "result.json")
    model = read_model(tmp_path)
    assert same(model.axis, quick.axis, np.random.default_rng(3))
    assert model.dt == 1 / quick.case.bench.sampling_frequency
    assert model.provenance.keys() >= {"versions", "platform", "seeds", "sha256", "options"}
    assert {"identify.csv.gz", "flow_map.csv", "bench.json"} <= model.provenance["sha256"].keys()
    assert model.estimates["M"]["std"] == quick.output_error.std("M")
    assert identified_model(quick).estimates == model.estimates


def test_an_exported_model_is_read_back_as_it_was(quick, tmp_path):
    model = identified_model(quick)
    read = read_model(write_model(model, tmp_path / "new"))
    assert same(read.axis, model.axis, np.random.default_rng(4))
    assert (read.name, read.dt) == (model.name, model.dt)
    assert (read.provenance, read.estimates) == (model.provenance, model.estimates)


def test_a_report_without_a_model_says_what_to_do(tmp_path):
    with pytest.raises(CaseError, match=r"result\.json: no such file"):
        read_model(tmp_path)
    (tmp_path / "result.json").write_text('{"format": 1}')
    with pytest.raises(CaseError, match=r"result\.json: holds no `model`.*identify anew"):
        read_model(tmp_path)
    (tmp_path / "result.json").write_text("not JSON")
    with pytest.raises(CaseError, match="not a readable JSON file"):
        read_model(tmp_path)


def test_an_impossible_sampling_period_is_refused(models):
    with pytest.raises(ModelError, match="sampling period -1"):
        IdentifiedModel(models["force"].axis, -1.0)


@pytest.mark.parametrize(
    ("load", "M"),
    [
        (Load(), 17.0),
        (Load(angle_deg=90.0), 17.0),
        (Load(angle_deg=-90.0), 17.0),
        (Load(angle_deg=90.0), 40.0),  # more than chamber N half-way up balances
        (Load(force=250.0), 17.0),
    ],
)
def test_at_the_start_pressures_balance_the_load(made, load, M):
    axis = made.true_axis().with_parameters({"M": M})
    axis = replace(axis, bench=replace(made.BENCH, load=load))
    x = balanced_state(axis)
    (left,) = axis.driving_force(x[:, None], axis.inputs_at_rest[:, None])
    assert left == pytest.approx(0.0, abs=1e-9)
    assert np.all((x[:2] >= made.P_EXT) & (x[:2] <= made.P_SUPPLY))
