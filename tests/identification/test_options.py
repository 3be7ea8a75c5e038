"""Options that cannot be used are refused when they are made, before any work."""

import json

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.diagnosis import DiagnosisOptions
from pneumo_casadi.errors import ModelError
from pneumo_casadi.valve import FlowForm

OPTIONS = (pc.IdentifyOptions, DiagnosisOptions)


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("form", FlowForm)
def test_a_form_is_given_by_its_name_as_an_export_format_is(options, form):
    assert options(flow_form=form.value).flow_form is options(flow_form=form).flow_form is form


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"flow_form": "iso"}, r"flow_form: no form 'iso'; there are polynomials, iso6358, "),
        ({"degrees": (50, 50, 50)}, r"degrees \(50, 50, 50\): expected three whole numbers"),
        ({"degrees": 7}, r"degrees 7: expected three whole numbers"),
        ({"degrees": ("7", 7, 4)}, r"degrees \('7', 7, 4\): expected three"),
    ],
)
def test_forms_and_degrees_that_no_map_has_are_refused(options, chosen, message):
    with pytest.raises(ModelError, match=message):
        options(**chosen)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"windows": (-1,)}, r"windows: -1 s; give positive lengths"),
        ({"windows": (0,)}, r"windows: 0 s; give positive"),
        ({"windows": ("1",)}, r"windows: '1' s"),
        ({"windows": 0.5}, r"windows: 0.5; give a sequence of lengths \[s\], as \(0.5,\)"),
        ({"effects": "stribeck"}, r"effects: 'stribeck'; give a sequence of names"),
        ({"fixed": {"M": "10"}}, r"fixed: M = '10'; give numbers by name"),
        ({"fixed": ["M"]}, r"fixed: \['M'\]; give numbers by name"),
        ({"start_values": {"M": np.nan}}, r"start_values: M = nan; give numbers"),
        ({"start": "5"}, r"start: '5' s; give a time in seconds"),
        ({"end": np.inf}, r"end: inf s; give a time"),
        ({"output_error": {"window": 0.5}}, r"output_error: .*; give OutputErrorOptions"),
    ],
)
def test_what_an_identification_cannot_use_is_refused(chosen, message):
    with pytest.raises(ModelError, match=message):
        pc.IdentifyOptions(**chosen)


def test_numbers_of_numpy_and_lists_are_accepted():
    options = pc.IdentifyOptions(
        degrees=[7, 7, np.int64(4)], windows=np.array([0.5]), effects=["hose"], fixed={"M": np.pi}
    )
    assert options.windows == (0.5,) and options.effects == ("hose",)
    assert json.loads(json.dumps([options.degrees, options.windows])) == [[7, 7, 4], [0.5]]


def test_options_of_another_type_are_named_before_the_case_is_read():
    with pytest.raises(ModelError, match=r"options: \{.*; give IdentifyOptions"):
        pc.identify("no such folder", {"effects": ("stribeck",)})
    with pytest.raises(ModelError, match=r"options: \{.*; give DiagnosisOptions"):
        pc.diagnose("no such folder", options={})


@pytest.mark.parametrize(
    ("catalogue", "message"),
    [
        (["stribeck"], r"catalogue: \['stribeck'\]; give classes of effects by name"),
        ({"stribeck": 3}, r"catalogue: stribeck is 3; give classes"),
    ],
)
def test_a_catalogue_without_effects_is_named_before_the_case_is_read(catalogue, message):
    with pytest.raises(ModelError, match=message):
        pc.diagnose("no such folder", catalogue)
