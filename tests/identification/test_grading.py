"""Graded warnings, and what they make of a result."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pneumo_casadi.data import Grade
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.output_error.result import evaluate_derived_quantities
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import (
    CONDITIONS,
    LIMITS,
    ResultWarning,
    Usable,
    judge_usability,
    result_warnings,
)
from pneumo_casadi.report.tables.parameters import output_error_half_width, wls_half_width

ORDER = list(Grade)


def found_with(quick, **parts):
    """Return the warnings of an identification with parts of its fit replaced."""
    fit = replace(quick.output_error, **parts)
    return result_warnings(
        quick.case, quick.records, quick.flow_map, quick.wls, fit, quick.validation
    )


def with_values(quick, **values):
    """Return the warnings where some parameters have other values."""
    axis = quick.axis.with_parameters(values)
    return found_with(quick, axis=axis)


def test_every_limit_rises_with_the_grade_and_has_its_reason():
    for name, limit in LIMITS.items():
        assert limit.reason and limit.quantity, name
        given = [at for at in (limit.note, limit.caution, limit.severe) if at < float("inf")]
        assert given and all(low < high for low, high in pairwise(given)), name
    assert all(reason for _, reason in CONDITIONS.values())


def test_a_good_record_has_no_severe_warning_and_few_notes(quick):
    assert not [item for item in quick.warnings if item.grade is Grade.SEVERE]
    assert quick.usability.usable is not Usable.NO


def test_the_gravest_warning_comes_first_and_decides(quick):
    M = quick.case.bench.datasheet["M_kg"]
    found = with_values(quick, M=0.08 * M)
    assert [ORDER.index(item.grade) for item in found] == sorted(
        ORDER.index(item.grade) for item in found
    )
    assert found[0].grade is Grade.SEVERE and "-92 % off the data sheet" in found[0].text
    bad = replace(quick, warnings=found)
    assert bad.summary().splitlines()[0].startswith("Do not use: M = 1.312 kg is -92 %")
    content = result_dict(bad)
    assert content["usable"] == "no"
    assert content["warnings"][0] == {
        "grade": "severe",
        "text": found[0].text,
        "about": "physics",
    }


def test_windows_that_long_records_have_got_are_noted(quick):
    (warning,) = [i for i in found_with(quick, chosen_window=20.0) if "20 s" in i.text]
    assert warning.grade is Grade.NOTE and warning not in found_with(quick)


@pytest.mark.parametrize(("factor", "grade"), [(1.05, None), (1.2, "caution"), (1.4, "severe")])
def test_a_mass_off_the_data_sheet_is_graded_by_its_distance(quick, factor, grade):
    M = quick.case.bench.datasheet["M_kg"]
    grades = [i.grade.value for i in with_values(quick, M=factor * M) if "data sheet" in i.text]
    assert grades == ([] if grade is None else [grade])


def test_a_deviation_within_the_interval_contradicts_nothing(quick):
    name = "M"
    at = quick.output_error.uncertainty.names.index(name)
    covariance = quick.output_error.uncertainty.covariance.copy()
    covariance[at, at] = 100.0  # a standard deviation of 10 kg
    wide = replace(quick.output_error.uncertainty, covariance=covariance)
    M = quick.case.bench.datasheet["M_kg"]
    axis = quick.axis.with_parameters({"M": 1.5 * M})
    assert not [i for i in found_with(quick, axis=axis, uncertainty=wide) if "sheet" in i.text]


@pytest.mark.parametrize(("name", "k"), [("k_P", 0.8), ("k_N", 1.6)])
def test_a_gas_that_cannot_be_is_severe(quick, name, k):
    derived = dict(quick.output_error.derived)
    derived[name] = replace(derived[name], value=k, std=0.01, std_robust=0.01)
    (warning,) = [i for i in found_with(quick, derived=derived) if i.text.startswith(name)]
    assert warning.grade is Grade.SEVERE
    derived[name] = replace(derived[name], std_robust=1.0)
    assert not [i for i in found_with(quick, derived=derived) if i.text.startswith(name)]


def test_a_position_that_is_not_from_mid_stroke_gives_a_negative_volume(quick):
    derived = dict(quick.output_error.derived)
    length = -0.1 * quick.case.bench.stroke
    derived["l_DP"] = replace(derived["l_DP"], value=length, std=1e-3, std_robust=1e-3)
    (warning,) = [i for i in found_with(quick, derived=derived) if "dead volume" in i.text]
    assert warning.grade is Grade.SEVERE and "mid-stroke" in warning.text


def test_a_dead_volume_of_half_the_stroke_asks_for_hoses_and_the_stroke(quick):
    derived = dict(quick.output_error.derived)
    for share, expected in ((0.3, []), (0.6, [Grade.NOTE])):  # of the stroke
        length = share * quick.case.bench.stroke
        derived["l_DN"] = replace(derived["l_DN"], value=length, std=1e-3, std_robust=1e-3)
        warnings = found_with(quick, derived=derived)
        assert [i.grade for i in warnings if "dead volume of chamber N" in i.text] == expected


def test_the_frame_has_the_standard_deviations_of_the_tables(quick):
    frame, wls = quick.to_frame(), quick.wls
    names = [name for name in wls.names if name in quick.output_error.parameters.free_names]
    for at, name in enumerate(wls.names):
        assert 2 * frame.wls_std[name] == wls_half_width(quick, name) == 2 * wls.std_hac[at]
    for name in names:
        assert 2 * frame.output_error_std[name] == output_error_half_width(quick, name)


def test_a_chamber_at_its_bound_is_severe_and_a_flow_coefficient_is_no_warning(quick):
    def at(name):
        estimate = replace(quick.output_error.uncertainty, at_bound=(name,))
        return [i.grade for i in found_with(quick, uncertainty=estimate) if "bound" in i.text]

    assert at("X_s2") == [Grade.SEVERE]
    assert at("f_v") == [Grade.CAUTION]
    assert at(quick.axis.flow_parameters[0]) == []


def test_a_simulation_far_from_the_held_out_record_is_severe_and_voids_the_intervals(quick):
    def warnings(percent):
        errors = {n: replace(e, percent=percent) for n, e in quick.validation.open_loop.items()}
        far = replace(quick.validation, windows={0.5: errors})
        fit = (quick.case, quick.records, quick.flow_map, quick.wls, quick.output_error)
        return [i for i in result_warnings(*fit, far) if "held-out" in i.text]

    assert warnings(5.0) == []
    for percent, grade in ((20.0, Grade.CAUTION), (80.0, Grade.SEVERE)):
        (warning,) = warnings(percent)
        assert warning.grade is grade
        assert "intervals of its parameters are void" in warning.text


def test_the_verdict_follows_the_gravest_grade():
    note = ResultWarning(Grade.NOTE, "wls", "a note.")
    caution = ResultWarning(Grade.CAUTION, "wls", "a caution.")
    assert judge_usability((note,), "all well.").sentence == "Usable: all well."
    careful = judge_usability((caution, caution, note), "")
    assert careful.sentence == "Usable with care: a caution. (and 1 more of this grade)"
    assert careful.usable is Usable.WITH_CARE


@pytest.mark.parametrize(("statuses", "warned"), [(("converged",), False), (("failed",), True)])
def test_stages_that_were_planned_are_no_sign_of_misfit(quick, statuses, warned):
    last = quick.output_error.stages[-1]
    stages = (*(replace(last, status=status) for status in statuses), last)
    texts = [warning.text for warning in found_with(quick, stages=stages)]
    assert any("by way of short windows" in text for text in texts) is warned


def test_the_masses_of_an_elastic_load_are_one_on_the_data_sheet(quick):
    M = quick.case.bench.datasheet["M_kg"]
    axis = quick.axis.with_effects(EFFECTS["elastic_load"]())
    parts = axis.with_parameters({"M": 0.65 * M, "elastic_load.m_2": 0.35 * M})
    assert not [i for i in found_with(quick, axis=parts) if "data sheet" in i.text]
    lighter = axis.with_parameters({"M": 0.65 * M, "elastic_load.m_2": 0.0})
    (warning,) = [i for i in found_with(quick, axis=lighter) if "data sheet" in i.text]
    assert warning.text.startswith("M + elastic_load.m_2 = ")


@pytest.mark.parametrize("meter", [0.0, 0.05])
def test_the_factor_of_a_meter_hides_no_exchanged_areas(quick, meter):
    known = quick.output_error.uncertainty
    values = quick.output_error.parameters.select(known.names).values
    scaled = meter * np.where([name.startswith("X_s") for name in known.names], values, 0.0)
    wide = replace(
        known,
        covariance=known.covariance + np.outer(scaled, scaled),
        covariance_robust=known.covariance_robust + np.outer(scaled, scaled),
    )
    axis = quick.axis.with_parameters({"X_s6": 1.18 * quick.axis.parameters["X_s6"].value})
    derived = evaluate_derived_quantities(axis, wide)
    warnings = found_with(quick, axis=axis, uncertainty=wide, derived=derived)
    (ratio,) = [i for i in warnings if "ratio of the areas" in i.text]
    assert "+1" in ratio.text


def test_intervals_without_the_map_s_own_noise_are_a_caution(quick):
    free = quick.axis.parameters.release(*quick.axis.flow_parameters)
    refined = found_with(quick, axis=quick.axis.with_parameters(free))
    held = found_with(quick, axis=quick.axis.with_parameters(free.fix(*quick.axis.flow_parameters)))
    (warning,) = [item for item in held if item not in refined]
    assert warning.grade is Grade.CAUTION and "The flow map was held" in warning.text
