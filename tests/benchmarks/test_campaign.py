"""A fast share of the campaigns of damaged and hostile files and of kills, with fixed seeds."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pneumo_casadi.identification.result_file import result_dict

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def figures(tmp_path_factory, quick):
    """Figures of a share of each campaign, of sound files that are made once."""
    pytest.importorskip("h5py")
    pytest.importorskip("pyarrow")
    folder = tmp_path_factory.mktemp("campaigns")
    (folder / "result.json").write_text(json.dumps(result_dict(quick)), "utf-8")
    script = Path(__file__).with_name("campaign_shares.py")
    command = [sys.executable, script, folder / "result.json", folder]
    done = subprocess.run(command, cwd=BENCHMARKS, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {path.stem: json.loads(path.read_text("utf-8")) for path in folder.glob("*.json")}


@pytest.mark.slow
def test_damaged_files_are_refused_or_named(figures):
    # What may be done to any JSON file is done to one of the four, and a sixth of the kinds
    # besides, some of each file; the campaign, whose result is committed, does all to all.
    damage = figures["damage"]
    assert [kind["cases"] for kind in damage["kinds"].values()] == [1] * damage["cases"]
    assert damage["cases"] >= 60
    for fault in ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless"):
        assert damage[fault] == 0, damage["examples"]


@pytest.mark.slow
def test_hostile_files_do_nothing_but_be_read(figures):
    assert figures["hostility"]["files"] >= 34
    assert figures["hostility"]["succeeded"] == 0, figures["hostility"]["won"]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are listed by Linux")
def test_commands_that_are_ended_leave_nothing_half_done(figures):
    assert figures["kills"]["kills"] == 2
    for fault in ("half", "left_processes", "left_drafts", "different"):
        assert figures["kills"][fault] == 0, figures["kills"]["examples"]


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
