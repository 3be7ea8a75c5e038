"""A fast share of the campaigns of damaged and hostile files and of kills, with fixed seeds."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Folder of the sound files that all scripts begin with, made by the first one."""
    return tmp_path_factory.mktemp("kept") / "bases"


@pytest.fixture
def figures_of(tmp_path, kept):
    """Return a function that runs a script in a process of its own and reads its figures.

    The workers of a script import it by its name.
    """
    given = os.environ | {"PNEUMO_CASADI_BASES": str(kept)}

    def run(script, *options):
        result = tmp_path / "figures.json"
        command = [sys.executable, script, *options, "--json", str(result)]
        done = subprocess.run(command, cwd=BENCHMARKS, env=given, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return json.loads(result.read_text("utf-8"))

    return run


@pytest.mark.slow
def test_damaged_files_are_refused_or_named(figures_of):
    # A third of the kinds of damage; the campaign, whose result is committed, does all of them.
    options = ["--cases", "105", "--seed", "4", "--workers", "1", "--commands", "0"]
    figures = figures_of("campaign.py", *options)
    assert [kind["cases"] for kind in figures["kinds"].values()].count(1) == 105
    for fault in ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless"):
        assert figures[fault] == 0, figures["examples"]


@pytest.mark.slow
def test_hostile_files_do_nothing_but_be_read(figures_of):
    figures = figures_of("hostile.py", "--quick")
    assert figures["files"] >= 88
    assert figures["succeeded"] == 0, figures["won"]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are listed by Linux")
def test_commands_that_are_ended_leave_nothing_half_done(figures_of):
    # Each signal once; tests/runtime/ ends workers, compilers and compiled functions by each.
    figures = figures_of("kills.py", "--kills", "4", "--seed", "7", "--only", "init", "--quick")
    assert figures["kills"] == 4
    for fault in ("half", "left_processes", "left_drafts", "different"):
        assert figures[fault] == 0, figures["examples"]


READERS = {
    "nothing": ("pass", ""),
    "an error of the library": ("from pneumo_casadi.errors import CaseError; raise CaseError", ""),
    "code": ("open(CANARY, 'w').close()", "code was run"),
    "a signal": ("import os; os.kill(os.getpid(), 11)", "the process ended with signal 11"),
    "a traceback": ("1 / 0", "a traceback: ZeroDivisionError"),
    "memory": ("bytes(2**40)", "memory was exhausted"),
}
ATTACKED = """
import json, sys
from pathlib import Path
from hostility.attack import Attack, succeeds
readers, folder, forked = json.loads(sys.argv[1])
for name, (read, _) in readers.items():
    at = Path(folder) / name.replace(" ", "_")
    at.mkdir()
    read = read.replace("CANARY", repr(f"{at}.canary"))
    print(succeeds(Attack(name, lambda folder, canary: None, read), at, forked))
"""


@pytest.mark.slow
@pytest.mark.parametrize("forked", [False, True])
def test_an_attack_that_succeeds_is_seen(forked, tmp_path):
    given = json.dumps([READERS, str(tmp_path), forked])
    command = [sys.executable, "-c", ATTACKED, given]
    done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for how, (_, expected) in zip(done.stdout.splitlines(), READERS.values(), strict=True):
        assert how.startswith(expected) if expected else not how
