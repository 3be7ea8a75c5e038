"""MAT files with structs, cells and matrices, of both kinds, under the users' own names."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from pneumo_casadi.data import (
    Column,
    InputHold,
    column_map,
    read_case,
    read_columns,
    read_recording,
)
from pneumo_casadi.data.readers import mat_process
from pneumo_casadi.errors import CaseError

ZERO = InputHold.ZERO
N = 40
T = 0.01 * np.arange(N)
P = np.linspace(3.0, 4.0, N)
X = np.linspace(-100.0, 100.0, N)


def classic(path, content):
    scipy.io.savemat(path, content)


def hdf5(path, content):
    """Write a MAT file of version 7.3 as MATLAB lays it out."""
    h5py = pytest.importorskip("h5py", reason="needs the extra `mat` (h5py)")

    def put(group, name, value):
        if isinstance(value, dict):
            child = group.create_group(name)
            child.attrs["MATLAB_class"] = np.bytes_("struct")
            for field, item in value.items():
                put(child, field, item)
        elif isinstance(value, list):  # a struct array: each field a list of references
            child = group.create_group(name)
            child.attrs["MATLAB_class"] = np.bytes_("struct")
            for field in value[0]:
                references = []
                for item in value:
                    hidden = f"{len(group.file['#refs#'])}"
                    put(group.file["#refs#"], hidden, item[field])
                    references.append(group.file["#refs#"][hidden].ref)
                array = np.array(references, dtype=h5py.ref_dtype).reshape(-1, 1)
                child.create_dataset(field, data=array, dtype=h5py.ref_dtype)
        elif isinstance(value, str):
            data = np.array([[ord(c)] for c in value], dtype=np.uint16)
            group.create_dataset(name, data=data).attrs["MATLAB_class"] = np.bytes_("char")
        elif isinstance(value, np.ndarray) and value.dtype == object:
            references = []
            for item in value.ravel():
                hidden = f"{len(group.file['#refs#'])}"
                put(group.file["#refs#"], hidden, item)
                references.append(group.file["#refs#"][hidden].ref)
            array = np.array(references, dtype=h5py.ref_dtype).reshape(-1, 1)
            cell = group.create_dataset(name, data=array, dtype=h5py.ref_dtype)
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
        else:
            data = np.atleast_2d(np.asarray(value))
            data = data.T if np.ndim(value) < 2 else data
            stored = group.create_dataset(name, data=data.T)  # HDF5 counts the other way round
            stored.attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in content.items():
            put(file, name, value)
    with Path(path).open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


WRITERS = pytest.mark.parametrize("write", [classic, hdf5])


@WRITERS
def test_vectors_within_structs_go_by_their_path(tmp_path, write):
    log = {"clock": T, "p": {"A": P, "note": "bar"}, "pos": X[None, :], "fs": 100.0}
    write(tmp_path / "run.mat", {"log": log})
    columns = column_map(
        {"t_s": "log.clock", "p_P_Pa": ("log.p.A", "bar"), "x_m": ("log.pos", "mm")}
    )
    recording = read_recording(tmp_path / "run.mat", ZERO, columns)
    assert np.allclose(recording.t, T, rtol=0.0, atol=1e-12)
    assert np.allclose(recording["p_P"], 1e5 * P, rtol=1e-15)
    assert np.allclose(recording["x"], 1e-3 * X, rtol=1e-15)


@WRITERS
def test_names_of_a_case_folder_are_found_within_a_struct(tmp_path, write):
    write(tmp_path / "run.mat", {"data": {"t_s": T, "p_P_Pa": 1e5 * P}, "author": "me"})
    recording = read_recording(tmp_path / "run.mat", ZERO)
    assert recording.names == ("p_P",) and np.array_equal(recording["p_P"], 1e5 * P)


@WRITERS
def test_a_name_that_stands_in_two_structs_must_be_told_apart(tmp_path, write):
    write(tmp_path / "run.mat", {"one": {"t_s": T, "x_m": X}, "two": {"t_s": T, "x_m": -X}})
    with pytest.raises(CaseError, match=r"no column `t_s`; the file has one\.t_s, one\.x_m, two"):
        read_recording(tmp_path / "run.mat", ZERO)
    columns = column_map({"t_s": "two.t_s", "x_m": ("two.x_m", "mm")})
    recording = read_recording(tmp_path / "run.mat", ZERO, columns)
    assert np.allclose(recording["x"], -1e-3 * X, rtol=1e-15)


@WRITERS
def test_columns_of_a_matrix_and_elements_of_a_cell_have_names(tmp_path, write):
    cell = np.empty(2, dtype=object)
    cell[0], cell[1] = T[:, None], X[:, None]
    write(tmp_path / "run.mat", {"yout": np.column_stack([P, X]), "parts": cell})
    columns = column_map(
        {"t_s": "parts{1}", "p_P_Pa": ("yout(:,1)", "bar"), "x_m": ("yout(:,2)", "mm")}
    )
    recording = read_recording(tmp_path / "run.mat", ZERO, columns)
    assert np.allclose(recording.t, T, rtol=0.0, atol=1e-12)
    assert np.allclose(recording["x"], 1e-3 * X, rtol=1e-15)


def test_elements_of_a_struct_array_have_names(tmp_path):
    array = np.zeros((1, 2), dtype=[("t", object), ("x", object)])
    array[0, 0], array[0, 1] = (T, X), (T + 5.0, -X)
    classic(tmp_path / "run.mat", {"run": array})
    hdf5_content = {"run": [{"t": T, "x": X}, {"t": T + 5.0, "x": -X}]}
    paths = [tmp_path / "run.mat"]
    try:
        hdf5(tmp_path / "new.mat", hdf5_content)
        paths.append(tmp_path / "new.mat")
    except pytest.skip.Exception:  # without h5py the classic file alone
        pass
    for path in paths:
        columns = column_map({"t_s": "run(2).t", "x_m": ("run(2).x", "mm")})
        recording = read_recording(path, ZERO, columns)
        assert recording.t[0] == 5.0 and np.allclose(recording["x"], -1e-3 * X, rtol=1e-15)


def test_version_7_3_without_h5py_names_both_ways_out(tmp_path, monkeypatch):
    (tmp_path / "run.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(CaseError, match=r"run\.mat: .*pneumo-casadi\[mat\].*'-v7'"):
        read_recording(tmp_path / "run.mat", ZERO)


def test_a_damaged_file_of_version_7_3_is_refused(tmp_path):
    pytest.importorskip("h5py", reason="needs the extra `mat` (h5py)")
    hdf5(tmp_path / "run.mat", {"t_s": T, "x_m": X})
    content = (tmp_path / "run.mat").read_bytes()
    (tmp_path / "run.mat").write_bytes(content[: len(content) // 2])
    with pytest.raises(CaseError, match=r"run\.mat: not a readable MAT file"):
        read_recording(tmp_path / "run.mat", ZERO)


def test_one_column_can_tell_two_channels(tmp_path):
    classic(tmp_path / "run.mat", {"t_s": T, "cmd": 1e3 * P})
    columns = column_map({"u_P_V": ("cmd", "mV"), "u_N_V": {"column": "cmd", "scale": -1e-3}})
    recording = read_recording(tmp_path / "run.mat", ZERO, columns)
    assert np.allclose(recording["u_P"], P, rtol=1e-15)
    assert np.array_equal(recording["u_N"], -recording["u_P"])


def test_a_gauge_pressure_and_a_position_from_one_end_get_their_offset(tmp_path):
    classic(tmp_path / "run.mat", {"t_s": T, "pA": P, "pos": X})
    columns = column_map(
        {
            "p_P_Pa": {"column": "pA", "unit": "bar", "offset": 1.013e5},
            "x_m": {"column": "pos", "unit": "mm", "offset": -0.25},
        }
    )
    recording = read_recording(tmp_path / "run.mat", ZERO, columns)
    assert recording["p_P"][0] == pytest.approx(4.013e5)
    assert recording["x"][-1] == pytest.approx(-0.15)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"p_P": "pA"}, "`p_P` is no column of a case folder; known are t_s, u_P_V"),
        ({"p_P_Pa": ("pA", "mm")}, "`p_P_Pa`: unit 'mm' of variable `pA`.* known are Pa, hPa, bar"),
        ({"x_m": ("pos", "furlong")}, "for another give a scale to m"),
        ({"x_m": {"column": "pos", "unit": "mm", "scale": 2.0}}, "say the same twice"),
        (
            {"x_m": {"column": "pos", "scale": "2"}},
            r"`x_m\.scale`: expected a number( or null)?, got '2'",
        ),
        (
            {"x_m": {"column": "pos", "offset": float("nan")}},
            "scale 1, offset nan; give finite numbers",
        ),
        ({"x_m": {"unit": "mm"}}, r"missing key `x_m\.column`"),
        ({"x_m": {"name": "pos"}}, r"missing key `x_m\.column`; there stands `x_m\.name`"),
        ({"x_m": 3}, "expected a name"),
        ({"x_m": ["pos", "mm", "m"]}, "expected a name"),
    ],
)
def test_a_wrong_entry_is_told_with_its_variable_and_unit(tmp_path, entries, message):
    with pytest.raises(CaseError, match=message):
        column_map(entries)
    if "finite" not in message:
        (tmp_path / "columns.json").write_text(json.dumps(entries))
        with pytest.raises(CaseError, match=rf"columns\.json: .*{message}"):
            read_columns(tmp_path / "columns.json")


def test_the_example_of_the_guide_is_a_columns_file(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "how_to" / "your_data.md").read_text("utf-8")
    example = text.split("columns.json -->\n```json\n")[1].split("```")[0]
    (tmp_path / "columns.json").write_text(example)
    columns = read_columns(tmp_path / "columns.json")
    assert columns["pA"] == (Column("p_P", 1e5, 1e5),)
    assert {column.channel for column in columns["valve"]} == {"u_P", "u_N"}


@pytest.mark.parametrize("text", ["", "[1]", "{'t_s': 'time'}"])
def test_a_columns_file_that_is_no_json_object_is_told(tmp_path, text):
    (tmp_path / "columns.json").write_text(text)
    with pytest.raises(CaseError, match=r"columns\.json: (not a readable|expected a) JSON"):
        read_columns(tmp_path / "columns.json")


def own_names(recording):
    """A record as a user may have it: one struct, bar, mm from one end, ms."""
    log = {"ms": 1e3 * recording.t, "cmd": recording["u_P"], "ref": 1e3 * recording["x_ref"]}
    log |= {"pA": recording["p_P"] / 1e5, "pB": recording["p_N"] / 1e5}
    return {"log": log | {"pos": 1e3 * (recording["x"] + 0.25)}}


MAPPING = {
    "t_s": ["log.ms", "ms"],
    "u_P_V": "log.cmd",
    "u_N_V": {"column": "log.cmd", "scale": -1},
    "p_P_Pa": ["log.pA", "bar"],
    "p_N_Pa": ["log.pB", "bar"],
    "x_m": {"column": "log.pos", "unit": "mm", "offset": -0.25},
    "x_ref_m": ["log.ref", "mm"],
}


def test_a_case_folder_tells_its_columns_in_a_file(tmp_path, bench_json, recording):
    bench_json()
    classic(tmp_path / "identify.mat", own_names(recording))
    (tmp_path / "columns.json").write_text(json.dumps(MAPPING))
    (found,) = read_case(tmp_path).identify
    for name in recording.names:
        assert np.allclose(found[name], recording[name], rtol=1e-12, atol=1e-15)
    # What is said in the call goes before the file.
    with pytest.raises(CaseError, match="no column `nothing`"):
        read_case(tmp_path, columns={"nothing": Column("t")})


def test_a_variable_that_the_file_has_not_is_named_with_those_it_has(
    tmp_path, bench_json, recording
):
    bench_json()
    classic(tmp_path / "identify.mat", own_names(recording))
    (tmp_path / "columns.json").write_text(json.dumps(MAPPING | {"p_P_Pa": ["log.p_A", "bar"]}))
    with pytest.raises(CaseError, match=r"identify\.mat: no column `log\.p_A`; .* log\.pA"):
        read_case(tmp_path)


def test_a_wrong_unit_is_noticed_by_the_values(tmp_path, bench_json, recording):
    bench_json()
    classic(tmp_path / "identify.mat", own_names(recording))
    (tmp_path / "columns.json").write_text(json.dumps(MAPPING | {"p_P_Pa": ["log.pA", "kPa"]}))
    with pytest.raises(CaseError, match=r"identify\.mat.*p_P"):
        read_case(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="files are parsed in forks")
def test_a_parser_that_stalls_is_ended_by_the_time_of_its_processor(monkeypatch):
    """By the clock, a busy machine would make sound files unreadable."""
    monkeypatch.setattr(mat_process, "TIME", 1.0)

    def stall(request):
        while True:
            pass

    answer = mat_process._in_a_fork(stall, b"")
    assert json.loads(answer.partition(b"\n")[0]) == "parsing it takes more than 1 s"
    assert mat_process._in_a_fork(lambda request: request[::-1], b"abc") == b"cba"
