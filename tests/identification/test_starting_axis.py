"""Effects added to an identification, parameters held, and where output error starts."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import read_case
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.read_result import read_axis, read_options
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.starting_axis import (
    axis_for_wls,
    axis_of_options,
    catalogue_effect,
    start_of_output_error,
)
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import FlowForm

FORM = {"flow_form": FlowForm.POLYNOMIALS}


@pytest.fixture(scope="module")
def case(embedded):
    """Return two seconds of the embedded record at 1 kHz, a fifth of its samples."""
    whole = read_case(embedded, check=False)
    record = whole.identify[0].window(10.0, 12.0).decimate(5, average=("u_P", "u_N"))
    bench = replace(whole.bench, sampling_frequency=whole.bench.sampling_frequency / 5)
    return replace(whole, bench=bench, identify=(record,), validate=())


@pytest.fixture(scope="module")
def flow(case):
    return read_flow(case, IdentifyOptions(**FORM))[1]


def started(case, flow, **chosen):
    """Return the axis to fit, its WLS estimate and the axis at which output error starts."""
    options = IdentifyOptions(**FORM, **chosen)
    axis = axis_of_options(case, flow, options)
    wls = fit_wls(axis_for_wls(axis, options), case.identify)
    return axis, wls, start_of_output_error(axis, wls, options)


def test_without_a_choice_the_start_is_the_wls_estimate(case, flow):
    axis, wls, start = started(case, flow)
    assert start.parameters.as_dict() == axis.started_at(wls.parameters).parameters.as_dict()


def test_a_linear_effect_joins_wls_and_one_that_is_not_starts_as_the_catalogue_says(case, flow):
    _, wls, start = started(case, flow, effects=("quadratic_drag", "position_delay"))
    assert [name for name in wls.names if "." in name] == ["quadratic_drag.c"]
    (delay,) = EFFECTS["position_delay"].parameters
    assert start.parameters["position_delay.T"].value == delay.start


def test_a_held_parameter_is_neither_in_wls_nor_free(case, flow):
    axis, wls, start = started(case, flow, fixed={"M": 16.4})
    assert "M" not in wls.names and "M" not in axis.parameters.free_names
    assert start.parameters["M"].value == 16.4


def test_a_held_parameter_of_an_effect_gives_its_column_in_wls_the_shape(case, flow):
    chosen = {"effects": ("stribeck",), "fixed": {"stribeck.v_stribeck": 0.05}}
    _, wls, start = started(case, flow, **chosen)
    assert wls.model.parameters["stribeck.v_stribeck"].value == 0.05
    assert start.parameters["stribeck.v_stribeck"].value == 0.05


def test_k_as_a_start_keeps_area_and_dead_length(case, flow):
    _, wls, start = started(case, flow, start_values={"k_P": 1.2, "M": 16.0})
    X = start.parameters.as_dict()
    assert X["M"] == 16.0
    assert X["X_s3"] / X["X_s2"] == pytest.approx(1.2)
    before = wls.parameters.as_dict()
    assert X["X_s3"] == before["X_s3"]
    assert X["X_s1"] / X["X_s2"] == pytest.approx(before["X_s1"] / before["X_s2"])
    assert X["X_s5"] == before["X_s5"]


def test_a_start_releases_what_an_effect_holds_by_default(case, flow):
    (held,) = [item.name for item in EFFECTS["valve_dynamics"].parameters if not item.free]
    name = f"valve_dynamics.{held}"
    axis, _, start = started(case, flow, effects=("valve_dynamics",), start_values={name: 0.001})
    assert name in axis.parameters.free_names and start.parameters[name].value == 0.001
    assert name not in started(case, flow, effects=("valve_dynamics",))[0].parameters.free_names


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_of_a_servo_axis_can_be_added(case, flow, name):
    effect = EFFECTS[name]
    if "drive" in effect().junctions:
        pytest.skip("acts on a force-driven axis")
    if name == "constant_force":  # F_c_plus and F_c_minus hold it already
        with pytest.raises(FitError, match=r"Hold 1 of F_c_plus, F_c_minus, constant_f.*--fix"):
            started(case, flow, effects=(name,))
        return
    unseen = {}
    if list(effect.prior_rows()):  # a curve, of whose ends two seconds hold no trace
        with pytest.raises(FitError, match="hold no trace of") as refused:
            started(case, flow, effects=(name,))
        unseen = {
            f"{name}.{item.name}": 0.0
            for item in effect.parameters
            if f"{name}.{item.name}" in str(refused.value)
        }
        assert 0 < len(unseen) < len(effect.parameters)
    _, wls, start = started(case, flow, effects=(name,), fixed=unseen)
    assert np.isfinite(start.parameters.values).all()
    assert set(wls.names) >= {f"X_s{i}" for i in range(1, 7)}


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"effects": ("rust",)}, "no effect 'rust'; there are .*stribeck"),
        ({"fixed": {"mass": 3.0}}, "'mass': unknown; there are X_s1, .*F_c_minus"),
        ({"start_values": {"stribeck.delta_F": 3.0}}, "'stribeck.delta_F': unknown"),
        ({"fixed": {"v_s": 1e-3}}, "'v_s': its width is an option of output error"),
        ({"fixed": {"k_P": 1.2}}, "k_P cannot be held: it is the ratio X_s3/X_s2"),
        ({"start_values": {"k_N": 1.2, "X_s5": 7e-9}}, "start from k_N or give X_s5, not both"),
        ({"fixed": {"M": 16.0}, "start_values": {"M": 17.0}}, "M: held and started"),
        ({"fixed": {"M": -1.0}}, "M: -1 kg lies outside its bounds"),
    ],
)
def test_what_cannot_be_chosen_is_one_sentence(case, flow, chosen, words):
    with pytest.raises(ModelError, match=words):
        axis_of_options(case, flow, IdentifyOptions(**FORM, **chosen))


@pytest.fixture(scope="module")
def with_effect(quick, tmp_path_factory):
    """A result of the quick identification with two effects in its model, one of them metered."""
    axis = axis_of_options(
        quick.case,
        quick.flow,
        IdentifyOptions(**FORM, effects=("stribeck", "flow_map_shape"), fixed={"M": 16.4}),
    )
    values = quick.axis.parameters.as_dict() | {"stribeck.delta_F": 3.0, "M": 16.4}
    axis = axis.with_parameters(values)
    held = tuple(n for n in quick.output_error.uncertainty.names if n != "M")
    at = [quick.output_error.uncertainty.names.index(name) for name in held]
    estimate = quick.output_error.uncertainty
    estimate = replace(
        estimate,
        names=held,
        covariance=estimate.covariance[at][:, at],
        covariance_robust=estimate.covariance_robust[at][:, at],
    )
    fit = replace(quick.output_error, axis=axis, uncertainty=estimate)
    folder = tmp_path_factory.mktemp("with_effect")
    write_json(result_dict(replace(quick, output_error=fit)), folder / "result.json")
    return folder, axis


def test_a_result_with_effects_is_read_back_from_its_folder(quick, with_effect):
    folder, axis = with_effect
    read = read_axis(folder, quick.case)
    assert [e.name for e in read.effects] == ["stribeck", "flow_map_shape"]
    assert read.parameters.as_dict() == axis.parameters.as_dict()


def test_an_identification_can_begin_from_a_result(quick, with_effect):
    folder, axis = with_effect
    options = read_options(folder, quick.case)
    assert options.effects == ("stribeck", "flow_map_shape")
    assert options.fixed["M"] == 16.4 and "M" not in options.start_values
    assert options.start_values["X_s1"] == axis.parameters["X_s1"].value
    assert "v_s" not in {*options.start_values, *options.fixed}
    axis_of_options(quick.case, quick.flow, options)  # they suit the axis


def test_the_result_of_an_earlier_version_is_read(quick, tmp_path):
    content = result_dict(quick)
    content["caveats"] = [{"topic": "wls", "text": "."} for _ in content.pop("warnings")]
    for name in ("usable", "reason", "each_record", "folder", "model"):
        content.pop(name)
    write_json(content, tmp_path / "result.json")
    axis = read_axis(tmp_path / "result.json", quick.case)
    assert axis.parameters.as_dict() == quick.axis.parameters.as_dict()


@pytest.fixture
def with_held_flow(quick, tmp_path):
    """A result of the quick identification as if its flow coefficients had been held."""
    estimate = quick.output_error.uncertainty
    own = tuple(name for name in estimate.names if name not in quick.axis.flow_parameters)
    at = np.ix_(*2 * [[estimate.names.index(name) for name in own]])
    parts = (estimate.covariance, estimate.covariance_robust)
    covariance, robust = (part[at] for part in parts)
    estimate = replace(estimate, names=own, covariance=covariance, covariance_robust=robust)
    fit = replace(quick.output_error, uncertainty=estimate)
    write_json(result_dict(replace(quick, output_error=fit)), tmp_path / "result.json")
    return tmp_path


def test_a_result_whose_map_was_held_leaves_it_held(quick, with_held_flow):
    options = read_options(with_held_flow, quick.case)
    assert not options.refine_flow
    assert not {*options.start_values, *options.fixed} & set(quick.axis.flow_parameters)
    axis = axis_of_options(quick.case, quick.flow, options)
    assert not set(axis.parameters.free_names) & set(quick.axis.flow_parameters)


def test_a_result_whose_map_was_refined_goes_on_to_refine_it(quick, with_effect):
    assert read_options(with_effect[0], quick.case).refine_flow


def test_a_start_releases_no_coefficient_of_a_map_that_is_to_be_held(case, flow):
    name = flow.parameters.names[0]
    start = {name: 1.1 * flow.parameters[name].value, "M": 16.0}
    held = IdentifyOptions(**FORM, refine_flow=False, start_values=start)
    assert name not in axis_of_options(case, flow, held).parameters.free_names
    refined = replace(held, refine_flow=True)
    assert name in axis_of_options(case, flow, refined).parameters.free_names


def test_what_a_map_does_between_its_commands_is_asked_of_a_metered_valve_alone(flow):
    given = catalogue_effect("flow_map_shape", flow)
    general = catalogue_effect("flow_map_shape", flow, metered=False)
    assert general.__class__ is EFFECTS["flow_map_shape"]
    assert given.__class__ is not EFFECTS["flow_map_shape"]
