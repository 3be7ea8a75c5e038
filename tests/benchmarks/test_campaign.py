"""A fast share of the campaigns of damaged and hostile files and of kills, with fixed seeds."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def figures_of(tmp_path):
    """Return a function that runs a script in a process of its own and reads its figures.

    The workers of a script import it by its name.
    """

    def run(script, *options):
        result = tmp_path / "figures.json"
        command = [sys.executable, script, *options, "--json", str(result)]
        done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return json.loads(result.read_text("utf-8"))

    return run


@pytest.mark.slow
def test_damaged_files_are_refused_or_named(figures_of):
    options = ["--cases", "1000", "--seed", "4", "--workers", "2", "--commands", "0"]
    figures = figures_of("campaign.py", *options)
    assert figures["cases"] == 1000
    for fault in ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless"):
        assert figures[fault] == 0, figures["examples"]


@pytest.mark.slow
def test_hostile_files_do_nothing_but_be_read(figures_of):
    # Those that try to run code by way of exported functions; all of them take minutes.
    figures = figures_of("hostile.py", "--quick")
    assert figures["files"] >= 9
    assert figures["succeeded"] == 0, figures["won"]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are listed by Linux")
def test_commands_that_are_ended_leave_nothing_half_done(figures_of):
    # Each signal once; tests/runtime/ ends workers, compilers and compiled functions by each.
    figures = figures_of("kills.py", "--kills", "4", "--seed", "7", "--quick")
    assert figures["kills"] == 4
    for fault in ("half", "left_processes", "left_drafts", "different"):
        assert figures[fault] == 0, figures["examples"]
