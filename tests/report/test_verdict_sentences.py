"""What a diagnosis says in sentences is what was found."""

import importlib.util
import re
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib.text import Text

from pneumo_casadi.data import Finding, Grade
from pneumo_casadi.diagnosis import EffectFound, Value, Verdict
from pneumo_casadi.effects.term import Term
from pneumo_casadi.identification.warnings import Usability, Usable
from pneumo_casadi.report.figures.diagnosis.where import where_figure
from pneumo_casadi.report.pages.diagnosis import diagnosis_html
from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures
from pneumo_casadi.report.text.causes import cause_sentences, described_as, suspects
from pneumo_casadi.report.text.diagnosis import (
    alternative_sentences,
    headline,
    location_text,
    size_sentences,
    summary_text,
    where_sentences,
)
from pneumo_casadi.report.text.facts import facts
from pneumo_casadi.report.text.final_model import FinalModel, final_sentences, final_title
from pneumo_casadi.report.text.next_step import next_step
from pneumo_casadi.report.text.reference import numbered, reference_line

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)


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


def test_what_corrects_the_flow_map_is_not_told_as_probably_there():
    *_, weak, sentence = cause_sentences(made.CORRECTED)
    assert "shape" not in weak
    assert (
        sentence == "Flow map shape corrects what the form of the flow map misses, and is no cause."
    )
    assert "<dt>Corrects the flow map</dt>" in diagnosis_html(made.CORRECTED, {})
    # What held-out records do not ask for is in the model, and nothing is said of it.
    forms = [effect.form for effect in made.CORRECTED.final_effects]
    assert forms[-2:] == ["flow_map_shape", "elastic_load"]
    assert "lastic" not in " ".join(cause_sentences(made.CORRECTED))
    assert [item["name"] for item in made.CORRECTED.as_dict()["corrections"]] == ["flow_map_shape"]


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


def test_a_model_that_is_ready_is_not_identified_again():
    assert next_step(made.EFFECT, ready=True).startswith("use the model in result.json")
    careful = next_step(made.EFFECT, ready=True, careful=True)
    assert careful.startswith("check what calls for care; then use the model in result.json")


@pytest.mark.parametrize("settled", [True, False])
def test_weak_effects_that_the_final_model_is_without_are_told(settled):
    hose = EffectFound("hose", 0.8, {})
    values = {"hose.R": Value(1e8, 1e7, "1/m⁴")} if settled else {}
    final = FinalModel(Usability(Usable.YES, "Yes."), "16.5 ± 0.1 kg", (), values)
    text = " ".join(final_sentences(replace(made.EFFECT, besides=(hose,)), final))
    assert ("It is without hose: output error" in text) is not settled


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


@pytest.mark.parametrize(("factor", "told"), [("dq_m/du", True), ("q_m", False)])
def test_a_command_that_wanders_is_looked_for_where_one_was_found(factor, told):
    flows = ("mass_flow_P", "mass_flow_N")
    term = Term("discovered", flows, factor, "t", "line", {"slope": 1e-3})
    text = suspects(replace(made.DISCOVERED, term=term))
    assert ("null of the valve" in text) == told and ("supply that drifts" in text) != told
