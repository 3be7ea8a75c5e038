"""What is drawn: in proportion, reproducible, and told by nothing in the folders."""

import gzip
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check import Kind, Proportions, draw_cases
from pneumo_casadi.evaluation.sealed_check.draw import ABSORBED_FORMS, STRONG, Draw, make
from pneumo_casadi.virtual_bench import ALL_FORMS, FORMS, Severity, forms_of

LISTED = [name for name, form in FORMS.items() if form.listed]


def test_the_usual_draw_has_every_listed_form_at_every_severity_once():
    draws = draw_cases(160, seed=1, background=0.0)
    kinds = Counter(draw.kind.value for draw in draws)
    assert kinds == {
        "single": 75,
        "pair": 25,
        "none": 20,
        "absorbed": 10,
        "left_out": 15,
        "never_listed": 15,
    }
    singles = Counter(
        item for draw in draws if draw.kind is Kind.SINGLE for item in draw.effects.items()
    )
    assert set(singles.values()) == {1}
    assert {name for name, _ in singles} == set(LISTED)


def test_every_kind_holds_what_it_says():
    strong = {severity.value for severity in STRONG}
    for draw in draw_cases(320, seed=2):
        names = set(draw.effects)
        number = {Kind.NONE: 0, Kind.PAIR: 2}.get(draw.kind, 1)
        assert len(names) == number
        assert (names <= set(LISTED)) == (draw.kind is not Kind.NEVER_LISTED)
        assert draw.without == (tuple(names) if draw.kind is Kind.LEFT_OUT else ())
        if draw.kind in (Kind.PAIR, Kind.LEFT_OUT):
            assert not names & set(ABSORBED_FORMS)
        if draw.kind in (Kind.PAIR, Kind.LEFT_OUT, Kind.NEVER_LISTED):
            assert set(draw.effects.values()) <= strong
        if draw.kind is Kind.ABSORBED:
            assert names <= set(ABSORBED_FORMS)


@given(st.integers(1, 400), st.lists(st.floats(0, 50), min_size=6, max_size=6))
def test_counts_add_up_and_stay_within_one_of_their_share(cases, shares):
    if sum(shares) <= 0:
        shares[0] = 1.0
    proportions = Proportions(*shares)
    counts = proportions.counts(cases)
    assert sum(counts.values()) == cases
    for kind, share in zip(Kind, shares, strict=True):
        assert abs(counts[kind] - cases * share / sum(shares)) < 1 + 1e-6


def test_half_of_every_kind_has_weak_effects_of_other_causes_and_forms_vary():
    draws = draw_cases(320, seed=2)
    for kind in Kind:
        mine = [draw for draw in draws if draw.kind is kind]
        clouded = sum(bool(draw.background) for draw in mine)
        assert abs(clouded - len(mine) / 2) <= 1
    for draw in draws:
        assert not draw.background or 4 <= len(draw.background) <= 6
        assert not draw.background or "small" not in draw.effects.values()
        assert not draw.weak_causes & set(draw.effects)
        assert {ALL_FORMS[form].cause for form in draw.forms.values()} == set(draw.effects)
    several = [draw for seed in range(4) for draw in draw_cases(320, seed=seed)]
    hoses = {draw.forms["hose"] for draw in several if "hose" in draw.effects}
    assert hoses == set(forms_of("hose"))
    assert not any(draw.background for draw in draw_cases(20, seed=2, background=0.0))
    assert all(draw.background for draw in draw_cases(20, seed=2, background=1.0))


def test_a_label_survives_as_plain_data():
    for draw in draw_cases(20, seed=4):
        assert Draw.of(draw.as_dict()) == draw


def test_a_seed_draws_the_same_cases_and_another_one_others():
    assert draw_cases(40, seed=3) == draw_cases(40, seed=3) != draw_cases(40, seed=4)


def test_the_order_of_the_folders_tells_nothing_of_the_kinds():
    firsts = {draw_cases(160, seed=seed)[0].kind for seed in range(20)}
    assert len(firsts) > 1
    draws = draw_cases(160, seed=5)
    assert [draw.name for draw in draws] == [f"w{i:03d}" for i in range(1, 161)]
    assert len({draw.seed for draw in draws}) == 160


@pytest.mark.parametrize("wrong", [{"cases": 0, "seed": 1}, {"cases": 3, "seed": -1}])
def test_impossible_draws_are_refused(wrong):
    with pytest.raises(CaseError):
        draw_cases(**wrong)
    with pytest.raises(CaseError, match="negative"):
        Proportions(single=-1.0)


def test_a_case_folder_holds_no_label_and_its_twin_differs_in_the_effect_alone(tmp_path):
    draw_with_stribeck = next(
        draw for draw in draw_cases(160, seed=6) if "stribeck" in draw.effects
    )
    case = make(draw_with_stribeck, tmp_path / draw_with_stribeck.name, duration=2.0, fs=500.0)
    twin = make(replace(draw_with_stribeck, effects={}), tmp_path / "twin", duration=2.0, fs=500.0)
    words = [
        *ALL_FORMS,
        str(draw_with_stribeck.seed),
        "severity",
        *(kind.value for kind in Kind if kind.value != "none"),
    ]
    for path in case.folder.iterdir():
        raw = path.read_bytes()
        text = (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode()
        assert not [word for word in words if word in text], path
    assert twin.bench == case.bench
    assert (twin.identify[0]["x_ref"] == case.identify[0]["x_ref"]).all()
    assert (twin.validate[0]["x"] != case.validate[0]["x"]).any()


def test_labels_tell_what_weak_effects_have_a_tenth_of():
    (small,), (medium,) = (
        draw_cases(1, seed=2, background=1.0, weak=severity)
        for severity in (Severity.SMALL, Severity.MEDIUM)
    )
    assert (small.weak, medium.weak) == ("small", "medium")
    assert Draw.of(medium.as_dict()) == medium
    label = small.as_dict()
    del label["weak"]  # of labels written before
    assert Draw.of(label).weak == "medium"
