"""Files of others: what is no file, text of all encodings, JSON without bounds, maps and copies."""

import json
import os
import signal

import numpy as np
import pytest
import scipy.io

from pneumo_casadi.data import Grade, InputHold, read_case, read_recording
from pneumo_casadi.data.check import check
from pneumo_casadi.data.checks.metered_flow import check_flow_map, metered_flows
from pneumo_casadi.data.readers import mat_process
from pneumo_casadi.data.readers.columns import COLUMNS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import read_bytes
from pneumo_casadi.runtime.json_input import read_json


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: path.mkdir(), "is a folder; put a regular file there"),
        (os.mkfifo, "is a pipe"),
        (lambda path: path.symlink_to("/dev/zero"), "is a device"),
        (lambda path: path.symlink_to("gone"), "is a link to gone, which is not there"),
        (lambda path: None, "no such file; write one"),
        (lambda path: path.write_bytes(b"12345"), "5 bytes, more than the 4 bytes"),
    ],
)
def test_what_is_no_file_of_due_size_is_refused(tmp_path, make, message):
    path = tmp_path / "a.json"
    make(path)
    with pytest.raises(CaseError, match=message) as caught:
        read_bytes(path, "write one", largest=4)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["columns.json", "flow_map.csv"])
def test_an_optional_file_that_is_none_is_not_passed_over(case_folder, name):
    folder = case_folder()
    (folder / name).symlink_to("gone")
    with pytest.raises(CaseError, match=rf"{name}: is a link to gone"):
        read_case(folder)


@pytest.mark.parametrize(
    "write",
    [
        lambda text: text.encode("utf-8-sig"),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace("\n", "\r").encode(),
        lambda text: text.replace("\n", ",20 °C\n").replace("20 °C", "T", 1).encode("cp1252"),
    ],
)
def test_text_of_all_encodings_and_line_ends_gives_the_same_numbers(tmp_path, good_text, write):
    (tmp_path / "plain.csv").write_text(good_text)
    (tmp_path / "other.csv").write_bytes(write(good_text))
    plain, other = (
        read_recording(tmp_path / f"{name}.csv", InputHold.ZERO) for name in ("plain", "other")
    )
    assert all(np.array_equal(plain[name], other[name]) for name in ("t", *plain.names))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "nested deeper than 32 levels"),
        ('{"a": ' * 100 + "1" + "}" * 100, "nested deeper than 32 levels"),
        ('{"a": {"b": 1e999}}', "`a.b`: expected a finite number"),
        (f'{{"a": {"9" * 5000}}}', "`a`: expected a finite number"),
        ('{"a": 1, "a": 2}', "key `a` stands twice"),
        ("[1]", "expected a JSON object"),
        ('{"a": "\\ud800"}', "`a`: .* holds half of a character"),
        ('{"\\ud800": 1}', "holds half of a character"),
    ],
)
def test_json_without_bounds_is_refused(tmp_path, text, message):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(CaseError, match=rf"a\.json: .*{message}"):
        read_json(tmp_path / "a.json", "write one")


def test_a_copy_of_a_record_and_of_a_part_is_severe(case_folder):
    folder = case_folder()
    lines = (folder / "identify.csv").read_text().splitlines(keepends=True)
    (folder / "identify_part.csv").write_text("".join(lines[:1500]))
    (finding,) = (f for f in read_case(folder).findings if f.name == "copied rows")
    assert finding.grade is Grade.SEVERE and "share 100 % of the rows" in finding.text


def flow_map(folder, change):
    """Findings of a sound map of 9 commands and 9 pressures, changed."""
    u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 9), np.linspace(1e5, 7e5, 9)))
    q = np.where(u > 0, 1e-3 * (7e5 - p), 1e-3 * (p - 1e5)) * u / 6e5 + 1e-9 * (4e5 - p)
    columns = np.column_stack(change(u, p, q))
    header = "u_V,p_Pa,q_m_kg_per_s"
    np.savetxt(folder / "flow_map.csv", columns, delimiter=",", header=header, comments="")
    return [finding.name for finding in check_flow_map(metered_flows(folder)["P"])]


@pytest.mark.parametrize("rows", [np.r_[0:81, 0:81:3], np.r_[0:40, 41:81]])
def test_repeated_and_missing_points_change_no_interpolated_flow(tmp_path, rows):
    flow_map(tmp_path, lambda u, p, q: (u, p, q))
    whole = metered_flows(tmp_path)["P"]
    flow_map(tmp_path, lambda u, p, q: [a[rows] for a in (u, p, q)])
    part = metered_flows(tmp_path)["P"]
    u, p = np.linspace(-3, 3, 50), np.linspace(1e5, 3e5, 50)
    np.testing.assert_allclose(part(u, p), whole(u, p), atol=0.03 * np.abs(whole.q_m).max())


def test_a_sound_map_has_no_finding(tmp_path):
    assert flow_map(tmp_path, lambda u, p, q: (u, p, q)) == []


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda u, p, q: (-u, p, q), "flow map without opening"),
        (lambda u, p, q: (u, p, np.roll(q, 37)[::-1] * np.sign(u)), "flow map without opening"),
        (lambda u, p, q: (u, p, np.where(np.arange(81) == 40, 0.1, q)), "flow map with outliers"),
        (
            lambda u, p, q: (np.r_[u, u[:3]], np.r_[p, p[:3]], np.r_[q, q[:3] + 2e-3]),
            "flow map with two flows of a point",
        ),
        (lambda u, p, q: [a[[0, 8, 72, 80]] for a in (u, p, q)], "flow map too small"),
        (lambda u, p, q: [a[[0, 40, 77]] for a in (u, p, q)], "flow map too small"),
        (lambda u, p, q: [a[u == 0.0] for a in (u, p, q)], "flow map on a line"),
        (lambda u, p, q: (u, p, 0 * q), "flow map without flow"),
        (lambda u, p, q: [a[np.r_[0:81, 0:81]] for a in (u, p, q)], "flow map with copied rows"),
        (lambda u, p, q: [a[np.r_[0:81, 3]] for a in (u, p, q)], "flow map with copied rows"),
    ],
)
def test_a_map_that_contradicts_itself_is_named(tmp_path, change, name):
    assert name in flow_map(tmp_path, change)


@pytest.mark.parametrize("command", [0.0, 3.0])
def test_a_map_of_one_command_is_named_and_accuses_no_other_data(case_folder, command):
    folder = case_folder()
    flow_map(folder, lambda u, p, q: [a[u == command] for a in (u, p, q)])
    (finding,) = check(folder).findings
    assert finding.name == "flow map on a line" and "9 points, 1 command and" in finding.text
    with pytest.raises(CaseError, match="1 command and 9 pressures: meter filling, closed and"):
        read_case(folder)


def metered_twice(u, p, q):
    """Points metered twice, of a meter of 1e-9 kg/s, and without flow where it is closed."""
    rng = np.random.default_rng(0)
    u, p, q = (np.r_[a, a] for a in (u, p, q))
    noisy = np.round(q + 2e-6 * rng.standard_normal(q.size), 9)
    return u, p, np.where(u == 0, 0.0, noisy)


def test_points_metered_again_are_no_copies(tmp_path):
    assert flow_map(tmp_path, metered_twice) == []


def test_a_meter_that_rounds_coarsely_copies_no_rows(tmp_path):
    def coarse(u, p, q):
        u, p, q = metered_twice(u, p, q)
        return u, p, 8e-6 * np.round(q / 8e-6)

    assert flow_map(tmp_path, coarse) == []


def test_a_hidden_parser_crash_costs_an_error_only(tmp_path):
    path, sound = tmp_path / "run.mat", tmp_path / "sound.mat"
    scipy.io.savemat(path, {"t_s": np.arange(99.0)})
    scipy.io.savemat(sound, {name: np.arange(99.0) for name in COLUMNS if name != "u_V"})
    content = bytearray(path.read_bytes())
    content[145] = 0xAC  # with which the parser ends the process
    path.write_bytes(bytes(content))
    with pytest.raises(CaseError, match=r"run\.mat"):
        read_recording(path, InputHold.ZERO)
    assert read_recording(sound, InputHold.ZERO).N == 99


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes fork on POSIX")
def test_a_parser_that_a_file_ends_is_told_and_is_not_the_process_that_serves():
    said = mat_process._in_a_fork(lambda _: os.kill(os.getpid(), signal.SIGKILL), b"")
    assert json.loads(said.partition(b"\n")[0]) == "the parser ended with signal 9"
