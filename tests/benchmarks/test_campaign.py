"""A fast share of the campaign of damaged files, with a fixed seed."""

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.slow
def test_damaged_files_are_refused_or_named(script, monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    figures = script(BENCHMARKS / "campaign.py").campaign(1000, seed=4, workers=2, commands=0)
    assert figures["cases"] == 1000
    for fault in ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless"):
        assert figures[fault] == 0, figures["examples"]
