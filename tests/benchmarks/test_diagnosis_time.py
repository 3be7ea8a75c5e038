"""What an interrupted run has kept counts for the same work of the same code only."""

from pathlib import Path

import pytest

from pneumo_casadi.evaluation.sealed_check.draw import draw_cases

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def timing(script, monkeypatch):
    """Give the benchmark with diagnoses that take as many seconds as there were before."""
    module = script(BENCHMARKS / "diagnosis_time.py")
    runs = []

    def seconds_of(folder, cold=False):
        runs.append((folder.name, cold))
        return float(len(runs)), 1.0

    monkeypatch.setattr(module, "seconds_of", seconds_of)
    monkeypatch.setattr(module, "make", lambda draw, folder: None)
    monkeypatch.setattr(module, "runs", runs, raising=False)
    return module


def test_a_draw_is_timed_once_and_another_of_the_same_name_again(timing, tmp_path):
    first = timing.draws(3, None, tmp_path)
    assert timing.draws(3, None, tmp_path) == first and len(timing.runs) == 3
    assert draw_cases(4, timing.SEED)[0] != draw_cases(3, timing.SEED)[0]
    timing.draws(4, 1, tmp_path)
    assert len(timing.runs) == 4
    assert (first["draws_median_s"], first["slowest_s"]) == (2.0, 3.0)


def test_other_code_is_timed_again(timing, tmp_path, monkeypatch):
    timing.draws(2, None, tmp_path)
    monkeypatch.setattr(timing.provenance, "code_identity", lambda: "other")
    timing.draws(2, None, tmp_path)
    assert len(timing.runs) == 4


def test_practice_cases_count_their_median_and_three_of_them_an_empty_cache(timing, tmp_path):
    source = tmp_path / "practice"
    for name in ("p1", "p2", "p3", "p4", "p9_60s"):
        (source / name).mkdir(parents=True)
    (tmp_path / "keep").mkdir()
    figures = timing.practice(source, False, tmp_path / "keep")
    assert figures["each"] == {"p1": 3.0, "p2": 8.0, "p3": 13.0, "p4": 18.0}  # one run before each
    assert figures["median_s"] == 10.5 and figures["cold_extra_s"] == 2.0
    assert [name for name, cold in timing.runs if cold] == ["p1", "p2", "p3"]
    assert figures["long_s"] == 21.0
    again = timing.practice(source, False, tmp_path / "keep")
    assert again == figures and len(timing.runs) == 21
