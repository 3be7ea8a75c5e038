"""Nothing is lost, nothing is done twice, and an error is a verdict."""

import os
from functools import partial

import pytest

from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.evaluation.sealed_check import run
from pneumo_casadi.evaluation.sealed_check.run import diagnose_cases
from pneumo_casadi.evaluation.sealed_check.seal import OPENED, read_verdict, verdict_path

NAMES = ("w001", "w002", "w003")
NO_OPTIMUM = FitError("no optimum")


@pytest.fixture
def no_records(monkeypatch):
    """Hand over the folder instead of the records in it."""
    monkeypatch.setattr(run, "read_case", lambda folder: folder)


def fixed(case, catalogue, seen=None, fails=(), error=NO_OPTIMUM):
    if seen is not None:
        seen.append((case.name, frozenset(catalogue)))
    if case.name in fails:
        raise error
    return {"verdict": "none", "case": case.name}


def diagnose(folder, in_place, names=NAMES, missing=(), **options):
    left_out = {name: dict(missing).get(name, ()) for name in names}
    diagnose_cases(folder, left_out, partial(fixed, **options), in_place)


def test_every_case_gets_its_catalogue_and_one_verdict(tmp_path, no_records, in_place):
    seen = []
    diagnose(tmp_path, in_place, missing={"w002": ("hose",)}, seen=seen)
    assert dict(seen) == {
        "w001": frozenset(EFFECTS),
        "w002": frozenset(name for name, effect in EFFECTS.items() if effect.cause != "hose"),
        "w003": frozenset(EFFECTS),
    }
    assert [read_verdict(tmp_path, name)["case"] for name in NAMES] == list(NAMES)


def test_an_interrupted_run_goes_on_with_what_is_missing(tmp_path, no_records, in_place):
    with pytest.raises(KeyboardInterrupt):
        diagnose(tmp_path, in_place, seen=[], fails={"w002"}, error=KeyboardInterrupt())
    before = verdict_path(tmp_path, "w001").read_bytes()
    assert not verdict_path(tmp_path, "w002").exists()
    seen = []
    diagnose(tmp_path, in_place, seen=seen)
    assert "w001" not in dict(seen)
    assert "w002" in dict(seen)
    assert verdict_path(tmp_path, "w001").read_bytes() == before
    assert len(list(verdict_path(tmp_path, "w001").parent.iterdir())) == 3
    diagnose(tmp_path, in_place, seen=(nothing := []))
    assert nothing == []


def test_a_diagnosis_that_fails_has_failed_and_the_others_go_on(tmp_path, no_records, in_place):
    diagnose(tmp_path, in_place, fails={"w002"})
    assert read_verdict(tmp_path, "w002") == {"verdict": "failed", "error": "FitError: no optimum"}
    assert read_verdict(tmp_path, "w003")["verdict"] == "none"


@pytest.mark.parametrize("error", [OSError("disk full"), ImportError("no module")])
def test_a_fault_of_the_machine_is_no_verdict(tmp_path, no_records, in_place, error):
    with pytest.raises(type(error)):
        diagnose(tmp_path, in_place, fails={"w002"}, error=error)
    assert not verdict_path(tmp_path, "w002").exists()


def test_a_verdict_that_is_no_json_has_failed(tmp_path, no_records, in_place):
    def odd(case, catalogue):
        return {"verdict": "none", "gap": float("nan")}

    diagnose_cases(tmp_path, {"w001": ()}, odd, in_place)
    assert read_verdict(tmp_path, "w001")["verdict"] == "failed"


def test_no_verdict_is_given_once_the_labels_were_opened(tmp_path, no_records, in_place):
    diagnose(tmp_path, in_place)
    (tmp_path / OPENED).write_text("{}")
    diagnose(tmp_path, in_place)
    verdict_path(tmp_path, "w001").unlink()
    with pytest.raises(CaseError, match="labels were opened"):
        diagnose(tmp_path, in_place)
    assert not verdict_path(tmp_path, "w001").exists()


def test_progress_tells_what_is_done_and_what_is_left(tmp_path, no_records, in_place):
    told = []
    diagnose_cases(
        tmp_path, dict.fromkeys(NAMES, ()), fixed, in_place, lambda *step: told.append(step)
    )
    assert [round(share, 2) for _, share in told] == [0.33, 0.67, 1.0]
    assert told[-1][0] == "diagnosing: 3 of 3, 0 s left"


def test_a_killed_writer_leaves_no_half_verdict(tmp_path, no_records, in_place, monkeypatch):
    # The whole text is on its way to the disk, and has not its name yet.
    monkeypatch.setattr(os, "fsync", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        diagnose(tmp_path, in_place, names=("w001",))
    assert not list((tmp_path / "verdicts").glob("*"))
