"""Committed verdicts of the diagnosis against what it must reach."""

import json
from pathlib import Path

import pytest

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


@pytest.fixture(scope="module")
def practice():
    return json.loads((RESULTS / "practice_verdicts.json").read_text("utf-8"))


def test_at_least_eleven_of_twelve_practice_cases_are_right(practice):
    assert practice["of"] == 12
    assert practice["right"] == sum(case["right"] for case in practice["cases"].values()) >= 11


def test_a_case_with_the_whole_catalogue_takes_less_than_a_minute_and_two_gigabytes(practice):
    assert practice["longest_s"] < 60
    assert practice["peak_GiB"] < 2
    for case in practice["cases"].values():
        assert len({part for r in case["ranking"] for part in r["name"].split(" + ")}) >= 25


def test_all_blind_cases_have_a_verdict():
    blind = json.loads((RESULTS / "blind_verdicts.json").read_text("utf-8"))
    names = [f"b{i:02d}" for i in range(1, 19)]
    assert all(blind[name]["verdict"] for name in names)
