"""The comparison of two folders of results sees what differs, and nothing else."""

import json
import sys
from pathlib import Path

import pytest

BEFORE = {
    "cases": {"p01": {"verdict": "none", "X_s1": 3.49e-9, "leak": 1e-12, "M": 16.9}},
    "matrix": [[1.0, 1e-17], [0.25, 1.0]],
    "right": 12,
    "std": None,
    "seconds": 12.0,
    "versions": {"numpy": "2.1"},
}


@pytest.fixture(scope="module")
def same_numbers(script):
    return script(Path(__file__).resolve().parents[2] / "benchmarks" / "same_numbers.py")


@pytest.fixture
def compared(same_numbers, tmp_path, monkeypatch):
    """Return a function that compares two results, and gives exit code and differences."""

    def compare(before, after, *options):
        for name, content in (("a", before), ("b", after)):
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "table1.json").write_text(json.dumps(content), "utf-8")
        arguments = ["same_numbers.py", str(tmp_path / "a"), str(tmp_path / "b"), *options]
        monkeypatch.setattr(sys, "argv", arguments)
        with pytest.raises(SystemExit) as done:
            same_numbers.main()
        folders = same_numbers.compare_folders(tmp_path / "a", tmp_path / "b")
        return done.value.code, [difference.path for difference in folders]

    return compare


def changed(**values):
    """Return the result with values of the case, or others, replaced."""
    case = {name: value for name, value in values.items() if name in BEFORE["cases"]["p01"]}
    rest = {name: value for name, value in values.items() if name not in case}
    return BEFORE | {"cases": {"p01": BEFORE["cases"]["p01"] | case}} | rest


@pytest.mark.parametrize(
    "after",
    [
        BEFORE,
        changed(X_s1=3.49e-9 * (1 + 5e-10)),
        changed(M=16.9 * (1 - 5e-10)),
        changed(seconds=99.0, versions={"numpy": "3.0"}, machine="another"),
        changed(matrix=[[1.0, -3e-17], [0.25, 1.0]]),
    ],
    ids=["equal", "rounding", "rounding of a mass", "made elsewhere", "zero but for rounding"],
)
def test_the_same_figures_are_the_same(compared, after):
    assert compared(BEFORE, after) == (0, [])


@pytest.mark.parametrize(
    ("after", "path"),
    [
        (changed(X_s1=3.49e-9 * (1 + 2e-9)), "cases/p01/X_s1"),
        (changed(leak=1e-12 * (1 + 1e-6)), "cases/p01/leak"),
        (changed(verdict="unknown"), "cases/p01/verdict"),
        (changed(matrix=[[1.0, 1e-9], [0.25, 1.0]]), "matrix/0/1"),
        (changed(matrix=[[1.0, 1e-17]]), "matrix/1"),
        (changed(right=True), "right"),
        (changed(right=11), "right"),
        (changed(std=0.0), "std"),
        (changed(new_key=1), "new_key"),
    ],
)
def test_what_differs_is_named_by_its_path(compared, after, path):
    assert compared(BEFORE, after) == (1, [f"table1.json/{path}"])


def test_a_key_that_may_differ_is_left_out(compared, capsys):
    code, _ = compared(BEFORE, changed(verdict="unknown", new_key=1), "--allow", "verdict")
    assert code == 1
    assert "new_key: nothing -> 1" in capsys.readouterr().out
    code, _ = compared(BEFORE, changed(verdict="unknown"), "--allow", "verdict")
    assert code == 0


def test_a_file_that_is_in_one_folder_only_is_a_difference(same_numbers, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "emps.json").write_text("{}", "utf-8")
    (tmp_path / "b" / "table1.json").write_text("{}", "utf-8")
    (result,) = same_numbers.compare_folders(tmp_path / "a", tmp_path / "b")
    assert str(result) == 'table1.json: nothing -> "a file"'


def test_an_empty_folder_is_refused(same_numbers, tmp_path):
    with pytest.raises(FileNotFoundError, match="no JSON files"):
        same_numbers.compare_folders(tmp_path, tmp_path)
