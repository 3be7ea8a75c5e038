"""From a case folder to parameters: accuracy on the embedded record, warnings, result.json."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import read_case
from pneumo_casadi.data.truth import read_truth
from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.identification.identify import _cut, _predictions, identify
from pneumo_casadi.identification.options import FORCE_WINDOW, IdentifyOptions
from pneumo_casadi.identification.read_result import read_axis
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import result_warnings
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import FlowForm

#: Relative tolerances that the output-error fit must meet on the embedded record.
TOLERANCES = {
    **{f"X_s{i}": 0.02 for i in range(1, 7)},
    "M": 0.005,
    "f_v": 0.08,
    "F_c_plus": 0.05,
    "F_c_minus": 0.05,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TOLERANCES)
def test_output_error_recovers_the_true_parameters_of_the_embedded_record(demo, name):
    truth = demo.truth[name]
    assert demo.axis.parameters[name].value == pytest.approx(truth, rel=TOLERANCES[name])


@pytest.mark.slow
@pytest.mark.parametrize(("k", "top", "bottom"), [("k_P", "X_s3", "X_s2"), ("k_N", "X_s6", "X_s5")])
def test_output_error_recovers_the_polytropic_coefficients(demo, k, top, bottom):
    true = demo.truth[top] / demo.truth[bottom]
    assert demo.output_error.derived[k].value == pytest.approx(true, abs=0.02)


@pytest.mark.slow
def test_truth_lies_within_four_robust_standard_deviations(demo):
    result = demo.output_error
    far = {
        name: abs(result.parameters[name].value - true) / result.std(name, robust=True)
        for name, true in demo.truth.items()
    }
    # Two would be right for pure noise; the polynomial form of the map leaves a bias besides.
    assert max(far.values()) < 4, far


@pytest.mark.slow
def test_output_error_improves_on_weighted_least_squares(demo):
    def worst(values):
        return max(abs(values[n].value / true - 1) for n, true in demo.truth.items())

    assert worst(demo.axis.parameters) < 0.3 * worst(demo.wls.parameters)


@pytest.mark.slow
def test_a_held_out_window_of_a_tenth_of_a_second_is_predicted_to_the_noise(demo):
    for name, error in demo.validation.windows[0.1].items():
        assert error.percent < 1.1 * error.noise_percent, name


@pytest.mark.slow
def test_correlated_residuals_and_the_pulled_map_are_said_in_words(demo):
    assert any("flow map" in item.text for item in demo.warnings if item.about == "flow_map")
    assert any("correlated" in item.text for item in demo.warnings if item.about == "intervals")


@pytest.fixture(scope="module")
def second(embedded):
    """Return a second of the embedded record at 1 kHz, a fifth of its samples."""
    case = read_case(embedded)
    record = case.identify[0].window(10.0, 11.0).decimate(5, average=("u_P", "u_N"))
    bench = replace(case.bench, sampling_frequency=case.bench.sampling_frequency / 5)
    return replace(case, bench=bench, identify=(record,), validate=())


@pytest.mark.slow
def test_progress_rises_from_nothing_to_one(second):
    shares: list[float] = []
    identify(
        second,
        IdentifyOptions(FlowForm.POLYNOMIALS, refine_flow=False, windows=()),
        lambda text, share: shares.append(share),
    )
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert shares[-1] == 1.0


@pytest.mark.slow
def test_result_is_strict_json_with_the_promised_keys(demo):
    content = json.loads(json.dumps(result_dict(demo), allow_nan=False))
    for name in TOLERANCES:
        assert {"value", "std", "std_hac", "relative_std_percent", "unit"} <= set(
            content["wls"]["parameters"][name]
        )
        assert {"value", "std", "std_robust", "unit"} <= set(
            content["output_error"]["parameters"][name]
        )
    assert {"status", "iterations", "cost", "derived", "stages"} <= set(content["output_error"])
    assert {"value", "std"} <= set(content["output_error"]["derived"]["k_P"])
    for channel in ("x", "p_P", "p_N"):
        assert {"rms", "percent", "noise_percent"} <= set(content["validation"][channel])
    assert set(content["provenance"]["sha256"]) == {
        "bench.json",
        "flow_map.csv",
        "identify.csv.gz",
        "validate.csv.gz",
    }


def test_a_standard_deviation_that_does_not_exist_is_null_with_a_note(quick):
    estimate = quick.output_error.uncertainty
    covariance = estimate.covariance.copy()
    at = estimate.names.index("f_v")
    covariance[at, at] = math.inf
    changed = replace(
        estimate, covariance=covariance, covariance_robust=covariance, at_bound=("M",)
    )
    modified = replace(quick, output_error=replace(quick.output_error, uncertainty=changed))
    parameters = result_dict(modified)["output_error"]["parameters"]
    assert parameters["f_v"]["std"] is None
    assert "nothing" in parameters["f_v"]["note"]
    assert parameters["M"]["std"] is None
    assert "bound" in parameters["M"]["note"]
    json.dumps(result_dict(modified), allow_nan=False)


def test_an_axis_read_back_is_the_axis_written(quick, tmp_path):
    write_json(result_dict(quick), tmp_path / "result.json")
    axis = read_axis(tmp_path / "result.json", quick.case)
    assert axis.parameters.as_dict() == quick.axis.parameters.as_dict()


def test_a_result_of_another_flow_map_is_refused(quick, tmp_path):
    content = result_dict(quick)
    content["provenance"]["sha256"]["flow_map.csv"] = "0"
    write_json(content, tmp_path / "result.json")
    with pytest.raises(CaseError, match=r"flow_map\.csv: not the flow map .* identify this case"):
        read_axis(tmp_path / "result.json", quick.case)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"output_error": {"parameters": 1}}'])
def test_a_file_that_is_no_result_is_named(quick, tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(CaseError, match=r"other\.json"):
        read_axis(path, quick.case)


def test_json_with_a_value_that_json_cannot_hold_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_json({"a": math.nan}, tmp_path / "a.json")
    assert not list(tmp_path.iterdir())


def test_a_servo_axis_without_a_flow_map_is_refused_with_a_remedy(embedded):
    case = replace(read_case(embedded), flow_map_path=None)
    with pytest.raises(CaseError, match=r"no flow_map\.csv.*meter"):
        identify(case)


def test_the_start_is_clipped_to_the_bounds_of_the_model(quick):
    low = quick.axis.parameters["M"].lower
    far = quick.wls.parameters.bounded("M", -10.0, 1e3).with_values({"M": -1.0})
    wls = replace(quick.wls, parameters=far)
    assert quick.axis.started_at(wls.parameters).parameters["M"].value == low


@pytest.mark.slow
def test_a_fit_that_fails_carries_its_partial_result(second):
    hurried = OutputErrorOptions(max_iterations=1, recover=False)
    options = IdentifyOptions(FlowForm.POLYNOMIALS, refine_flow=False, output_error=hurried)
    with pytest.raises(FitError) as caught:
        identify(second, options)
    assert caught.value.partial.status != "converged"


def test_a_truth_that_is_no_number_is_named(tmp_path):
    (tmp_path / "truth.json").write_text('{"M": "heavy"}')
    with pytest.raises(CaseError, match=r"truth\.json"):
        read_truth(tmp_path)


def test_pressures_outside_the_metered_range_are_a_warning(quick):
    table = quick.flow_map.select(quick.flow_map.p < 5e5)
    warnings = result_warnings(
        quick.case, quick.records, table, quick.wls, quick.output_error, quick.validation
    )
    assert any("p_N" in item.text and "extrapolated" in item.text for item in warnings)


def test_a_parameter_at_its_bound_is_a_warning(quick):
    estimate = replace(quick.output_error.uncertainty, at_bound=("f_v",))
    result = replace(quick.output_error, uncertainty=estimate)
    warnings = result_warnings(
        quick.case, quick.records, quick.flow_map, quick.wls, result, quick.validation
    )
    assert any(item.text.startswith("f_v lies at its bound") for item in warnings)


def test_a_case_without_held_out_records_says_so(quick):
    warnings = result_warnings(
        quick.case, quick.records, quick.flow_map, quick.wls, quick.output_error, None
    )
    assert any(item.about == "validation" and "held out" in item.text for item in warnings)


@pytest.mark.slow
@pytest.mark.data
def test_a_force_driven_axis_is_identified_over_windows(data_folder):
    result = identify(data_folder / "emps", IdentifyOptions(end=8.0, windows=(0.1,)))
    assert result.flow is None
    assert result.wls.names == ("M", "f_v", "F_c_plus", "F_c_minus")
    lengths = {s.K * s.n * result.records[0].dt for s in result.output_error.segments}
    assert max(lengths) == pytest.approx(FORCE_WINDOW)
    M = result.axis.parameters["M"].value
    assert pytest.approx(95.1, rel=0.03) == M
    json.dumps(result_dict(result), allow_nan=False)
    assert np.isfinite(result.output_error.cost)


def test_stretches_outside_the_time_to_identify_on_are_left_out(quick):
    record = quick.case.identify[0]
    early, middle, late = (record.window(start, start + 1.0) for start in (5.0, 10.0, 14.0))
    some = _cut((early, middle, late), IdentifyOptions(start=9.0, end=10.5))
    assert [part.t[0] for part in some] == [middle.t[0]]
    assert some[0].duration == pytest.approx(0.5)
    both = _cut((early, middle, late), IdentifyOptions(start=10.5))
    assert [part.t[0] for part in both] == pytest.approx([10.5, 14.0])
    with pytest.raises(CaseError, match="row"):  # outside all of them
        _cut((early, middle, late), IdentifyOptions(start=20.0))
    other = replace(early, source="another file")  # a record of its own is not dropped in silence
    with pytest.raises(CaseError, match="row"):
        _cut((other, middle), IdentifyOptions(start=9.0))


@pytest.mark.parametrize("seconds", [0.05, 0.3])
def test_a_record_too_short_for_the_filters_is_not_predicted_and_the_others_are(
    quick, caplog, seconds
):
    record = quick.case.validate[0]
    begin = float(record.t[0])
    short = record.window(begin, begin + seconds)
    (prediction,) = _predictions(quick.wls, [short, record])
    assert prediction.name == record.name
    (warning,) = caplog.messages
    assert warning.startswith(f"{short.name}: not predicted by weighted least squares")
