"""The README: its example runs, its commands exist, its picture is there."""

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

README = Path(__file__).parents[1] / "README.md"


@pytest.fixture(scope="module")
def readme() -> str:
    return README.read_text("utf-8")


def test_the_python_example_runs_on_files_with_other_columns(
    readme, embedded, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name in ("flow_map.csv", "bench.json"):
        shutil.copy(embedded / name, name)
    for target, source, rows in (
        ("one.csv", "identify.csv.gz", slice(25000, 37500)),
        ("two.csv", "validate.csv.gz", slice(0, 11000)),
    ):
        frame = pd.read_csv(embedded / source).iloc[rows]
        frame["p1_bar"], frame["p2_bar"] = frame.pop("p_P_Pa") / 1e5, frame.pop("p_N_Pa") / 1e5
        frame.rename(columns={"t_s": "time"}).to_csv(target, index=False)
    (block,) = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    assert len(block.strip().splitlines()) <= 12
    exec(compile(block, "README.md", "exec"), {})
    content = json.loads(Path("report/my_axis/result.json").read_text())
    assert content["output_error"]["parameters"]["M"]["value"] == pytest.approx(16.9, rel=0.02)


def test_the_two_commands_come_first(readme):
    blocks = re.findall(r"```sh\n(.*?)```", readme, re.DOTALL)
    assert blocks[0].strip().endswith("pneumo-casadi demo")
    assert "pytest" in blocks[1]
    assert all(len(block.strip().splitlines()) == 1 for block in blocks[:2])


def test_pictures_and_files_that_are_linked_exist(readme):
    targets = re.findall(r"\]\((?!https?:)([^)]+)\)", readme)
    assert targets
    assert not [target for target in targets if not (README.parent / target).is_file()]
