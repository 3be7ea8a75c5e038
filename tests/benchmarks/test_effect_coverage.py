"""Effects in records of the package's own model: sizes come out as they went in."""

import json
from pathlib import Path

import pytest

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


@pytest.mark.slow
def test_the_lag_of_a_valve_is_not_shortened_by_half_a_sample(script):
    """An input that is held has two values from the middle of a sample to that of the next."""
    made = script(RESULTS.parent / "effect_coverage.py").one_case(0.0, ("valve_dynamics", 0))
    tau = made["parameters"]["tau"]
    assert tau["value"] == pytest.approx(tau["truth"], rel=0.01)  # half of 1 ms is a tenth
    assert abs(tau["value"] - tau["truth"]) < 3 * tau["std"]


def test_at_least_a_hundred_cases_of_each_kind_of_noise_are_counted():
    result = json.loads((RESULTS / "effect_coverage.json").read_text("utf-8"))
    for noise in ("white", "coloured"):
        assert result[noise]["cases"] >= 100
        of = sum(share["of"] for share in result[noise]["by_effect"].values())
        assert result[noise]["coverage"]["of"] == of


def test_intervals_of_named_effects_cover_where_forms_agree_and_noise_is_white():
    result = json.loads((RESULTS / "effect_coverage.json").read_text("utf-8"))
    assert 90 <= result["white"]["coverage"]["percent"] <= 97
    assert result["white"]["named"]["percent"] >= 95


def test_coloured_noise_hides_few_effects():
    """Taken for white it left the right model eight noise floors: 37 of 120 were named."""
    result = json.loads((RESULTS / "effect_coverage.json").read_text("utf-8"))
    assert result["coloured"]["named"]["percent"] >= 80
