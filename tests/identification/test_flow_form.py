"""The form of the flow map: chosen unless given, stored in the result, told in warnings."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import read_case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.flow_form import read_flow, read_flow_maps, resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.read_result import read_axis
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import result_warnings
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import (
    FlowForm,
    FlowISO6358,
    FlowPolynomials,
    FormError,
    FormSelection,
    Reason,
    choose_flow_form,
)


@pytest.fixture(scope="module")
def case(embedded):
    return read_case(embedded)


@pytest.fixture(scope="module")
def chosen(case):
    return resolve_flow_form(case, IdentifyOptions())


def selection(polynomials, iso6358, chosen=FlowForm.ISO6358):
    """Return a selection with the held-out errors given."""
    errors = (
        FormError(FlowForm.POLYNOMIALS, (3, 3, 3), polynomials, 0.01),
        FormError(FlowForm.ISO6358, None, iso6358, 0.01),
    )
    return FormSelection(chosen, Reason.LEAST_ERROR, errors, 5)


def texts(quick, selection):
    """Return the warnings on the form of the flow map."""
    parts = (quick.case, quick.records, quick.flow_map, quick.wls, quick.output_error)
    plain = result_warnings(*parts, quick.validation)
    return [w.text for w in result_warnings(*parts, quick.validation, selection) if w not in plain]


@pytest.mark.slow
def test_without_a_form_the_one_with_the_least_held_out_error_is_taken(chosen):
    options, how = chosen
    assert options.flow_form is how.chosen is FlowForm.ISO6358
    assert how.reason is Reason.LEAST_ERROR
    percent = {error.form: error.percent for error in how.candidates if error.percent is not None}
    assert percent[FlowForm.ISO6358] == min(percent.values())
    assert "no closer to the map" in how.error_of(FlowForm.ISO6358_CURVE).failure


@pytest.mark.slow
def test_the_default_flow_is_the_form_chosen(case):
    _, flow = read_flow(case, IdentifyOptions())
    assert isinstance(flow, FlowISO6358)


@pytest.mark.parametrize("form", list(FlowForm))
def test_a_form_given_by_hand_is_taken_without_a_comparison(case, form):
    options, how = resolve_flow_form(case, IdentifyOptions(form))
    assert options.flow_form is form
    assert how.reason is Reason.GIVEN and how.folds == 0
    assert flow_form_tables(how) == ()


def test_polynomials_by_hand_have_the_degrees_of_the_paper_unless_told_otherwise(case):
    for degrees, expected in ((None, (7, 7, 4)), ((3, 3, 2), (3, 3, 2))):
        _, flow = read_flow(case, IdentifyOptions(FlowForm.POLYNOMIALS, degrees))
        assert isinstance(flow, FlowPolynomials) and flow.degrees == expected


def test_a_force_driven_axis_has_no_form(data_folder):
    options = IdentifyOptions()
    assert resolve_flow_form(read_case(data_folder / "emps"), options) == (options, None)


def test_the_choice_is_in_the_result_file_and_the_axis_is_read_back(quick, chosen, tmp_path):
    content = result_dict(replace(quick, flow_selection=chosen[1]))
    stored = json.loads(json.dumps(content, allow_nan=False))["flow"]["selection"]
    assert stored["chosen"] == "iso6358" and stored["reason"] == "least_error"
    assert {one["form"] for one in stored["candidates"]} == {form.value for form in FlowForm}
    by_hand = result_dict(quick)
    assert by_hand["flow"]["degrees"] == [7, 7, 4]
    assert by_hand["flow"]["selection"]["reason"] == "given"
    write_json(by_hand, tmp_path / "result.json")
    assert read_axis(tmp_path / "result.json", quick.case).flow.degrees == (7, 7, 4)


def test_a_result_without_degrees_is_read_back(quick, tmp_path):
    content = result_dict(quick)
    content["flow"]["degrees"] = None  # polynomials by hand are then those of the paper
    write_json(content, tmp_path / "result.json")
    axis = read_axis(tmp_path / "result.json", quick.case)
    assert axis.parameters.as_dict() == quick.axis.parameters.as_dict()


def test_worse_forms_are_no_warning_since_the_best_is_taken(quick):
    assert texts(quick, selection(0.25, 0.1)) == []
    assert texts(quick, FormSelection.given(FlowForm.SPLINE)) == []


def test_a_map_that_no_form_follows_is_a_warning(quick):
    (text,) = texts(quick, selection(1.6, 1.2))
    assert "No form fits the flow map" in text and "1.2 %" in text


def test_the_report_shows_the_errors_and_the_reason():
    (table,) = flow_form_tables(selection(0.253, 0.1))
    assert table.rows[0] == (
        "polynomials (eq. 12 of the paper), degrees 3, 3, 3",
        "0.253 ± 0.010",
        "",
    )
    assert table.rows[1] == ("ISO 6358", "0.100 ± 0.010", "yes")
    assert "least held-out error" in table.notes[0]


@pytest.mark.parametrize("form", [FlowForm.ISO6358, FlowForm.SPLINE])
def test_degrees_without_polynomials_are_refused(case, form):
    with pytest.raises(CaseError, match=f"{form.value} has none"):
        resolve_flow_form(case, IdentifyOptions(form, degrees=(3, 3, 2)))


def test_degrees_that_the_map_does_not_bear_are_refused_not_left_out(case):
    too_high = IdentifyOptions(degrees=(20, 20, 20))
    with pytest.raises(CaseError, match=r"degrees \(20, 20, 20\): .* lower the degree"):
        resolve_flow_form(case, too_high)


def test_degrees_that_the_whole_map_alone_bears_ask_for_the_form(case):
    """Nine pressures bear degree 7; what is left of them without withheld ones does not."""
    table, _ = read_flow_maps(case, case.bench)
    pressures, commands = np.unique(table.p), np.unique(table.u)
    few = np.isin(table.p, pressures[:: pressures.size // 8][:9])
    few &= np.isin(table.u, commands[:: commands.size // 8][:9])
    with pytest.raises(CaseError, match=r"the whole map bears them.*--flow polynomials"):
        choose_flow_form(table.select(few), degrees=(7, 7, 4))
