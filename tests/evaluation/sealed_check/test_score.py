"""Scores equal what is counted by hand."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.evaluation.sealed_check import Share, calibration, read_answer, scored
from pneumo_casadi.evaluation.sealed_check.true_balance import (
    ACTING_ELSEWHERE,
    acting_in,
    balances_of,
)
from pneumo_casadi.virtual_bench import ALL_FORMS, FORMS


def hits(result, name, of="all"):
    share = result["scores"][of][name]
    return share["hits"], share["of"]


def test_singles_are_counted_as_by_hand(told, judged):
    others = ["hose", "backlash"]
    cases = [
        judged("single", "stribeck", told("effect", "stribeck", ranking=["stribeck", *others])),
        judged("single", "stribeck", told("effect", "hose", ranking=["hose", "stribeck"])),
        judged("single", "stribeck", told("effect", "stribeck", "hose")),
        judged("single", "stribeck", told("none", ranking=["stribeck"]), visible=False),
        judged(
            "single",
            "stribeck",
            told("ambiguous", ranking=["hose", "stribeck"], ambiguous=["hose", "stribeck"]),
        ),
        judged("single", "stribeck", told("absorbed", ranking=["stribeck"])),
        judged("single", "stribeck", told("unknown", ranking=["a", "b", "c", "stribeck"])),
    ]
    scores = scored(cases)
    assert hits(scores, "right_first") == (2, 7)
    assert hits(scores, "right_first", "visible") == (2, 6)
    assert hits(scores, "ranked_first") == (3, 7)
    assert hits(scores, "first_three") == (5, 7)
    assert hits(scores, "set_covers") == (4, 7)
    assert hits(scores, "set_covers_given") == (4, 5)
    assert hits(scores, "false_unknown") == (1, 7)
    assert scores["scores"]["all"]["set_size"] == {"mean": (1 + 1 + 2 + 2 + 1) / 5, "of": 5}
    assert scores["effects"] == {
        "stribeck": {"medium": {"right_first": 2, "first_three": 5, "visible": 6, "of": 7}}
    }


def test_nothing_wrong_unknown_and_absorbed_are_counted_as_by_hand(told, judged):
    cases = [
        judged("none", "", told("none")),
        judged("none", "", told("effect", "hose")),
        judged("none", "", told("absorbed", ranking=["constant_force"])),
        judged("none", "", told("unknown")),
        judged("left_out", "hose", told("unknown", balance="mass_flow_N")),
        judged("left_out", "hose", told("effect", "backlash", balance="measurement")),
        judged("never_listed", "cogging", told("unknown")),
        judged("never_listed", "cogging", told("none"), visible=False),
        judged("absorbed", "constant_force", told("absorbed", ranking=["constant_force"])),
        judged("absorbed", "constant_force", told("effect", "hose")),
        judged("absorbed", "constant_force", told("none")),
    ]
    scores = scored(cases)
    assert hits(scores, "false_alarm") == (2, 4)
    assert hits(scores, "false_unknown") == (1, 7)
    assert hits(scores, "unknown_caught") == (2, 4)
    assert hits(scores, "unknown_caught", "visible") == (2, 3)
    assert hits(scores, "unknown_caught_left_out") == (1, 2)
    assert hits(scores, "unknown_caught_never_listed") == (1, 2)
    assert hits(scores, "wrongly_named") == (1, 4)
    assert hits(scores, "located") == (3, 4)
    assert hits(scores, "absorbed_told") == (1, 3)
    assert hits(scores, "absorbed_misnamed") == (1, 3)


def test_pairs_are_counted_as_by_hand(told, judged):
    pair = "stribeck hose"
    cases = [
        judged("pair", pair, told("effect", "hose", "stribeck", balance="mass_flow_P")),
        judged("pair", pair, told("effect", "hose", "backlash", balance="force")),
        judged("pair", pair, told("effect", "backlash", balance="measurement")),
        judged("pair", pair, told("ambiguous", "hose", ambiguous=["stribeck"])),
        judged("pair", pair, told("unknown")),
    ]
    scores = scored(cases)
    assert hits(scores, "pair_one") == (3, 5)
    assert hits(scores, "pair_both") == (1, 5)
    assert hits(scores, "located") == (4, 5)
    assert scores["calibration"]["bins"][0]["hits"] + scores["calibration"]["bins"][-1]["hits"] <= 1


def test_the_ranking_counts_as_sets_whatever_the_order_in_a_label(told, judged):
    result = judged("pair", "stribeck hose", told("effect", "hose", "stribeck"))
    assert result.first_is_right
    assert not judged("left_out", "hose", told("effect", "hose")).first_is_right
    assert not judged("none", "", told("none", ranking=[""])).first_is_right


def test_the_shrink_is_compared_with_an_oracle_that_has_one(told, judged):
    def case(oracle, own, visible=True):
        content = told("effect", "stribeck")
        return judged(
            "single", "stribeck", content, oracle_shrink=oracle, named_shrink=own, visible=visible
        )

    cases = [case(0.8, 0.4), case(0.8, 0.8), case(0.5, -0.2), case(-0.1, 0.3), case(None, None)]
    scores = scored([*cases, case(0.9, 0.9, visible=False)])
    assert scores["scores"]["visible"]["shrink_of_oracle"] == {"median": 0.5, "of": 3}
    assert scores["scores"]["all"]["shrink_of_oracle"] == {"median": 0.75, "of": 4}


def test_rivals_are_counted_as_by_hand(told, judged):
    said_none = told("none")
    cases = [
        judged("single", "hose", said_none, by_error=["hose", "b", "c", "d"], by_aic=["hose"]),
        judged("single", "hose", said_none, by_error=["b", "c", "hose"], by_aic=["hose", "b"]),
        judged("single", "hose", said_none, by_error=["b", "c", "d", "hose"], by_aic=["b"]),
        judged("pair", "hose stribeck", said_none, by_error=["hose"], by_aic=["stribeck", "hose"]),
        judged("none", "", said_none, by_error=["hose"], by_aic=["hose"]),
        judged("none", "", said_none, by_error=["hose"], by_aic=[]),
    ]
    rivals = scored(cases)["rivals"]["all"]
    assert rivals["training_error"]["right_first"]["hits"] == 1
    assert rivals["training_error"]["first_three"]["hits"] == 2
    assert rivals["forward_aic"]["right_first"]["hits"] == 1
    assert rivals["forward_aic"]["first_chosen"]["hits"] == 2
    assert rivals["forward_aic"]["pair_both"]["hits"] == 1
    assert rivals["forward_aic"]["false_alarm"] == Share(1, 2).as_dict()
    assert rivals["chance"]["right_first_percent"] == pytest.approx(
        100 * (1 / 4 + 1 / 3 + 1 / 4) / 3
    )


def test_the_confusion_matrix_holds_every_case_but_pairs_once(told, judged):
    cases = [
        judged("single", "hose", told("effect", "hose")),
        judged("single", "hose", told("effect", "hose", "stribeck")),
        judged("single", "stribeck", told("none")),
        judged("none", "", told("effect", "hose")),
        judged("left_out", "hose", told("unknown")),
        judged("never_listed", "cogging", {"verdict": "failed", "error": "FitError: x"}),
        judged("pair", "hose stribeck", told("effect", "hose")),
    ]
    confusion = scored(cases)["confusion"]
    assert confusion["rows"] == ["hose", "stribeck", "none", "left_out", "never_listed"]
    assert confusion["columns"] == ["hose", "stribeck", "several", "none", "unknown", "failed"]
    assert confusion["counts"] == [
        [1, 0, 1, 0, 0, 0],
        [0, 0, 0, 1, 0, 0],
        [1, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 1, 0],
        [0, 0, 0, 0, 0, 1],
    ]


def test_a_case_that_could_not_be_measured_counts_as_not_visible(told, judged):
    result = judged("single", "hose", told("effect", "hose"), failure="CaseError: short")
    result.measured.pop("visible")
    scores = scored([result])
    assert scores["unmeasured"] == 1
    assert hits(scores, "right_first") == (1, 1)
    assert hits(scores, "right_first", "visible") == (0, 0)


def test_a_verdict_that_says_little_is_read(told):
    answer = read_answer({"verdict": "failed", "error": "x"})
    assert (answer.named, answer.offered, answer.ranking, answer.probability) == (
        set(),
        set(),
        (),
        0.0,
    )
    beside = read_answer(told("effect", "hose") | {"absorbed": ["valve_mismatch"]})
    assert (beside.first, beside.named) == ("hose", {"hose", "valve_mismatch"})
    answer = read_answer(told("ambiguous", "hose", ambiguous=["hose", "backlash + stribeck"]))
    assert answer.named == {"hose"}
    assert answer.offered == {"hose", "backlash", "stribeck"}


@given(st.integers(0, 60), st.integers(0, 60))
def test_an_interval_holds_its_share_and_mirrors(hits, misses):
    share, mirrored = Share(hits, hits + misses), Share(misses, hits + misses)
    low, high = share.interval
    assert 0 <= low <= high <= 1
    assert low == pytest.approx(1 - mirrored.interval[1], abs=1e-12)
    if share.of:
        assert low - 1e-12 <= hits / share.of <= high + 1e-12


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=80))
def test_a_calibration_error_is_at_least_the_error_of_the_mean(pairs):
    stated, right = [p for p, _ in pairs], [r for _, r in pairs]
    result = calibration(stated, right)
    assert sum(interval.share.of for interval in result.bins) == len(pairs)
    whole = abs(sum(stated) - sum(right)) / len(pairs)
    assert whole - 1e-9 <= result.error <= 1


def test_sure_and_right_is_calibrated_and_sure_and_wrong_is_not():
    assert calibration([1.0] * 20, [True] * 20).error == 0
    assert calibration([1.0] * 20, [False] * 20).error == 1


def test_every_form_of_the_bench_acts_somewhere():
    for name in FORMS:
        assert balances_of([name]), name
    assert acting_in(EFFECTS["supply_droop"]()) == {"mass_flow_P", "mass_flow_N"}
    assert acting_in(EFFECTS["valve_mismatch"]()) == {"mass_flow_N"}
    assert acting_in(EFFECTS["elastic_load"]()) == {"force"}
    assert acting_in(EFFECTS["pressure_sensor_lag"]()) == {"measurement"}
    with pytest.raises(ModelError, match="rust"):
        balances_of(["rust"])


def clouded(case, *forms):
    """The same case with weak effects besides."""
    return replace(case, draw=replace(case.draw, background=forms))


def test_cases_with_weak_effects_have_scores_of_their_own(judged, told):
    clean = judged("single", "stribeck", told("effect", "stribeck"))
    weak = ("spring_load_softening", "backlash")
    cases = [
        clean,
        clouded(judged("single", "stribeck", told("effect", "stribeck", "spring_load")), *weak),
        clouded(judged("single", "hose", told("effect", "backlash", "hose")), *weak),
        clouded(judged("single", "hose", told("effect", "leakage_P")), *weak),
        clouded(judged("none", "", told("effect", "backlash")), *weak),
        clouded(judged("never_listed", "cogging", told("effect", "spring_load")), *weak),
    ]
    result = scored(cases)
    assert (result["cases"], result["clean"]) == (6, 1)
    assert result["scores"]["all"]["right_first"]["of"] == 1
    background = result["background"]["all"]
    assert (background["names_true"]["hits"], background["names_true"]["of"]) == (6, 7)
    assert (background["dominant_named"]["hits"], background["dominant_named"]["of"]) == (2, 3)
    assert background["dominant_first"]["hits"] == 1
    assert background["false_alarm"]["hits"] == 0
    assert background["unknown_caught"]["hits"] == 0


def test_what_is_probably_also_there_counts_with_what_may_act_in_its_place(judged, told):
    def besides(*names, rivals=()):
        items = [{"name": name, "rivals": dict.fromkeys(rivals, 0.3)} for name in names]
        return {**told("effect", "stribeck"), "besides": items}

    cases = [
        clouded(judged("single", "stribeck", besides("backlash", "hose")), "backlash"),
        clouded(judged("single", "stribeck", besides("hose", rivals=["backlash"])), "backlash"),
        judged("pair", "stribeck hose", besides("hose")),
        judged("left_out", "hose", besides("hose")),
        judged("single", "stribeck", told("effect", "stribeck")),
    ]
    result = scored(cases)
    assert (result["besides"]["hits"], result["besides"]["of"]) == (3, 5)
    assert result["each"][1]["besides"] == ["backlash or hose"]


def test_the_largest_effect_is_the_one_without_which_the_gap_is_least(judged, told):
    """It may be another than the one drawn as dominant."""
    gaps = {"stribeck": 6.0, "backlash": 2.0, "spring_load": 7.0}
    answers = [("backlash", "stribeck"), ("stribeck", "backlash"), ("stribeck",)]
    cases = [
        clouded(judged("single", "stribeck", told("effect", *names), gap_without=gaps), "backlash")
        for names in answers
    ]
    background = scored(cases)["background"]["all"]
    hits = {key: background[key]["hits"] for key in background if "_first" in key}
    assert hits == {"dominant_first": 2, "largest_first": 1}
    assert (background["dominant_named"]["hits"], background["largest_named"]["hits"]) == (3, 2)


def test_discovered_terms_are_scored_by_what_they_depend_on(judged, told):
    def with_term(content, balance, driver, closes):
        term = {"balances": [balance], "driver": driver, "closes": {"value": closes}}
        return {**content, "discovered": term}

    unknown = told("unknown")
    cases = [
        judged("never_listed", "cogging", with_term(unknown, "force", "x", 0.9)),
        judged("never_listed", "cogging", with_term(unknown, "mass_flow_P", "x", 0.6)),
        judged("never_listed", "vibration", with_term(unknown, "force", "x", 0.3)),
        judged(
            "never_listed", "pressure_crosstalk", with_term(unknown, "measurement_P", "p_N", 0.6)
        ),
        judged("never_listed", "flow_drift", unknown, visible=False),
        judged("never_listed", "vibration", with_term(unknown, "force", "t_reversal", None)),
        judged("single", "stribeck", with_term(unknown, "force", "v", 0.5)),
        judged("none", "", told("none")),
    ]
    result = scored(cases)["discovered"]
    assert (result["driver_right"]["hits"], result["driver_right"]["of"]) == (2, 6)
    visible = result["visible"]["driver_right"]
    assert (visible["hits"], visible["of"]) == (2, 5)
    assert result["closes"] == {"median": 0.6, "of": 4}
    assert (result["false_term"]["hits"], result["false_term"]["of"]) == (1, 2)
    assert cases[0].as_dict()["driver"] == "x" and cases[0].as_dict()["closes"] == 0.9


def test_both_of_a_pair_are_asked_for_where_each_shows_beside_the_other(judged, told):
    shown = {"stribeck": True, "hose": True}
    cases = [
        judged("pair", "stribeck hose", told("effect", "hose", "stribeck"), shows_beside=shown),
        judged("pair", "stribeck hose", told("effect", "hose"), shows_beside=shown),
        judged(
            "pair", "stribeck hose", told("effect", "hose"), shows_beside=shown | {"hose": False}
        ),
        judged("pair", "stribeck hose", told("effect", "hose")),
    ]
    scores = scored(cases)
    assert hits(scores, "pair_both", "visible") == (1, 4)
    assert hits(scores, "pair_both_shown", "visible") == (1, 2)


def test_of_causes_outside_the_catalogue_those_with_the_largest_gap_are_counted_besides(
    judged, told
):
    gaps = [{"cogging": 1.0, "backlash": 2.0}, {"cogging": 2.0, "backlash": 1.0}]
    cases = [
        clouded(judged("never_listed", "cogging", told(word), gap_without=gaps[i]), "backlash")
        for word, i in (("unknown", 0), ("effect", 1))
    ]
    background = scored(cases)["background"]["all"]
    assert (background["unknown_caught"]["hits"], background["unknown_caught"]["of"]) == (1, 2)
    assert (background["unknown_largest"]["hits"], background["unknown_largest"]["of"]) == (1, 1)


def test_forms_of_the_same_causes_are_one_entry_of_a_ranking(told):
    content = told("effect", "hose", ranking=["a + b", "hose", "b + a"], probability=0.5)
    answer = read_answer(content)
    assert answer.ranking == ({"a", "b"}, {"hose"})
    assert answer.probability == pytest.approx(0.75)


def test_a_form_whose_sensor_sits_elsewhere_shows_in_the_measurement_too(judged, told):
    case = judged("left_out", "elastic_load", told("unknown", balance="measurement"))
    assert hits(scored([case]), "located") == (0, 1)
    assert ACTING_ELSEWHERE.keys() <= ALL_FORMS.keys()
    recorded = replace(case.draw, forms={"elastic_load": "elastic_load_measured"})
    assert hits(scored([replace(case, draw=recorded)]), "located") == (1, 1)


def test_a_play_before_a_load_acts_in_the_force_balance(judged, told):
    """Of the usual form, between piston and sensor, the balances of the motion show nothing."""
    case = judged("left_out", "backlash", told("unknown", balance="force"))
    assert hits(scored([case]), "located") == (0, 1)
    recorded = replace(case.draw, forms={"backlash": "backlash_two_masses"})
    assert hits(scored([replace(case, draw=recorded)]), "located") == (1, 1)


def test_an_exact_statement_shows_the_error_of_its_own_probabilities():
    """Two sure statements and one of a half err by a half on average, whatever their mean."""
    assert calibration([1.0, 0.5, 0.0], [True, True, False], bins=1).error_if_exact == 0.1667
