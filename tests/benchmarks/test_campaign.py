"""A fast share of the campaign of damaged files, with a fixed seed."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.mark.slow
def test_damaged_files_are_refused_or_named(tmp_path):
    # In a process of its own: its workers import the script by its name.
    result = tmp_path / "campaign.json"
    options = ["--cases", "1000", "--seed", "4", "--workers", "2", "--commands", "0"]
    command = [sys.executable, "campaign.py", *options, "--json", str(result)]
    done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    figures = json.loads(result.read_text("utf-8"))
    assert figures["cases"] == 1000
    for fault in ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless"):
        assert figures[fault] == 0, figures["examples"]
