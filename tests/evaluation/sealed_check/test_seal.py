"""Nothing is opened too early, and nothing that was tampered with is scored."""

import json

import pytest

from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check import draw_cases
from pneumo_casadi.evaluation.sealed_check.seal import opened, seal, verdict_path, write_verdict

DRAWS = draw_cases(4, seed=11)


@pytest.fixture
def sealed(tmp_path):
    seal(tmp_path, DRAWS, 2.0, 500.0)
    return tmp_path


@pytest.fixture
def answered(sealed):
    for draw in DRAWS:
        write_verdict(sealed, draw.name, {"verdict": "none", "ranking": []})
    return sealed


def edit(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_the_seal_says_nothing_but_a_hash(sealed):
    text = (sealed / "seal.json").read_text()
    content = json.loads(text)
    assert content["cases"] == 4
    assert len(content["sha256"]) == 64
    salt = json.loads((sealed / "labels.sealed").read_text())["salt"]
    assert len(salt) == 64
    assert salt not in text


def test_equal_draws_are_sealed_with_different_salts(sealed, tmp_path):
    seal(tmp_path / "other", DRAWS, 2.0, 500.0)
    hashes = [
        json.loads((f / "seal.json").read_text())["sha256"] for f in (sealed, tmp_path / "other")
    ]
    assert hashes[0] != hashes[1]


def test_sealing_again_changes_nothing_and_another_draw_is_refused(sealed):
    before = (sealed / "seal.json").read_bytes(), (sealed / "labels.sealed").read_bytes()
    seal(sealed, DRAWS, 2.0, 500.0)
    assert before == ((sealed / "seal.json").read_bytes(), (sealed / "labels.sealed").read_bytes())
    for other in ((draw_cases(4, seed=12), 2.0), (DRAWS, 3.0)):
        with pytest.raises(CaseError, match="another seed, number or length"):
            seal(sealed, *other, 500.0)


def test_labels_open_when_all_is_answered(answered):
    draws, verdicts = opened(answered)
    assert draws == DRAWS
    assert {verdict["verdict"] for verdict in verdicts.values()} == {"none"}
    assert opened(answered) == (draws, verdicts)


def test_labels_stay_closed_while_a_verdict_is_missing(answered):
    verdict_path(answered, "w002").unlink()
    with pytest.raises(CaseError, match="3 verdicts on 4 cases"):
        opened(answered)
    assert not (answered / "opened.json").exists()


def test_a_changed_label_is_refused(answered):
    edit(answered / "labels.sealed", lambda c: c["labels"]["draws"][0].update(kind="pair"))
    with pytest.raises(CaseError, match="not the labels"):
        opened(answered)


def test_another_salt_or_seal_is_refused(answered):
    edit(answered / "labels.sealed", lambda c: c.update(salt="0" * 64))
    with pytest.raises(CaseError, match="not the labels"):
        opened(answered)


def test_a_changed_verdict_is_refused(answered):
    edit(verdict_path(answered, "w003"), lambda c: c["verdict"].update(verdict="unknown"))
    with pytest.raises(CaseError, match=r"w003\.json: not as the diagnosis wrote it"):
        opened(answered)


def test_a_verdict_passed_off_for_another_case_is_refused(answered):
    verdict_path(answered, "w003").write_bytes(verdict_path(answered, "w001").read_bytes())
    with pytest.raises(CaseError, match=r"w003\.json"):
        opened(answered)


def test_a_verdict_given_anew_after_the_labels_were_opened_is_refused(answered):
    opened(answered)
    write_verdict(answered, "w003", {"verdict": "effect", "effects": [{"name": "stribeck"}]})
    with pytest.raises(CaseError, match="since the labels were opened"):
        opened(answered)


@pytest.mark.parametrize("content", ["", "[]", '{"sha256": 1'])
def test_a_file_cut_short_is_told(answered, content):
    verdict_path(answered, "w001").write_text(content)
    with pytest.raises(CaseError, match="w001"):
        opened(answered)
