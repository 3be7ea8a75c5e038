"""A diagnosis as text, tables, figures and page: what is printed is what was found."""

import importlib.util
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from pneumo_casadi.data import Finding, Grade
from pneumo_casadi.diagnosis import Value, Verdict
from pneumo_casadi.diagnosis.metrics.findings import Check, Closure, joined_names
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.warnings import Usability, Usable
from pneumo_casadi.report.figures.diagnosis.dashboard import dashboard_figure
from pneumo_casadi.report.figures.diagnosis.gap import gap_figure
from pneumo_casadi.report.figures.diagnosis.ranking import ranking_figure
from pneumo_casadi.report.figures.diagnosis.where import where_figure
from pneumo_casadi.report.figures.style import COLUMN, MM, PAGE
from pneumo_casadi.report.pages.diagnosis import _figures_of, diagnosis_html, write_diagnosis
from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.tables.diagnosis import gap_table, ranking_table
from pneumo_casadi.report.tables.quantities import quantity
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.tables.verdict.estimates import diagnosis_tables, fitted_table
from pneumo_casadi.report.tables.verdict.parameter_checks import check_table
from pneumo_casadi.report.text.causes import cause_sentences, described_as, discovered_fact
from pneumo_casadi.report.text.diagnosis import (
    alternative_sentences,
    headline,
    location_text,
    note_sentences,
    refused_sentences,
    size_sentences,
    summary_text,
    where_sentences,
)
from pneumo_casadi.report.text.facts import facts
from pneumo_casadi.report.text.final_model import FinalModel, final_sentences, final_title
from pneumo_casadi.report.text.next_step import next_step
from pneumo_casadi.report.text.parameter_checks import (
    check_sentences,
    check_summary,
    checks_of_what,
)
from pneumo_casadi.report.text.reference import numbered, reference_line

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)

_SIZES = "added by the effects [% of the balance's signal]"
SVG = b'<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="36pt"></svg>'


@pytest.fixture(scope="module")
def drawn():
    """The figures of a report, as `write_diagnosis` asks for them."""
    return {drawing.name: drawing for drawing in _figures_of(made.with_curves())}


#: Figures of a record, which the page draws over time, and of what it shows as it is.
FEW = ("validation_held_out", "discovered_term")


def pdf(figure):
    """Return no drawing in the place of `style.pdf`, whose name tells the file."""
    return b"%PDF-1.4"


def png(figure):
    """Return the beginning of a PNG file in the place of `style.png`."""
    return b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\4\0\0\0\2\0"


@pytest.fixture(scope="module")
def written(drawn, no_svg, tmp_path_factory):
    """A report with few figures, whose files hold no drawing: what is tested is the folder."""
    folder = tmp_path_factory.mktemp("diagnosis") / "report"
    few = [drawn[name] for name in FEW]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pneumo_casadi.report.pages.diagnosis._figures_of", lambda result: few)
        patch.setattr("pneumo_casadi.report.figures.style.svg", no_svg)
        patch.setattr("pneumo_casadi.report.figures.style.pdf", pdf)
        patch.setattr("pneumo_casadi.report.figures.style.png", png)
        patch.setattr("pneumo_casadi.report.pages.identification_figures.png", png)
        return write_diagnosis(made.with_curves(), folder)


@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_is_one_sentence(verdict):
    text = headline(made.ALL[verdict])
    assert text.endswith(".") and text[0].isupper()
    assert not re.search(r"\.\s", text)


def test_a_sensor_that_contradicts_the_others_stands_before_the_verdict():
    text = "`v` is 1.2 times the derivative of `x`; correct its gain."
    finding = Finding(Grade.SEVERE, "sensor of v", "v", text, source="identify")
    diagnosis = replace(made.EFFECT, findings=(finding,))
    lines = summary_text(diagnosis).splitlines()
    named = next(i for i, line in enumerate(lines) if "`v` is 1.2 times" in line)
    verdict = next(i for i, line in enumerate(lines) if line.startswith("Stribeck"))
    assert named < 6 and named < verdict
    page = diagnosis_html(diagnosis, [])
    assert page.index("Correct the records first") < page.index("Where model and measurement")
    assert diagnosis.as_dict()["findings"][0]["about"] == "v"
    assert "Correct the records" not in summary_text(made.EFFECT)


@pytest.mark.parametrize("verdict", list(Verdict))
def test_no_name_of_the_catalogue_is_printed_as_code(verdict):
    text = summary_text(replace(made.ALL[verdict], checks=(), nominal={}, fitted={}))
    assert not re.search(r"\b(valve|quadratic|mass)_", text)


def test_an_effect_is_said_with_its_size_in_units():
    assert "falls from 13 % to 0.64 %" in headline(made.EFFECT)
    (sentence,) = cause_sentences(made.EFFECT)
    assert "probability 97 %" in sentence
    assert "delta_F = 8.04 ± 0.15 N (breakaway force" in sentence
    assert "v_stribeck = 55.3 ± 1.0 mm/s" in sentence


def test_a_weak_effect_that_is_open_is_told_with_its_rivals_and_not_named():
    sentences = cause_sentences(made.UNDECIDED)
    assert len(sentences) == 2
    assert sentences[1] == (
        "Also there: valve null shift (37 %) or piston seal leakage (35 %); the data cannot tell "
        "which. Without it 1 % of the gap comes back."
    )
    assert "null shift" not in headline(made.UNDECIDED)
    page = diagnosis_html(made.UNDECIDED, {})
    assert "<dt>One of</dt>" in page
    assert made.UNDECIDED.as_dict()["undecided"][0]["rivals"] == {"piston_seal_leakage": 0.35}


def test_weak_effects_of_the_final_model_are_told_and_not_named():
    *_, sentence = cause_sentences(made.BESIDES)
    assert sentence == (
        "Probably also there, each too small to be named as a cause: hose and leakage of chamber P."
    )
    assert "hose" not in headline(made.BESIDES)
    assert "with Stribeck friction, hose and leakage of chamber P it is" in summary_text(
        made.BESIDES
    ).replace("\n  ", " ")
    assert "<dt>Probably also there</dt>" in diagnosis_html(made.BESIDES, {})
    assert [item["name"] for item in made.BESIDES.as_dict()["besides"]] == ["hose", "leakage_P"]


def test_what_parameters_have_absorbed_beside_an_effect_is_told_with_them():
    *_, sentence = cause_sentences(made.BESIDE_ABSORBED)
    assert sentence == (
        "Also there, absorbed by the parameters: valve mismatch. It shows in the fitted S_N and "
        "S_N/S_P, not in the simulation."
    )
    assert "<dt>Absorbed by the parameters</dt>" in diagnosis_html(made.BESIDE_ABSORBED, {})
    assert made.BESIDE_ABSORBED.as_dict()["absorbed"] == ["valve_mismatch"]


def test_what_parameters_have_absorbed_shows_in_those_to_use():
    area, ratio = made.BESIDE_ABSORBED.checks
    refined = replace(made.BESIDE_ABSORBED, refined_checks=(area, replace(ratio, agrees=True)))
    text = " ".join(cause_sentences(refined))
    assert "shows in the fitted S_N, not in the simulation" in text


def test_a_gap_that_grows_is_not_said_to_fall():
    worse = replace(made.EFFECT, gap=replace(made.EFFECT.gap, after=14.0))
    assert "does not fall" in headline(worse)


def test_what_cannot_be_told_apart_comes_with_the_experiment():
    text = " ".join(alternative_sentences(made.AMBIGUOUS))
    assert "Stribeck friction (probability 55 %)" in text and "Presliding" in text
    assert "creep at three or more speeds" in text


def test_several_causes_of_which_none_is_named_leave_no_gap_in_the_sentence():
    open_ = replace(made.AMBIGUOUS, ambiguous=(), experiment="", undecided=made.UNDECIDED.undecided)
    text = headline(open_)
    assert ": ;" not in text and "the data single out none; with Stribeck" in text
    assert next_step(open_, ready=True).startswith("record more of what sets the effects below")


def test_what_is_left_for_causes_outside_the_catalogue_is_said():
    doubtful = replace(made.EFFECT, ranking=(replace(made.STRIBECK, probability=0.7),))
    assert "the cause is not in the catalogue is 30 %" in " ".join(alternative_sentences(doubtful))
    assert "not in the catalogue" not in " ".join(alternative_sentences(made.EFFECT))


def test_the_hint_of_an_unknown_cause_and_rival_sensors_are_said():
    changed = replace(made.UNKNOWN, where=replace(made.UNKNOWN.where, rivals=("backlash",)))
    text = summary_text(changed)
    assert "backlash would give a similar error" in text.replace("\n ", "")
    without_term = replace(changed, discovered=None)  # a term says more than a hint
    assert made.UNKNOWN.hint in summary_text(without_term) and made.UNKNOWN.hint not in text
    assert "with Stribeck friction, the best candidate, it is 9.1 %" in " ".join(
        size_sentences(changed)
    )


def test_an_effect_of_ones_own_needs_no_description():
    assert described_as("gremlin", {}) == "An effect of your own."
    own = replace(made.EFFECT, effects=(replace(made.EFFECT.effects[0], name="gremlin"),))
    assert "Gremlin" in summary_text(own, {})


def test_nothing_wrong_does_not_hide_a_check_that_fails():
    assert "1 of 2 parameter checks fail" in headline(made.NONE)
    assert "fail" not in headline(replace(made.NONE, checks=made.NONE.checks[:1]))
    assert "Size of the gap" in summary_text(made.NONE)


def test_a_cause_in_the_parameters_does_not_talk_a_gap_away():
    assert "agrees with the records" in headline(made.ABSORBED)
    apart = headline(replace(made.ABSORBED, where=made.UNKNOWN.where, gap=made.UNKNOWN.gap))
    assert "agrees" not in apart
    assert "held-out data, beyond the sensor noise, is 13 % of the signals" in apart
    assert "valve mismatch may be the cause" in apart


def test_contradicting_checks_come_first():
    text = summary_text(made.EFFECT)
    assert text.index("contradicts: S_P comes out") < text.index("agrees: M = 16.9 kg")


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


def test_a_candidate_far_worse_than_none_is_an_arrow_at_the_edge():
    first = replace(made.EFFECT.ranking[0], closure=Closure(-3.2, -4.0, -2.5))
    figure = ranking_figure(replace(made.EFFECT, ranking=(first, *made.EFFECT.ranking[1:])))
    axes = figure.axes[1]
    arrow = next(line for line in axes.lines if line.get_marker() == "<")
    assert axes.get_xlim()[0] < arrow.get_xdata()[0] == -100
    assert all(axes.get_xlim()[0] <= x for line in axes.lines for x in line.get_xdata())


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


def test_a_model_that_is_ready_is_not_identified_again():
    assert next_step(made.EFFECT, ready=True).startswith("use the model in result.json")
    careful = next_step(made.EFFECT, ready=True, careful=True)
    assert careful.startswith("check what calls for care; then use the model in result.json")


def test_absorbed_parameters_are_not_to_be_used():
    final = FinalModel(Usability(Usable.WITH_CARE, "with care"), "16.5 ± 0.1 kg", (), {})
    head = dict(facts(made.ABSORBED, final))
    assert head["Parameters usable"].startswith("not S_P: ")
    assert head["Moving mass M, ± 2σ"] == "16.5 ± 0.1 kg"
    assert final_sentences(made.ABSORBED, final)[0].startswith("Do not use S_P: ")
    assert final_title(made.ABSORBED).endswith("not all of it to be used")


def test_the_next_record_shows_the_least_certain_effect():
    step = next_step(made.EFFECT, True, "Stribeck friction: v_stribeck, ± 2.5 % (2σ)")
    assert step.endswith("in creep at three or more speeds below and above the Stribeck velocity")
    assert next_step(made.EFFECT, True, "X_s2, ± 1 %").endswith("least certain is X_s2, ± 1 %")


def test_a_text_names_the_paper_that_it_quotes_once():
    text = summary_text(made.EFFECT)
    assert text.count("IFAC 2005") == (1 if "eq. " in text else 0)
    assert reference_line("polynomials (eq. 12 of the paper)").endswith("IFAC 2005.")
    assert numbered("eq. 12 of [1]") == "eq. 12 of [1]"


def test_parameters_without_the_cause_are_not_to_be_quoted():
    page, known = diagnosis_html(made.UNKNOWN, []), diagnosis_html(made.EFFECT, [])
    for words in ("no: the model lacks the cause", "Do not quote them"):
        assert words in page and words not in known
    assert "Do not quote them" in summary_text(made.UNKNOWN)


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


@pytest.mark.slow
@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_is_drawn_and_has_a_page(verdict):
    diagnosis = made.ALL[verdict]
    names = [drawing.name for drawing in diagnosis_figures(diagnosis)]
    assert "gap" in names and "ranking" in names
    page = Page(diagnosis_html(diagnosis, [Picture("gap", SVG, "A < B & more.")]))
    assert page.headings[0] == (1, "Diagnosis of press_4")
    assert all(after - before <= 1 for before, after in page.steps)
    assert "A < B & more." in page.alternatives


@pytest.mark.slow
def test_figures_are_as_wide_as_a_column_and_carry_units(drawn):
    assert set(drawn) == {
        *("gap", "ranking", "where", "unknown_inputs", "regimes_force", "dashboard"),
        *("discovered_term", "validation_held_out"),
    }
    for name, drawing in drawn.items():
        width = PAGE if name in ("dashboard", "validation_held_out") else COLUMN
        assert drawing.figure.get_figwidth() == pytest.approx(width * MM), name
        assert len(drawing.caption) > 60
        labels = [axes.get_xlabel() for axes in drawing.figure.axes] + [
            axes.get_ylabel() for axes in drawing.figure.axes
        ]
        assert all("[" in label for label in labels if label), (name, labels)


def test_bars_show_the_gap_before_and_after(drawn):
    first = drawn["gap"].figure.axes[0]
    widths = [bar.get_width() for container in first.containers for bar in container]
    assert widths == pytest.approx([10.0, 12.5, 15.0, 0.5, 0.625, 0.75])


def test_the_dashboard_says_the_verdict_and_shows_what_there_is(drawn):
    figure = drawn["dashboard"].figure
    assert figure.texts[0].get_text().replace("\n", " ") == headline(made.EFFECT)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels[1:] == [*("probability [%]", "closed in balances [%]", _SIZES, "$t$ [s]")]
    without = dashboard_figure(made.EFFECT)
    assert without.axes[-1].get_xlabel() == "share [%]"  # regimes where there are no curves


@pytest.mark.slow
@pytest.mark.parametrize("verdict", [Verdict.AMBIGUOUS, Verdict.UNKNOWN])
def test_the_headline_of_a_dashboard_stays_on_it(verdict):
    changed = replace(made.ALL[verdict], evidence=made.evidence())
    figure = dashboard_figure(changed)
    figure.draw_without_rendering()
    text, legend = figure.texts[0].get_window_extent(), figure.axes[0].get_legend()
    assert text.x0 > 0 and text.x1 < figure.bbox.x1 and text.y1 < figure.bbox.y1
    assert text.y0 > legend.get_window_extent().y1


@pytest.mark.slow
@pytest.mark.parametrize("verdict", [Verdict.EFFECT, Verdict.UNKNOWN])
def test_the_legend_of_the_gap_stays_on_the_figure(verdict):
    figure = gap_figure(made.ALL[verdict])
    figure.draw_without_rendering()
    legend = figure.axes[0].get_legend().get_window_extent()
    assert legend.x0 > 0 and legend.x1 < figure.bbox.x1 and legend.y1 < figure.bbox.y1


@pytest.mark.slow
def test_a_model_that_is_only_the_best_candidate_is_not_called_found():
    """If no effect is the cause, the curves of a second model are those of the best candidate."""
    changed = replace(made.UNKNOWN, evidence=made.evidence())
    names = {drawing.name: drawing for drawing in diagnosis_figures(changed)}
    for name, drawing in names.items():
        texts = [text.get_text() for text in drawing.figure.findobj(Text)]
        assert not any("found" in text for text in (*texts, drawing.caption)), name
    for name in ("gap", "regimes_force"):
        assert "without effects and with the best candidate" in names[name].caption


@pytest.mark.parametrize("diagnosis", [made.EFFECT, made.HOSE, made.UNKNOWN], ids=str)
def test_bars_and_sentence_name_the_same_balances(diagnosis):
    """Of a hose the unknown inputs are larger in one chamber, what it adds in the other."""
    (bars,) = where_figure(replace(diagnosis, where=replace(diagnosis.where, regimes=()))).axes
    lengths = dict(
        zip(diagnosis.where.shares, (bar.get_width() for bar in bars.patches), strict=True)
    )
    largest = max(lengths, key=lambda name: lengths[name])
    assert largest in diagnosis.where.balances
    assert {name for name in lengths if lengths[name] > 0.5 * lengths[largest]} == set(
        diagnosis.where.balances
    )


def test_both_chambers_are_named_where_both_are_affected():
    assert location_text(made.HOSE) == "mass flows into both chambers"


def test_parameters_that_alone_contradict_the_bench_have_a_place():
    diagnosis = made.ABSORBED_IN_N
    assert location_text(diagnosis) == "in parameters: mass flow into chamber N"
    assert location_text(made.ABSORBED) == "in parameters, not in the simulation"
    assert "agrees with the records" in headline(diagnosis)
    assert "Only parameters contradict the bench" in summary_text(diagnosis)
    assert diagnosis.as_dict()["where"]["in_parameters"] is True
    assert made.EFFECT.as_dict()["where"]["in_parameters"] is False
    sentence = where_sentences(made.HOSE)[0]
    assert sentence == "Model and measurement disagree in the mass flows into both chambers."


def test_an_effect_has_one_name_whatever_its_form():
    """The name of the form is said once, beside those of the other forms."""
    page = diagnosis_html(made.HOSE, [])
    text = re.sub(r"<(style|script|code).*?</\1>", "", page, flags=re.DOTALL)
    assert "hose_volume" not in text
    assert text.count("hose volume") == 1
    assert "hose: V" in text


def test_a_form_that_was_fitted_beside_other_effects_only_closes_nothing_alone():
    *others, hose = made.HOSE.effects
    effects = (*others, replace(hose, forms={"hose": 0.55}))
    text = summary_text(replace(made.HOSE, effects=effects))
    assert "hose volume was fitted beside other effects only" in text
    assert "the others close: hose 55 %" in text


def test_while_the_axis_sticks_no_unknown_force_is_drawn(drawn):
    force = drawn["unknown_inputs"].figure.axes[-1]
    curve = next(line for line in force.lines if line.get_xdata().size == 200)
    assert np.flatnonzero(np.isnan(curve.get_ydata())).tolist() == list(range(40, 60))
    assert max(np.abs(force.get_ylim())) < 20.0  # bands of nothing do not set the scale


def test_a_picture_knows_its_size_whatever_its_kind():
    picture = Picture("gap", SVG, "Gap.")
    assert (picture.width, picture.height) == (96, 48)
    assert picture.uri.startswith("data:image/svg+xml;base64,")
    with pytest.raises(ValueError, match="gap: no PNG"):
        _ = Picture("gap", b"nonsense", "Gap.").width


@pytest.mark.slow
def test_a_folder_is_written_whole(written):
    assert {path.name for path in written.iterdir()} == {
        "diagnosis.json",
        "curves.json",
        "report.html",
        "summary.txt",
        "discovered_term.json",
        "figures",
        ".pneumo_casadi.json",
    }
    content = json.loads((written / "diagnosis.json").read_text("utf-8"))
    assert content == json.loads(json.dumps(made.with_curves().as_dict()))
    assert {path.name for path in (written / "figures").iterdir()} == {
        name + suffix for name in FEW for suffix in (".png", ".svg", ".pdf")
    }
    alternatives = Page((written / "report.html").read_text("utf-8")).alternatives
    assert len(alternatives) == len(FEW)
    assert any(text.startswith("The discovered term over its driver") for text in alternatives)


def test_a_folder_with_anything_else_in_it_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(CaseError, match=r"thesis\.tex"):
        write_diagnosis(made.EFFECT, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.slow
def test_the_page_requests_nothing_and_is_built_of_headings_tables_and_captions(drawn):
    pictures = [Picture(name, SVG, drawing.caption) for name, drawing in drawn.items()]
    text = diagnosis_html(made.with_curves(), pictures)
    page = Page(text)
    assert page.language == "en"
    assert all(address.startswith(("#", "data:")) for address in page.addresses)
    own = text.partition("<script>")[0]  # the scripts of the time plots stand at the end
    assert "@import" not in own and "url(" not in own and "http" not in own
    anchors = {address[1:] for address in page.addresses if address.startswith("#")}
    assert anchors <= page.ids
    assert len(page.alternatives) == 7 and all(
        len(alternative) > 60 for alternative in page.alternatives
    )
    tables = len(diagnosis_tables(made.EFFECT)) + 1  # and the legend
    assert page.count["table"] == page.count["caption"] == tables
    assert page.count["th"] > page.count["tr"]  # every row and column is named


def test_the_page_escapes_what_it_shows():
    page = diagnosis_html(replace(made.EFFECT, case="<script>", notes=("a < b & c",)), [])
    assert "<script>" not in page and "a &lt; b &amp; c" in page


class Page(HTMLParser):
    """What a reader that does not see finds in a page."""

    def __init__(self, text):
        super().__init__()
        self.headings, self.addresses, self.alternatives = [], [], []
        self.ids, self.count, self.language, self._level = set(), {}, None, 0
        self.feed(text)

    @property
    def steps(self):
        levels = [level for level, _ in self.headings]
        return list(pairwise(levels))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.count[tag] = self.count.get(tag, 0) + 1
        self.ids |= {given["id"]} if "id" in given else set()
        self.addresses += [given[key] for key in ("href", "src") if key in given]
        if tag == "html":
            self.language = given.get("lang")
        if tag == "img":
            self.alternatives.append(given["alt"])
        self._level = int(tag[1]) if re.fullmatch("h[1-6]", tag) else self._level

    def handle_data(self, data):
        if self._level:
            self.headings.append((self._level, data))
            self._level = 0
