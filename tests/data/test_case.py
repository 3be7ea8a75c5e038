"""Case folders: several records, in order, written whole and read back number for number."""

import gzip
import os

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi.data import (
    ForceBench,
    InputHold,
    NestedController,
    Recording,
    read_case,
    write_case,
)
from pneumo_casadi.data.case_folder import _write_csv
from pneumo_casadi.errors import CaseError

FLOW_MAP = {
    "u_V": [-1.0, -1.0, 1.0, 1.0],
    "p_Pa": [2e5, 3e5, 2e5, 3e5],
    "q_m_kg_per_s": [-1e-3, -2e-3, 1e-3, 1 / 3 * 1e-3],
}


def test_a_case_comes_back_number_for_number(tmp_path, bench, recording):
    write_case(tmp_path / "case", bench, [recording], [recording.window(0, 2)], FLOW_MAP)
    case = read_case(tmp_path / "case")
    assert case.bench == bench and case.name == "case"
    assert case.flow_map_path == tmp_path / "case" / "flow_map.csv"
    for found, written in ((case.identify[0], recording), (case.validate[0], recording)):
        for name in written.names:
            assert np.array_equal(found[name], written[name][: found.N])
        assert found.dt == pytest.approx(written.dt, rel=1e-12)


def test_several_records_keep_their_order(tmp_path, bench, recording):
    parts = recording.split(duration=0.3)
    write_case(tmp_path / "case", bench, parts)
    case = read_case(tmp_path / "case", check=False)
    assert [part["x"][0] for part in case.identify] == [part["x"][0] for part in parts]
    assert len(case.identify) == 14 and case.identify[1].t[0] == pytest.approx(0.3)


def test_equal_cases_give_equal_files(tmp_path, bench, recording):
    for name in "ab":
        write_case(tmp_path / name, bench, [recording])
    first, second = ((tmp_path / name / "identify.csv.gz").read_bytes() for name in "ab")
    assert first == second


def test_a_force_driven_case_comes_back(tmp_path):
    bench = ForceBench(100.0, 0.5, NestedController(160.0, 243.0, 35.0, 10.0))
    t = np.arange(60) / 100
    channels = {"F": np.cos(t), "x": 0.1 * np.sin(t), "x_ref": 0.1 * np.sin(t)}
    recording = Recording(t, channels, "a", "memory", InputHold.ZERO)
    write_case(tmp_path / "case", bench, [recording])
    case = read_case(tmp_path / "case")
    assert case.bench == bench and np.array_equal(case.identify[0]["F"], channels["F"])


def test_a_force_driven_axis_may_not_travel_beyond_its_stroke(tmp_path):
    bench = ForceBench(100.0, 0.15, NestedController(160.0, 243.0, 35.0, 10.0))
    t = np.arange(400) / 100
    channels = {"F": np.cos(t), "x": 0.1 * np.sin(t), "x_ref": 0.1 * np.sin(t)}
    write_case(tmp_path / "c", bench, [Recording(t, channels, "a", "memory", InputHold.ZERO)])
    with pytest.raises(CaseError, match=r"row \d+ .*travels 0\.175023 m, the stroke is 0\.15 m"):
        read_case(tmp_path / "c")


def test_numbers_are_written_digit_for_digit_as_pandas_does(tmp_path):
    rng = np.random.default_rng(0)
    x = rng.standard_normal(500) * 10.0 ** rng.integers(-12, 18, 500)
    x[:5] = 0.0, -0.0, 1e-5, 1e16, 123456789.0
    columns = {"t_s": np.arange(500) / 3, "x_m": x}
    _write_csv(tmp_path / "run.csv.gz", columns)
    with gzip.open(tmp_path / "run.csv.gz", "rt", newline="") as file:
        text = file.read()
    assert text == pd.DataFrame(columns).to_csv(index=False, lineterminator="\n")
    assert [float(line.split(",")[1]) for line in text.splitlines()[1:]] == x.tolist()


def test_a_write_that_fails_leaves_nothing(tmp_path, bench, recording, monkeypatch):
    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_case(tmp_path / "case", bench, [recording])
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_use_is_not_written_over(tmp_path, bench, recording):
    write_case(tmp_path / "case", bench, [recording])
    with pytest.raises(CaseError, match="is there already and not empty; choose a new folder"):
        write_case(tmp_path / "case", bench, [recording])


def test_what_a_case_folder_cannot_say_is_not_written(tmp_path, bench, recording):
    linear = Recording(
        recording.t, recording.channels, "linear", "memory", InputHold.LINEAR, dt=recording.dt
    )
    with pytest.raises(CaseError, match=r"linear: hold linear, but .*held at zero order"):
        write_case(tmp_path / "a", bench, [linear])
    with pytest.raises(CaseError, match="no unit is known for channel q"):
        write_case(tmp_path / "b", bench, [recording.with_channels({"q": recording.t})])
    with pytest.raises(CaseError, match="at least one"):
        write_case(tmp_path / "c", bench, [])
    assert list(tmp_path.iterdir()) == []


def test_what_is_put_in_the_folder_while_a_case_is_written_stays(tmp_path, bench, recording):
    case = tmp_path / "case"

    class Late(dict):
        """A flow map that somebody else's file comes with."""

        def items(self):
            case.mkdir()
            (case / "notes.txt").write_text("mine")
            return super().items()

    with pytest.raises(OSError, match="not empty"):
        write_case(case, bench, [recording], flow_map=Late(FLOW_MAP))
    assert [path.name for path in case.iterdir()] == ["notes.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["case"]


def test_a_signal_that_only_some_records_have_is_left_out_of_all(tmp_path, bench, recording):
    """A filter that finds it would use it, whatever the others lack."""
    part = recording.window(0.0, 0.5)
    fast = part.with_channels({"v": np.gradient(part["x"], part.dt)})
    write_case(tmp_path / "case", bench, [part, fast])
    case = read_case(tmp_path / "case", check=False)
    assert [finding.name for finding in case.findings] == ["missing signal"]
    assert not case.bench.signals and all("v" not in record for record in case.identify)
    write_case(tmp_path / "both", bench, [fast, fast])
    assert all("v" in r for r in read_case(tmp_path / "both", check=False).identify)


def test_a_map_of_chamber_N_alone_is_refused_and_nothing_written(tmp_path, bench, recording):
    with pytest.raises(CaseError, match="chamber N's valve alone; give that of chamber P's too"):
        write_case(tmp_path / "case", bench, [recording], flow_map_N=FLOW_MAP)
    assert list(tmp_path.iterdir()) == []


def test_a_compressed_map_is_unpacked(tmp_path, bench, recording):
    text = "u_V,p_Pa,q_m_kg_per_s\n1.0,2e5,1e-3\n"
    packed = tmp_path / "metered.csv.gz"
    packed.write_bytes(gzip.compress(text.encode()))
    case = write_case(tmp_path / "case", bench, [recording.window(0, 1)], flow_map=packed)
    assert case.flow_map_path.read_text() == text
