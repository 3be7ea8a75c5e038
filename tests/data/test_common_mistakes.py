"""The commonest mistakes with a record are named first; records without them are not accused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import EXAMPLE, Grade, read_case, write_case
from pneumo_casadi.errors import CaseError

PRACTICE = ("p01_none", "p02_stribeck", "p07_heat_transfer", "p13_none_5kHz_60s")
SUBJECTS = (*PRACTICE, "example")
#: A valve of clearly other size or supply for each of them.
OTHER_VALVE = {
    "p01_none": "p02_stribeck",
    "p02_stribeck": "p01_none",
    "p07_heat_transfer": "p01_none",
    "p13_none_5kHz_60s": "p02_stribeck",
    "example": "p01_none",
}


@pytest.fixture(scope="module")
def folders(data_folder):
    practice = {path.name: path for path in (data_folder / "practice").iterdir() if path.is_dir()}
    return practice | {"example": EXAMPLE}


@pytest.fixture(scope="module")
def subject(folders):
    """Return a function that reads a case once, its first ten seconds."""
    known = {}

    def read(name):
        if name not in known:
            case = read_case(folders[name], check=False)
            records = [record.window(record.t[0], record.t[0] + 10) for record in case.identify]
            known[name] = replace(case, identify=tuple(records), validate=())
        return known[name]

    return read


def mapped(function, *channels):
    return lambda record: record.with_channels({c: function(record[c]) for c in channels})


def swapped(first, second):
    return lambda record: record.with_channels({first: record[second], second: record[first]})


def late(rows):
    return lambda record: record.with_channels(
        {channel: np.roll(record[channel], rows) for channel in ("u_P", "u_N")}
    ).window(record.t[5], record.t[-6])


#: Change of the record -> name of the finding, and the suggestion that undoes it.
RECORD_MISTAKES = {
    "gauge pressures": (
        lambda bench: mapped(lambda p: p - bench.p_ext, "p_P", "p_N"),
        "gauge pressures",
        "columns.json",
    ),
    "bar": (lambda bench: mapped(lambda p: 1e-5 * p, "p_P", "p_N"), "in bar", "columns.json"),
    "swapped pressures": (lambda bench: swapped("p_P", "p_N"), "swapped?", "columns.json"),
    "sign of u": (lambda bench: mapped(np.negative, "u_P", "u_N"), "swapped, or", "columns.json"),
    "u one row late": (lambda bench: late(1), "1 row late", "columns.json"),
    "u two rows early": (lambda bench: late(-2), "2 rows early", "columns.json"),
    "position from the end": (
        lambda bench: mapped(lambda x: x + bench.stroke / 2, "x", "x_ref"),
        "from the end of the stroke",
        "columns.json",
    ),
    "position reversed": (lambda bench: mapped(np.negative, "x", "x_ref"), "wrong way", ""),
}


def write(folder, case, records=None, bench=None, flow_map=None):
    return write_case(
        folder,
        bench or case.bench,
        records or case.identify,
        flow_map=flow_map or case.flow_map_path,
    )


def first_of(folder, columns=None):
    """Return the grade and the sentence with which reading a case begins."""
    try:
        case = read_case(folder, columns=columns)
    except CaseError as error:
        return Grade.SEVERE, str(error)
    return (case.findings[0].grade, case.findings[0].sentence) if case.findings else (None, "")


@pytest.mark.parametrize("mistake", RECORD_MISTAKES)
@pytest.mark.parametrize("name", SUBJECTS)
def test_a_mistake_is_named_first_and_its_remedy_works(name, mistake, subject, tmp_path):
    case = subject(name)
    damage, words, _ = RECORD_MISTAKES[mistake]
    record = damage(case.bench)(case.identify[0])
    write(tmp_path / "case", case, [record])
    grade, sentence = first_of(tmp_path / "case")
    assert grade is Grade.SEVERE and words in sentence
    pasted = json.loads("{" + sentence.partition("In columns.json: ")[2] + "}")
    (tmp_path / "case" / "columns.json").write_text(json.dumps(pasted), "utf-8")
    assert pasted and read_case(tmp_path / "case").findings == ()


@pytest.mark.parametrize("name", SUBJECTS)
def test_swapped_areas_are_named_first_and_the_remedy_works(name, subject, tmp_path):
    case = subject(name)
    wrong = replace(case.bench, S_P=case.bench.S_N, S_N=case.bench.S_P)
    write(tmp_path / "case", case, bench=wrong)
    grade, sentence = first_of(tmp_path / "case")
    assert grade is Grade.SEVERE and "look swapped" in sentence
    remedy = json.loads("{" + sentence.partition("In bench.json: ")[2] + "}")
    assert remedy == {"S_P_m2": case.bench.S_P, "S_N_m2": case.bench.S_N}


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_map_of_another_valve_is_named_first(name, subject, folders, tmp_path):
    other = folders[OTHER_VALVE[name]] / "flow_map.csv"
    write(tmp_path / "case", subject(name), flow_map=other)
    grade, sentence = first_of(tmp_path / "case")
    assert (
        grade is Grade.SEVERE and "map of another valve" in sentence
    ) or "of this valve" in sentence
