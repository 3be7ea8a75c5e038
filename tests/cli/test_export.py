"""The command `export`."""

import json

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.export import read_functions, read_model
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.runtime.json_files import write_json

FILES = {
    "json": {"axis.json"},
    "casadi": {"rhs.casadi", "step.casadi", "output.casadi", "functions.json"},
    "c": {"axis.c", "axis.h", "main.c"},
    "fmu": {"axis.fmu"},
    "ss": {"axis_ss.json", "axis_ss.mat"},
}


@pytest.fixture(scope="module")
def result(quick, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_json(result_dict(quick), folder / "result.json")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kind", FILES)
def test_each_format_is_written_and_named(result, tmp_path, capsys, kind):
    out = tmp_path / "out"
    assert cli.run(["export", str(result), "--format", kind, "-o", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == FILES[kind] | {".pneumo_casadi.json"}
    printed = capsys.readouterr().out.split()
    assert {name.rpartition("/")[2] for name in printed} == FILES[kind]


@pytest.mark.slow
def test_an_export_of_an_export_is_the_same_model(result, quick, tmp_path):
    for kind, source in (("json", result), ("casadi", tmp_path / "axis.json")):
        assert cli.run(["export", str(source), "-f", kind, "-o", str(tmp_path)]) == 0
    assert read_model(tmp_path / "axis.json").axis.parameters.names == quick.axis.parameters.names
    read = read_functions(tmp_path)
    x, u = read.start, [0.5, -0.5]
    expected = quick.axis.rhs(x, u, quick.axis.parameters.values).full().ravel()
    assert read.rhs(x, u).full().ravel() == pytest.approx(expected, rel=1e-12)


def test_an_operating_point_can_be_named(result, tmp_path):
    arguments = ["export", str(result), "-f", "ss", "-o", str(tmp_path), "--at", "v=0.2"]
    assert cli.run([*arguments, "--at", "x=0.1"]) == 0
    content = json.loads((tmp_path / "axis_ss.json").read_text("utf-8"))
    assert content["operating_point"]["x"][2:] == [0.1, 0.2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-f", "ss", "--at", "v"], "--at v: expected NAME=VALUE in SI units, as x=0.1"),
        (["-f", "ss", "--at", "v=fast"], "--at v=fast"),
        (["-f", "ss", "--at", "w=1"], "no state or input w"),
        (["-f", "ss", "--at", "x=0.9"], "x = 0.9 m lies outside the stroke"),
        (["-f", "c", "--at", "v=1"], "--at applies to --format ss only"),
        (["-f", "simulink"], "--help"),
    ],
)
def test_wrong_usage_is_one_line_and_leaves_nothing(result, tmp_path, capsys, arguments, message):
    out = tmp_path / "out"
    assert cli.run(["export", str(result), "-o", str(out), *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("error: ") and message in line
    assert not out.exists()


def test_a_missing_result_is_told(tmp_path, capsys):
    arguments = ["export", str(tmp_path / "gone"), "-f", "c", "-o", str(tmp_path / "out")]
    assert cli.run(arguments) == 2
    assert "gone: no such file; `identify` writes result.json" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
