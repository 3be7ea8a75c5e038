"""CSV, MAT and Parquet give the same recording; conversion happens at the door."""

import gzip
import string
import sys

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pneumo_casadi.data import Column, InputHold, column_map, read_recording
from pneumo_casadi.errors import CaseError, MissingExtraError

ZERO = InputHold.ZERO
same_folder = settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
numbers = st.floats(-1e12, 1e12, allow_subnormal=False)


def write(path, columns):
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


@pytest.mark.slow
@same_folder
@given(st.lists(st.tuples(numbers, numbers), min_size=2, max_size=50))
def test_numbers_survive_a_csv_file_bit_for_bit(tmp_path, rows):
    p_P, x = np.array(rows).T
    columns = {"t_s": 0.001 * np.arange(len(rows)), "p_P_Pa": p_P, "x_m": x}
    recording = read_recording(write(tmp_path / "a.csv", columns), ZERO)
    assert np.array_equal(recording["p_P"], p_P) and np.array_equal(recording["x"], x)


words = st.text(string.ascii_letters + string.punctuation.replace(",", ""), min_size=1).filter(
    lambda word: word.strip('"') and not _is_number(word) and '"' not in word
)


def _is_number(word):
    try:
        float(word)
    except ValueError:
        return word.lower() in {"na", "n/a", "null", "none", "<na>", "#n/a", "#na"}
    return True


@pytest.mark.slow
@same_folder
@given(st.integers(2, 60), words, st.data())
def test_a_cell_that_is_no_number_is_named_with_row_line_and_column(tmp_path, rows, word, data):
    row = data.draw(st.integers(0, rows - 1))
    column = data.draw(st.sampled_from(["t_s", "p_P_Pa", "x_m"]))
    columns = {name: [str(k) for k in range(rows)] for name in ("t_s", "p_P_Pa", "x_m")}
    columns[column][row] = word
    lines = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(CaseError) as caught:
        read_recording(path, ZERO)
    where = f"{path}: row {row + 1} (line {row + 2}), column `{column}`: {word!r} is no number"
    assert str(caught.value).startswith(where)


@same_folder
@given(st.integers(2, 60), st.sampled_from(["", "nan", "inf", "-inf", "1e999"]), st.data())
def test_a_value_that_is_not_finite_is_named_with_row_and_line(tmp_path, rows, cell, data):
    row = data.draw(st.integers(0, rows - 1))
    lines = ["t_s,p_P_Pa,x_m", *(f"{k},{k},{k}" for k in range(rows))]
    lines[row + 1] = f"{row},{cell},{row}"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(CaseError, match=rf"row {row + 1} \(line {row + 2}\): `p_P` \[Pa\] is"):
        read_recording(path, ZERO)


@pytest.fixture
def columns():
    rng = np.random.default_rng(0)
    return {"t_s": 0.01 * np.arange(80), "p_P_Pa": rng.normal(4e5, 1e3, 80), "x_m": rng.random(80)}


@pytest.mark.slow
def test_all_formats_give_the_same_recording(tmp_path, columns):
    write(tmp_path / "a.csv", columns)
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress((tmp_path / "a.csv").read_bytes()))
    pd.DataFrame(columns).to_parquet(tmp_path / "a.parquet")
    scipy.io.savemat(tmp_path / "a.mat", columns)
    for suffix in ("csv", "csv.gz", "parquet", "mat"):
        recording = read_recording(tmp_path / f"a.{suffix}", ZERO)
        assert recording.name == "a" and recording.names == ("p_P", "x")
        for name, unit in (("p_P", "Pa"), ("x", "m")):
            assert np.array_equal(recording[name], columns[f"{name}_{unit}"])


def test_windows_line_ends_and_a_byte_order_mark_are_no_fault(tmp_path, columns):
    text = pd.DataFrame(columns).to_csv(index=False, lineterminator="\r\n")
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert np.array_equal(read_recording(tmp_path / "a.csv", ZERO)["x"], columns["x_m"])


def test_own_names_and_units_are_converted_at_the_door(tmp_path):
    own = {"time": np.arange(20.0), "pres": np.linspace(3.0, 4.0, 20), "pos": np.arange(20)}
    scipy.io.savemat(tmp_path / "a.mat", own)
    columns = {
        "time": Column("t", scale=1e-3),
        "pres": Column("p_P", scale=1e5, offset=1e5),
        "pos": "x",
    }
    recording = read_recording(tmp_path / "a.mat", InputHold.LINEAR, columns)
    assert recording.dt == pytest.approx(1e-3) and recording.hold is InputHold.LINEAR
    assert recording["p_P"][0] == 4e5 and recording["x"][-1] == 19.0


def test_a_column_asked_for_and_absent_lists_those_present(tmp_path, columns):
    path = write(tmp_path / "a.csv", columns)
    with pytest.raises(CaseError, match="no column `pres`; the file has t_s, p_P_Pa, x_m"):
        read_recording(path, ZERO, {"pres": "p_P"})


def test_two_columns_for_one_channel_are_refused(tmp_path, columns):
    path = write(tmp_path / "a.csv", columns | {"b": columns["x_m"], "c": columns["x_m"]})
    with pytest.raises(CaseError, match="two columns for channel x"):
        read_recording(path, ZERO, {"b": "x", "c": "x"})


def test_a_column_that_is_not_used_need_not_be_numbers_and_is_said_so(tmp_path, columns, caplog):
    caplog.set_level("INFO")
    recording = read_recording(write(tmp_path / "a.csv", columns | {"weather": "fair"}), ZERO)
    assert recording.names == ("p_P", "x")
    assert "column `weather` is not used" in caplog.text


def test_empty_lines_at_the_end_are_no_rows(tmp_path, columns):
    path = write(tmp_path / "a.csv", columns)
    path.write_text(path.read_text() + "\n\n")
    assert read_recording(path, ZERO).N == 80


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.mat", b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\0" * 400, "'-v7'"),
        (
            "a.mat",
            b"no mat file at all, but long enough to look like one" * 9,
            "not a readable MAT",
        ),
        ("a.parquet", b"PAR1 no parquet file", "not a readable Parquet file"),
        ("a.csv", b"t_s,x_m\n", "no rows of data"),
        ("a.csv", b"\n1,2\n", "line 1 is empty; it must name the columns"),
        ("a.csv", b"# logger v3\nt_s,x_m\n0,1\n", "line 1, .# logger v3., does not name the col"),
        ("a.csv", b"logger v3\nt_s,x_m\n0,1\n", "delete the lines before the one that does"),
        ("a.csv", b"# a\n# b\nt_s,x_m\n0,1\n", "does not name the columns"),
        ("a.csv", "t_s,x_m\n0,1\n".encode("utf-16") + b"\n", "begins as UTF-16-LE text, but byte"),
        ("a.csv", b"t_s,\0\n0,1\n", "holds binary data"),
        ("a.xls", b"x", "unknown suffix '.xls'; use one of .csv, .csv.gz, .mat, .parquet"),
    ],
)
def test_what_is_no_table_is_refused_with_its_name(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CaseError, match=message) as caught:
        read_recording(path, ZERO)
    assert str(path) in str(caught.value)


def test_without_pyarrow_a_parquet_file_names_the_extra(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    path.write_bytes(b"PAR1")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"a\.parquet.*pneumo-casadi\[parquet\]"):
        read_recording(path, ZERO)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(CaseError, match=r"a\.csv: no such file"):
        read_recording(tmp_path / "a.csv", ZERO)


@pytest.fixture
def commands(columns):
    return columns | {"u_P_V": np.linspace(-1.0, 2.0, 80), "u_N_V": np.linspace(3.0, 4.0, 80)}


def test_a_column_named_for_another_channel_serves_its_own_as_well(tmp_path, commands):
    u = commands["u_P_V"]
    del commands["u_N_V"]
    entries = column_map({"u_N_V": {"column": "u_P_V", "scale": -1}})
    record = read_recording(write(tmp_path / "one.csv", commands), ZERO, entries)
    np.testing.assert_array_equal(record["u_P"], u)
    np.testing.assert_array_equal(record["u_N"], -u)


def test_a_column_whose_channel_is_taken_elsewhere_serves_that_alone(tmp_path, commands):
    path = write(tmp_path / "two.csv", commands)
    swapped = read_recording(path, ZERO, column_map({"u_P_V": "u_N_V", "u_N_V": "u_P_V"}))
    np.testing.assert_array_equal(swapped["u_P"], commands["u_N_V"])
    path = write(tmp_path / "one.csv", commands | {"u_V": commands["u_P_V"]})
    both = column_map({"u_P_V": "u_V", "u_N_V": {"column": "u_V", "scale": -1}})
    np.testing.assert_array_equal(read_recording(path, ZERO, both)["u_N"], -commands["u_P_V"])


def test_a_column_is_not_named_for_a_channel_that_the_file_has_itself(tmp_path, commands):
    path = write(tmp_path / "two.csv", commands)
    with pytest.raises(CaseError, match="gives `u_P_V` for u_N_V too, which the file has"):
        read_recording(path, ZERO, column_map({"u_N_V": "u_P_V"}))


def test_decimal_commas_in_quotes_make_no_comment_of_the_first_line(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text('t_s,x_m\n"0,001","1,5"\n"0,002","1,6"\n')
    with pytest.raises(CaseError) as error:
        read_recording(path, ZERO)
    assert "does not name the columns" not in str(error.value)


def test_a_file_without_time_says_how_to_add_it(tmp_path, columns):
    del columns["t_s"]
    with pytest.raises(CaseError, match=r"add a column t_s = row / sampling frequency \(lost rows"):
        read_recording(write(tmp_path / "r.csv", columns), ZERO)
