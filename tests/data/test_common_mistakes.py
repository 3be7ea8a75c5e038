"""The commonest mistakes with a record are named first; records without them are not accused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import EXAMPLE, Column, Grade, check_records, read_case, write_case
from pneumo_casadi.data.bench.controllers import NoController
from pneumo_casadi.data.checks.balance_mistakes import _times_less
from pneumo_casadi.data.checks.metered_flow import metered_flows
from pneumo_casadi.data.readers.column_entries import ColumnEntries

PRACTICE = ("p01_none", "p02_stribeck", "p07_heat_transfer", "p13_none_5kHz_60s")
#: The records at 5 kHz take a second to write and read.
SUBJECTS = (
    *PRACTICE[:3],
    *(pytest.param(name, marks=pytest.mark.slow) for name in (PRACTICE[3], "example")),
)
#: Those of which whole folders are written: one at 5 kHz.
IN_FILES = (*PRACTICE[:3], pytest.param("example", marks=pytest.mark.slow))
#: A valve of clearly other size or supply for each of them.
OTHER_VALVE = {
    "p01_none": "p02_stribeck",
    "p02_stribeck": "p01_none",
    "p07_heat_transfer": "p01_none",
    "example": "p01_none",
}


#: Seconds from the beginning of a record that are left out: the long ones move little at first.
BEGINS = {"example": 5.0, "p13_none_5kHz_60s": 2.0}
SECONDS = 5.0


@pytest.fixture(scope="module")
def folders(data_folder):
    practice = {path.name: path for path in (data_folder / "practice").iterdir() if path.is_dir()}
    return practice | {"example": EXAMPLE}


@pytest.fixture(scope="module")
def subject(folders):
    """Return a function that reads a case once, some seconds of its records."""
    known = {}

    def read(name):
        if name not in known:
            case = read_case(folders[name], check=False)
            begin = case.identify[0].t[0] + BEGINS.get(name, 0.0)
            records = [record.window(begin, begin + SECONDS) for record in case.identify]
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


#: Change of the record, and words of the first line.
RECORD_MISTAKES = {
    "gauge pressures": (
        lambda bench: mapped(lambda p: p - bench.p_ext, "p_P", "p_N"),
        "look like gauge pressures",
    ),
    "bar": (lambda bench: mapped(lambda p: 1e-5 * p, "p_P", "p_N"), "is it in bar"),
    "swapped pressures": (
        lambda bench: swapped("p_P", "p_N"),
        "`p_P_Pa` and `p_N_Pa` (chambers P and N) swapped?",
    ),
    "sign of u": (lambda bench: mapped(np.negative, "u_P", "u_N"), "swapped, or the valves"),
    "u one row late": (lambda bench: late(1), "are 1 row late"),
    "u two rows early": (lambda bench: late(-2), "are 2 rows early"),
    "zero of the position too high": (
        lambda bench: mapped(lambda x: x + 0.3 * bench.stroke, "x", "x_ref"),
        "`x` = 0 is not mid-stroke: chamber P",
    ),
    "zero of the position too low": (
        lambda bench: mapped(lambda x: x - 0.3 * bench.stroke, "x", "x_ref"),
        "`x` = 0 is not mid-stroke: chamber N",
    ),
    "position from the end": (
        lambda bench: mapped(lambda x: x + bench.stroke / 2, "x", "x_ref"),
        "from the end of the stroke",
    ),
    "position reversed": (lambda bench: mapped(np.negative, "x", "x_ref"), "count the wrong way"),
}
DELAYS = ("u one row late", "u two rows early")


def write(folder, case, records=None, bench=None, flow_map=None):
    return write_case(
        folder,
        bench or case.bench,
        records or case.identify,
        flow_map=flow_map or case.flow_map_path,
    )


def checked(folder, capsys):
    """Return exit code and first line of ``check --strict``, line breaks taken out."""
    code = cli.run(["check", str(folder), "--strict"])
    first, *_ = capsys.readouterr().out.split("\n\n")
    return code, " ".join(first.split())


@pytest.mark.parametrize("mistake", RECORD_MISTAKES)
@pytest.mark.parametrize("name", SUBJECTS)
def test_a_mistake_is_named_first(name, mistake, subject):
    case = subject(name)
    damage, words = RECORD_MISTAKES[mistake]
    record = damage(case.bench)(case.identify[0])
    first, *_ = check_records([record], case.bench, metered_flows(case.folder), refuse=False)
    assert first.grade is Grade.SEVERE and words in first.text
    assert first.suggestion and first.file == "columns.json"


#: Files take most of the time: each mistake is written for one of the cases, by turns. Delays are
#: a matter of the sampling: they are written at 5 kHz too.
WRITTEN = (
    *((PRACTICE[k % 3], mistake) for k, mistake in enumerate(RECORD_MISTAKES)),
    *(pytest.param(PRACTICE[3], late, marks=pytest.mark.slow) for late in DELAYS),
)


@pytest.mark.parametrize(("name", "mistake"), WRITTEN)
def test_the_command_names_a_mistake_first_and_its_remedy_works(
    name, mistake, subject, tmp_path, capsys
):
    case = subject(name)
    damage, words = RECORD_MISTAKES[mistake]
    record = damage(case.bench)(case.identify[0])
    write(tmp_path / "case", case, [record])
    code, first = checked(tmp_path / "case", capsys)
    assert code == 3 and "do not use" in first and words in first
    pasted = json.loads("{" + first.partition("In columns.json: ")[2] + "}")
    (tmp_path / "case" / "columns.json").write_text(json.dumps(pasted), "utf-8")
    assert pasted and read_case(tmp_path / "case").findings == ()


@pytest.mark.parametrize("name", IN_FILES)
def test_swapped_areas_are_named_first_and_the_remedy_works(name, subject, tmp_path, capsys):
    case = subject(name)
    wrong = replace(case.bench, S_P=case.bench.S_N, S_N=case.bench.S_P)
    write(tmp_path / "case", case, bench=wrong)
    code, first = checked(tmp_path / "case", capsys)
    assert code == 3 and "look swapped" in first
    remedy = json.loads("{" + first.partition("In bench.json: ")[2] + "}")
    assert remedy == {"S_P_m2": case.bench.S_P, "S_N_m2": case.bench.S_N}


@pytest.mark.parametrize("name", IN_FILES)
def test_the_map_of_another_valve_is_named_first(name, subject, folders, tmp_path, capsys):
    other = folders[OTHER_VALVE[name]] / "flow_map.csv"
    write(tmp_path / "case", subject(name), flow_map=other)
    code, first = checked(tmp_path / "case", capsys)
    assert code == 3 and ("map of another valve" in first or "map of this valve" in first)


@pytest.mark.parametrize("name", IN_FILES)
def test_a_gauge_supply_pressure_is_named_first(name, subject, tmp_path, capsys):
    case = subject(name)
    bench = case.bench
    write(tmp_path / "case", case, bench=replace(bench, p_supply=bench.p_supply - bench.p_ext))
    code, first = checked(tmp_path / "case", capsys)
    assert code == 3 and "is `p_supply` a gauge pressure?" in first


def test_chambers_above_the_supply_are_named(subject):
    case = subject("example")
    low = replace(case.bench, p_supply=5e5)
    (finding,) = check_records(case.identify, low)
    assert finding.name == "chambers above supply" and finding.grade is Grade.SEVERE
    assert f"up to {case.identify[0]['p_N'].max():.4g} Pa" in finding.text


@pytest.mark.parametrize("name", PRACTICE[:3])
def test_without_a_law_the_pressures_tell_that_u_is_late(name, folders):
    case = read_case(folders[name], check=False)
    bench = replace(case.bench, controller=NoController())
    for rows in (0, 1, 2):
        findings = check_records([late(rows)(case.identify[0])], bench)
        assert [finding.name for finding in findings] == (["delay of u"] if rows else [])
        assert not rows or f"are {rows} row" in findings[0].text


@pytest.mark.parametrize("name", SUBJECTS)
@pytest.mark.parametrize("force", [-150.0, 150.0])
def test_a_constant_load_is_no_mistake(name, force, subject):
    """A weight of 15 kg moves one pressure; nothing else of the record changes."""
    case = subject(name)
    record = case.identify[0]
    loaded = record.with_channels({"p_P": record["p_P"] + force / case.bench.S_P})
    assert not [f for f in check_records([loaded], case.bench) if f.grade is Grade.SEVERE]


@pytest.mark.parametrize("name", ["p02_stribeck", "example"])
def test_gauge_pressures_are_seen_without_a_flow_map(name, subject):
    case = subject(name)
    gauge = mapped(lambda p: p - case.bench.p_ext, "p_P", "p_N")(case.identify[0])
    assert check_records(case.identify, case.bench) == ()
    assert check_records([gauge], case.bench)[0].name == "gauge pressures"


def test_a_clipped_channel_is_named(subject):
    case = subject("example")
    limit = float(np.quantile(case.identify[0]["p_N"], 0.95))
    clipped = mapped(lambda p: np.minimum(p, limit), "p_N")(case.identify[0])
    names = {finding.name for finding in check_records([clipped], case.bench)}
    assert "clipped channel" in names


def test_suggestions_go_on_from_the_columns_as_they_are(subject):
    case = subject("example")
    gauge = mapped(lambda p: p - case.bench.p_ext, "p_P", "p_N")(case.identify[0])
    entries = ColumnEntries({"pA": (Column("p_P", 1e5),), "pB": (Column("p_N", 7.0, 5.0),)})
    finding = check_records([gauge], case.bench, metered_flows(case.folder), entries)[0]
    assert finding.suggestion == {
        "p_P_Pa": {"column": "pA", "unit": "bar", "offset": 100000},
        "p_N_Pa": {"column": "pB", "scale": 7, "offset": 100005},
    }


@pytest.mark.parametrize("one_command", [True, False])
@pytest.mark.parametrize("arrangement", ["two 3/2", "one 5/3"])
def test_the_remedy_of_a_late_command_names_a_column_of_the_file(
    one_command, arrangement, case_folder
):
    def change(lines):
        cells = [line.split(",") for line in lines]
        pairs = zip(cells[2:], cells[1:-1], strict=True)
        late = [cells[0], *([t, *u[1:3], *rest] for (t, _, _, *rest), u in pairs)]
        if one_command:
            late = [[t, u, *rest] for t, u, _, *rest in late]
            late[0][1] = "u_V"
        return [",".join(row) for row in late]

    folder = case_folder(change)
    bench = json.loads((folder / "bench.json").read_text("utf-8"))
    bench |= {"valve": {"source": "none"}, "arrangement": arrangement}
    (folder / "bench.json").write_text(json.dumps(bench), "utf-8")
    (finding,) = [each for each in read_case(folder).findings if each.name == "delay of u"]
    assert set(finding.suggestion) == ({"u_V"} if one_command else {"u_P_V", "u_N_V"})
    (folder / "columns.json").write_text(json.dumps(dict(finding.suggestion)), "utf-8")
    assert not [each for each in read_case(folder).findings if each.name == "delay of u"]


def test_a_leak_and_a_meter_that_shows_too_much_are_no_chamber_in_gauge(folders, subject):
    """Each helps one half of what a gauge pressure does: the balance, and the area."""
    case = subject("p06_leakage_P")
    high = {
        name: replace(flow, table=lambda at, table=flow.table: 1.15 * table(at))
        for name, flow in metered_flows(folders["p06_leakage_P"]).items()
    }
    names = [finding.name for finding in check_records(case.identify, case.bench, high)]
    assert "gauge pressures" not in names


@pytest.mark.parametrize("metered", [True, pytest.param(False, id="not metered")])
@pytest.mark.parametrize(("chamber", "name"), [("P", "p02_stribeck"), ("N", "p02_stribeck")])
def test_a_chamber_in_gauge_beside_an_absolute_pressure_is_named(
    chamber, name, metered, folders, subject
):
    case = subject(name)
    channel = f"p_{chamber}"
    record = mapped(lambda p: p - case.bench.p_ext, channel)(case.identify[0])
    flows = metered_flows(folders[name]) if metered else {}
    finding = check_records([record], case.bench, flows)[0]
    assert (finding.name, finding.about) == ("gauge pressures", channel)
    assert finding.suggestion == {
        f"{channel}_Pa": {"column": f"{channel}_Pa", "offset": case.bench.p_ext}
    }


def test_balances_that_leave_more_than_all_tell_of_no_gauge_pressures():
    assert _times_less((0.02, 0.03), (0.2, 0.3)) == pytest.approx(10.0)
    assert _times_less((220.0, 200.0), (1400.0, 1300.0)) == 0.0
