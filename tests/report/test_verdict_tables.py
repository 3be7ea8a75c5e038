"""Tables of a diagnosis hold what was found, with units and intervals."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import pytest

from pneumo_casadi.diagnosis import Value, Verdict
from pneumo_casadi.diagnosis.metrics.findings import Check, Closure, joined_names
from pneumo_casadi.report.figures.diagnosis.gap import gap_figure
from pneumo_casadi.report.figures.diagnosis.ranking import ranking_figure
from pneumo_casadi.report.pages.diagnosis import diagnosis_html
from pneumo_casadi.report.tables.diagnosis import gap_table, ranking_table
from pneumo_casadi.report.tables.quantities import quantity
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.tables.verdict.estimates import fitted_table
from pneumo_casadi.report.tables.verdict.parameter_checks import check_table
from pneumo_casadi.report.text.causes import cause_sentences, discovered_fact
from pneumo_casadi.report.text.diagnosis import (
    note_sentences,
    refused_sentences,
    size_sentences,
    summary_text,
)
from pneumo_casadi.report.text.facts import facts
from pneumo_casadi.report.text.next_step import next_step
from pneumo_casadi.report.text.parameter_checks import (
    check_sentences,
    check_summary,
    checks_of_what,
)

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)


def test_a_check_that_nothing_could_contradict_is_not_counted():
    wide = Check(
        "k_P-k_N", 0.06, 0.007, 0.0, 0.25, "1", True, "k_P − k_N = +0.06: no gross error.", False
    )
    diagnosis = replace(made.EFFECT, checks=(*made.EFFECT.checks, wide))
    assert check_summary(made.EFFECT) == "1 of 2 agree"
    assert check_summary(diagnosis) == "1 of 2 agree; 1 cannot tell"
    assert check_table(diagnosis).rows[-1][-1] == "cannot tell"
    assert [result for result, _ in check_sentences(diagnosis)] == [
        *("contradicts", "agrees", "cannot tell")
    ]
    failing = replace(diagnosis, checks=(replace(wide, agrees=False),))
    assert check_summary(failing) == "0 of 1 agree"
    assert check_summary(replace(diagnosis, checks=(wide,))) == ""


def test_the_parameters_to_use_are_those_that_are_checked():
    """What the fits behind the verdict contradicted is told beside it."""
    refined = tuple(replace(check, agrees=True) for check in made.EFFECT.checks)
    diagnosis = replace(made.EFFECT, refined_checks=refined)
    assert check_summary(diagnosis) == "2 of 2 agree"
    assert [result for result, _ in check_sentences(diagnosis)] == ["agrees", "agrees"]
    behind = checks_of_what(diagnosis)[-1]
    assert "The fits behind the verdict contradict" in behind
    assert "S_P comes out +3.2 %" in behind
    assert check_table(diagnosis).notes[0] == "Estimates of the final model."


def test_sizes_of_a_cause_are_those_of_the_final_model():
    final = {"stribeck.delta_F": Value(8.5, 0.1, "N"), "stribeck.v_stribeck": Value(0.05, 0, "m/s")}
    (sentence,) = cause_sentences(made.EFFECT, final=final)
    assert "delta_F = 8.50 ± 0.20 N" in sentence
    assert "v_stribeck = 55.3 ± 1.0 mm/s" in sentence  # held in the final model


def test_the_head_shows_no_change_by_a_candidate_that_is_not_the_cause():
    head = dict(facts(replace(made.UNKNOWN, discovered=None), None))
    assert head["The same of x, whole record in closed loop"] == "15 %"
    assert " → " in dict(facts(made.EFFECT, None))["The same of x, whole record in closed loop"]


def test_causes_stand_together_with_their_probability():
    head = dict(facts(made.three_effects(), None))
    assert head["Causes, probability of each"].startswith(
        "hose (76 %), Stribeck friction (97 %) and"
    )
    assert head["Where"] == "mass flows into both chambers and the force on the moving mass"


def test_estimates_that_do_not_meet_those_of_the_final_model_are_named():
    final = {"M": Value(16.9, 0.02, "kg"), "X_s1": Value(3.6e-9, 4e-12, "kg/Pa")}
    table = fitted_table(made.EFFECT, final)
    assert table.columns[-1] == "final model, to use"
    assert table.notes[-1].endswith("both intervals together: X_s1.")
    assert "final model" not in fitted_table(made.UNKNOWN, final).columns[-1]


def test_a_candidate_that_matters_is_in_the_table_with_what_became_of_it():
    promising = replace(made.FAILED, explained=0.3)
    ranking = (made.STRIBECK, made.DRAG, replace(made.SILENT, probability=0.02), promising)
    rows = {row[0]: row for row in ranking_table(replace(made.EFFECT, ranking=ranking)).rows}
    assert rows["hose"][2] == "fit failed"
    assert rows["valve mismatch"][2] == "not fitted (0 % predicted)"
    assert rows["Stribeck friction"][1:4] == ("97 %", "95 %", "93 to 96 %")


def test_refused_candidates_are_counted_not_listed():
    weak = replace(made.DRAG, names=("hose",), probability=0.001, closure=Closure(0.04, 0, 0.1))
    diagnosis = replace(made.EFFECT, ranking=(made.STRIBECK, weak, made.SILENT, made.FAILED))
    assert [row[0] for row in ranking_table(diagnosis).rows] == ["Stribeck friction"]
    assert refused_sentences(diagnosis) == (
        "Further candidates that were refused: 3. None reaches a probability of 1 %, and none "
        "removes more than 4 % of the gap; the fit of 1 failed or gave values that physics "
        "excludes. All are in diagnosis.json.",
    )
    assert note_sentences(replace(diagnosis, notes=("hose: no step was found", "a"))) == ("a",)
    page = diagnosis_html(diagnosis, [])
    assert "refused: 3" in page and "no step was found" not in page
    assert "refused: 3" in summary_text(diagnosis)
    both = replace(made.STRIBECK, names=("hose", "stribeck"), probability=0.0)
    with_both = replace(diagnosis, ranking=(*diagnosis.ranking, both))
    assert len(ranking_table(with_both).rows) == 1
    assert "more than 4 % of the gap without the effects found" in refused_sentences(with_both)[0]
    promising = replace(made.FAILED, explained=0.3)  # its fit could have changed the verdict
    open_ = replace(diagnosis, ranking=(made.STRIBECK, promising))
    assert note_sentences(open_) == open_.notes and not refused_sentences(open_)
    # Few bars say nothing: three candidates are drawn in any case.
    assert len(ranking_figure(diagnosis).axes[0].get_yticklabels()) == 3


@pytest.mark.parametrize("verdict", list(Verdict))
def test_what_a_verdict_names_is_in_the_ranking(verdict):
    diagnosis = made.ALL[verdict]
    shown = {row[0] for row in ranking_table(diagnosis).rows}
    named = {
        names for names in diagnosis.ambiguous if any(names == c.names for c in diagnosis.ranking)
    }
    assert shown >= {plain(joined_names(names)) for names in named}
    assert shown >= {plain(effect.name) for effect in diagnosis.effects}


@pytest.mark.parametrize(
    ("diagnosis", "words"),
    [
        (made.EFFECT, "`identify --with stribeck`; `design` plans"),
        (made.AMBIGUOUS, "record creep at three or more speeds"),
        (made.NONE, "check S_P in bench.json"),
        (replace(made.NONE, checks=()), "nothing for motions like these"),
        (made.ABSORBED, "check S_P in bench.json"),
        (made.UNKNOWN, "over the position x, again and again, such as the pitch of a belt"),
        (replace(made.UNKNOWN, discovered=None), "record where the residual is large"),
    ],
)
def test_every_verdict_says_what_to_do_next(diagnosis, words):
    assert words in next_step(diagnosis)
    assert "<dt>Next</dt>" in diagnosis_html(diagnosis, [])


def test_a_discovered_term_is_told_with_its_sizes():
    text = discovered_fact(made.DISCOVERED)
    assert "x/period" in text and "amplitude 28 N, period 9.6 mm" in text
    assert "closes 94 %" in text
    page = diagnosis_html(made.UNKNOWN, []).replace("\xa0", " ")
    assert "amplitude = 28.00 ± 0.40 N" in page and "period = 9.6000 ± 0.0020 mm" in page
    assert "again and again, such as the pitch of a belt" in page


def test_every_view_and_output_has_its_row():
    table = gap_table(made.EFFECT)
    assert len(table.rows) == 9
    assert table.rows[0] == ("open loop, windows of 0.5 s: p_P", "10 %", "0.50 %", "95 %", "0.50 %")


def test_without_effects_nothing_is_said_of_an_after():
    assert gap_table(made.NONE).columns == ("", "without effects", "sensor noise")
    assert fitted_table(made.NONE).columns == ("", "estimate")
    assert any("reduction" in text for text in size_sentences(made.EFFECT))
    assert not any("reduction" in text for text in size_sentences(made.NONE))


def test_checks_are_printed_in_units_that_people_read():
    rows = {row[0]: row for row in check_table(made.EFFECT).rows}
    assert rows["S_P"] == ("S_P", "cm²", "8.5000 ± 0.0020", "8.14 to 8.34", "NO")


def test_what_a_discovered_term_leaves_stands_beside_what_was_there():
    views = {view: dict(outputs) for view, outputs in made.UNKNOWN.gap.views.items()}
    views["windows"] = {name: {**gap, "with_term": 0.3} for name, gap in views["windows"].items()}
    gap = replace(made.UNKNOWN.gap, views=views, with_term=0.25)
    diagnosis = replace(made.UNKNOWN, gap=gap)
    table = gap_table(diagnosis)
    at = table.columns.index("with the discovered term")
    cells = {row[0]: row[at] for row in table.rows}
    assert cells["open loop, windows of 0.5 s: x"] == "0.30 %" and cells["closed loop: x"] == ""
    assert "With the discovered term it is 0.25 %." in size_sentences(diagnosis)
    assert "→ 0.25\xa0% with the discovered term" in diagnosis_html(diagnosis, [])
    labels = [text.get_text() for text in gap_figure(diagnosis).axes[0].get_legend().get_texts()]
    assert "with the discovered term" in labels
    assert "with the discovered term" not in summary_text(made.UNKNOWN)


def test_an_estimate_at_its_bound_has_no_interval():
    stuck = Value(0.0, 4.7, "N s/m", at_bound=True)
    diagnosis = replace(made.NONE, nominal={**made.NONE.nominal, "f_v": stuck})
    rows = dict(fitted_table(diagnosis).rows)
    assert rows["f_v"] == "0 N s/m (at its bound)"


def test_areas_that_are_estimated_are_shown_as_estimates():
    area = Value(8.7e-4, 1e-6, "m²")
    values = {"S_P": area, "M": Value(10.0, 0.1, "kg")}
    table = fitted_table(replace(made.NONE, nominal=values, fitted=values))
    assert [row[0] for row in table.rows] == ["S_P", "M"]
    assert "flow map" not in " ".join(table.notes)


def test_an_estimate_outside_its_range_does_not_simply_agree():
    mass = Check("M", 19.3, 0.3, 21.0, 1.05, "kg", True, "M = 19.3 kg")
    apart = replace(made.EFFECT, checks=(mass, replace(mass, value=20.5)))
    assert [row[-1] for row in check_table(apart).rows] == ["within 6σ", "yes"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Value(6e-10, 1.2e-12, "m³/(s Pa)"), "0.06000 ± 0.00024 l/(s bar)"),
        (Value(0.5, 0.0, "1"), "0.500 (not fitted)"),
        (Value(-1.0, float("nan"), "1"), "-1.000 (no interval)"),
        (Value(3.49e-9, 3e-12, "kg/Pa"), "3.4900 ± 0.0060 µg/Pa"),
        (Value(6.69e-4, 4.365e-4, "V"), "669 ± 873 µV"),
        (Value(-0.0087, 0.00295, "1"), "-0.0087 ± 0.0059"),
        (Value(2e-4, 6.5e-4, "rad"), "0.2 ± 1.3 mrad"),
        (Value(8.8e-5, 1.83e-4, "1/V"), "0.009 ± 0.037 %/V"),
        (Value(-4e-6, 1e-7, "m"), "-4.00 ± 0.20 µm"),
        (Value(2.5e8, 0.0, "Pa"), "250.000 MPa (not fitted)"),
    ],
)
def test_a_value_has_unit_and_interval(value, text):
    assert quantity(value) == text


def test_lines_of_the_summary_fit_a_terminal():
    sentences = summary_text(made.EFFECT).partition("Gap on held-out data")[0]
    assert max(map(len, sentences.splitlines())) <= 100
