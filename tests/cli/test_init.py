"""`example` and `init`: from nothing, and from a CSV of one's own, to a case that is checked."""

import contextlib
import io
import json

import numpy as np
import pandas as pd
import pytest
import scipy.io

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import NoController, read_case
from pneumo_casadi.errors import CaseError

CYLINDER = ("--piston", "33.38", "--rod", "18.61", "--stroke", "500", "--supply", "6")


@pytest.fixture(scope="module")
def printed_example(tmp_path_factory):
    """Folder of the example, and what was printed when it was made."""
    folder, stream = tmp_path_factory.mktemp("example") / "my_axis", io.StringIO()
    with contextlib.redirect_stdout(stream):
        assert cli.run(["example", str(folder)]) == 0
    return folder, stream.getvalue()


@pytest.fixture(scope="module")
def example(printed_example):
    return printed_example[0]


@pytest.fixture(scope="module")
def example_case(example):
    return read_case(example)


@pytest.fixture(scope="module")
def log(example):
    """The record of the example, the first second and a half."""
    return pd.read_csv(example / "identify.csv", nrows=1500)


@pytest.fixture(scope="module")
def short(log, tmp_path_factory):
    """Folder with such a record alone."""
    folder = tmp_path_factory.mktemp("short")
    log.to_csv(folder / "identify.csv", index=False)
    return folder


def started(example, folder, *options):
    return cli.run(
        ["init", str(example / "identify.csv"), "--output", str(folder), "--ambient", "1",
         *CYLINDER, *options]
    )  # fmt: skip


def test_the_example_is_a_case_of_foreign_columns_without_a_finding(example, example_case):
    case = example_case
    assert case.findings == () and case.identify[0].N == 10_000 and case.validate
    header = (example / "identify.csv").read_text("utf-8").splitlines()[0]
    assert header == "ms,valve,pA,pB,pos,ref"
    assert sum(path.stat().st_size for path in example.iterdir()) < 1_000_000


def test_the_example_says_what_comes_next(printed_example):
    folder, printed = printed_example
    assert f"next: pneumo-casadi check {folder}" in printed


@pytest.mark.parametrize("command", ["example", "init"])
def test_a_folder_that_holds_something_is_left_alone(command, short, tmp_path, capsys):
    (tmp_path / "note.txt").write_text("mine")
    run = cli.run(["example", str(tmp_path)]) if command == "example" else started(
        short, tmp_path
    )  # fmt: skip
    assert run == 2 and "not empty" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]


def test_init_guesses_channels_and_units_and_the_check_asks_for_gauge(
    example, example_case, tmp_path, capsys
):
    folder = tmp_path / "axis"
    map_and_validate = ("--flow-map", str(example / "flow_map.csv"),
                        "--validate", str(example / "validate.csv"))  # fmt: skip
    assert started(example, folder, *map_and_validate) == 0
    printed = capsys.readouterr().out
    assert "p_P       from column pA [bar]" in printed and "is pos in" not in printed
    columns = json.loads((folder / "columns.json").read_text("utf-8"))
    assert columns["x_m"] == {"column": "pos", "unit": "mm", "offset": -0.25}
    assert columns["u_N_V"] == {"column": "valve", "scale": -1}
    assert columns["t_s"] == {"column": "ms", "unit": "ms"}
    (finding,) = read_case(folder).findings
    columns |= finding.suggestion
    (folder / "columns.json").write_text(json.dumps(columns), "utf-8")
    ours, theirs = read_case(folder), example_case
    assert ours.findings == ()
    for name in theirs.identify[0].names:
        np.testing.assert_allclose(ours.identify[0][name], theirs.identify[0][name], atol=1e-9)
    assert abs(ours.bench.S_P / theirs.bench.S_P - 1) < 1e-3
    assert ours.bench.sampling_frequency == 1000 and ours.bench.p_supply == 7e5


@pytest.mark.slow
def test_a_mat_file_with_a_struct_and_a_load_make_a_case(log, example_case, tmp_path):
    table, path = log, tmp_path / "run.mat"
    scipy.io.savemat(path, {"log": {name: table[name].to_numpy() for name in table}})
    run = ["init", str(path), "--output", str(tmp_path / "axis"), "--ambient", "1", "--gauge"]
    assert cli.run([*run, *CYLINDER, "--angle", "90", "--force", "20"]) == 0
    columns = json.loads((tmp_path / "axis" / "columns.json").read_text("utf-8"))
    assert columns["x_m"] == {"column": "log.pos", "unit": "mm", "offset": -0.25}
    case = read_case(tmp_path / "axis", check=False)
    assert (case.bench.load.angle_deg, case.bench.load.force) == (90.0, 20.0)
    theirs = example_case.identify[0]["p_P"][: len(table)]
    np.testing.assert_allclose(case.identify[0]["p_P"], theirs, atol=1e-3)


def test_gauge_can_be_said_at_once(example, tmp_path):
    assert started(example, tmp_path / "axis", "--gauge", "--gain", "2.4", "--u-max", "5") == 0
    case = read_case(tmp_path / "axis")
    assert case.findings == () and case.bench.controller.gain == 2.4


def test_the_largest_command_can_be_stated_without_a_law(example, tmp_path):
    assert started(example, tmp_path / "axis", "--gauge", "--u-max", "5") == 0
    assert read_case(tmp_path / "axis").bench.controller == NoController(5.0)
    assert started(example, tmp_path / "other", "--gauge", "--u-max", "0.05") == 0
    with pytest.raises(CaseError, match=r"beyond `controller.u_max` \(0\.05 V\)"):
        read_case(tmp_path / "other")


def test_without_a_terminal_missing_sizes_are_named_with_their_option(short, tmp_path, capsys):
    run = cli.run(["init", str(short / "identify.csv"), "-o", str(tmp_path / "a"), "--rod", "10"])
    error = capsys.readouterr().err
    assert run == 2 and "--piston (diameter of the piston [mm])" in error and "--rod" not in error
    assert not (tmp_path / "a").exists()


def test_at_a_terminal_missing_sizes_are_asked_for(short, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("typer.prompt", lambda text, type: asked.append(text) or 20.0)
    run = cli.run(
        ["init", str(short / "identify.csv"), "-o", str(tmp_path / "a"), "--piston", "40",
         "--stroke", "500", "--supply", "6"]
    )  # fmt: skip
    assert run == 0 and asked == ["diameter of the rod [mm]"]


@pytest.mark.parametrize(
    ("header", "column", "unit"),
    [
        ("p_A [bar]", "p_A [bar]", "bar"),
        ("pressure1 (kPa)", "pressure1 (kPa)", "kPa"),
        ("pa_Pa", "pa_Pa", "Pa"),
    ],
)
def test_units_in_names_are_read(header, column, unit, log, tmp_path):
    table = log.rename(columns={"pA": header})
    factor = {"bar": 1.0, "kPa": 100.0, "Pa": 1e5}[unit]
    table[header] *= factor
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)
    assert cli.run(["init", str(path), "-o", str(tmp_path / "axis"), *CYLINDER]) == 0
    columns = json.loads((tmp_path / "axis" / "columns.json").read_text("utf-8"))
    expected = column if unit == "Pa" else {"column": column, "unit": unit}
    assert columns["p_P_Pa"] == expected


def test_a_valve_around_five_volts_gets_its_offset(log, tmp_path):
    table = log.assign(valve=log["valve"] + 5)
    table.to_csv(tmp_path / "log.csv", index=False)
    assert started(tmp_path, tmp_path / "no") == 2  # no identify.csv there
    run = cli.run(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "axis"), *CYLINDER])
    columns = json.loads((tmp_path / "axis" / "columns.json").read_text("utf-8"))
    assert run == 0 and columns["u_P_V"] == {"column": "valve", "offset": -5}
    assert columns["u_N_V"] == {"column": "valve", "scale": -1, "offset": 5}


def test_a_channel_that_is_not_recognised_is_named_with_the_columns(log, tmp_path, capsys):
    log.rename(columns={"pB": "channel7"}).to_csv(tmp_path / "log.csv", index=False)
    files = ["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "axis")]
    assert cli.run([*files, *CYLINDER]) == 2
    error = capsys.readouterr().err
    assert "no column was recognised as p_N" in error and "channel7" in error
    assert cli.run([*files, *CYLINDER, "--column", "p_N=channel7:bar"]) == 0
    columns = json.loads((tmp_path / "axis" / "columns.json").read_text("utf-8"))
    assert columns["p_N_Pa"] == {"column": "channel7", "unit": "bar"}


def test_a_length_that_may_be_in_mm_or_cm_is_asked_for_and_not_if_it_is_stated(
    log, tmp_path, capsys
):
    doubtful = log.assign(pos=20 + 2.5 * np.sin(7 * np.linspace(0, 1, len(log))))
    doubtful.to_csv(tmp_path / "log.csv", index=False)
    files = ["init", str(tmp_path / "log.csv"), *CYLINDER, "-o"]
    assert cli.run([*files, str(tmp_path / "guessed")]) == 0
    printed = capsys.readouterr().out
    assert "is pos in mm (5 mm) or cm (50 mm)? Its name does not say" in printed
    assert "state it, as --column 'x=pos:cm'" in printed
    for unit in ("cm", "mm", "inch"):
        assert cli.run([*files, str(tmp_path / unit), "--column", f"x=pos:{unit}"]) == 0
        assert "is pos in" not in capsys.readouterr().out
        columns = json.loads((tmp_path / unit / "columns.json").read_text("utf-8"))
        assert columns["x_m"]["unit"] == unit


def test_a_log_without_time_says_how_to_add_it(log, tmp_path, capsys):
    log.drop(columns="ms").to_csv(tmp_path / "log.csv", index=False)
    assert cli.run(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "a"), *CYLINDER]) == 2
    assert "add a column t_s = row / sampling frequency" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--column", "p_P"), "expected CHANNEL=NAME"),
        (("--column", "p_P=nothing"), "no column `nothing`; the file has ms"),
        (("--column", "p_P=pA:mm"), "known units are Pa"),
        (("--column", "pressure=pA"), "no channel `pressure`"),
        (("--gain", "2"), "give --u-max as well"),
        (("--rod", "40"), "the rod's the smaller one"),
    ],
)
def test_wrong_options_are_explained_and_nothing_is_written(
    options, message, short, tmp_path, capsys
):
    assert started(short, tmp_path / "axis", *options) == 2
    assert message in capsys.readouterr().err and not (tmp_path / "axis").exists()
