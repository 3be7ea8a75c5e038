"""Every way a case is spoilt in practice ends in an error that says where, what and what to do."""

import gzip
import json
import re

import pytest

from pneumo_casadi.data import Grade, read_case
from pneumo_casadi.data.case_folder import inspect_case
from pneumo_casadi.errors import CaseError

COLUMNS = ["t_s", "u_P_V", "u_N_V", "p_P_Pa", "p_N_Pa", "x_m", "x_ref_m"]


def cells(change, rows=slice(None)):
    """A change of lines that applies `change` to the cells of some rows (by column name)."""

    def apply(lines):
        header, body = lines[0], [line.split(",") for line in lines[1:]]
        for row in body[rows]:
            named = dict(zip(COLUMNS, row, strict=True))
            change(named)
            row[:] = [str(named[name]) for name in COLUMNS]
        return [header, *(",".join(row) for row in body)]

    return apply


def scaled(scale, *names):
    def change(row):
        for name in names:
            row[name] = float(row[name]) * scale

    return change


def setting(name, value):
    def change(row):
        row[name] = value

    return change


def swapped(a, b):
    def change(row):
        row[a], row[b] = row[b], row[a]

    return change


def shifted(name, offset):
    def change(row):
        row[name] = float(row[name]) + offset

    return change


ROW = slice(1233, 1234)  # row 1234, line 1235
AT = r"identify\.csv: row 1234 \(line 1235\)"
SPOILT = {
    "pressure in bar": (
        cells(scaled(1e-5, "p_P_Pa", "p_N_Pa")),
        r"identify\.csv: row 1 \(line 2\): `p_P`: expected absolute Pa .* got 4\.\d+ .*in bar",
    ),
    "pressure in kPa": (cells(scaled(1e-3, "p_N_Pa")), r"row 1 \(line 2\): `p_N`.*Pa.*kPa"),
    "gauge pressure below ambient": (
        cells(lambda row: row.update(p_P_Pa=float(row["p_P_Pa"]) * 0.2)),
        r"`p_P`: expected absolute Pa.*below the ambient.*is it in gauge Pa\?",
    ),
    "a pressure spike": (
        cells(setting("p_N_Pa", 2e6), ROW),
        AT + r": `p_N`: expected absolute Pa .* got 2e\+06 .*1 of 4000 rows\); cut these rows out",
    ),
    "position in mm": (
        cells(scaled(1e3, "x_m", "x_ref_m")),
        r"row \d+ \(line \d+\): `x`: expected m .* got .*stroke exceeded.*is it in mm",
    ),
    "position from the end of the stroke": (
        cells(shifted("x_m", 0.25)),
        r"`x`: expected m from mid-stroke.*subtract l/2",
    ),
    "position in mm from the end of the stroke": (
        cells(lambda row: row.update(x_m=1e3 * (float(row["x_m"]) + 0.25))),
        r"`x`: expected m .*is it in mm from the end of the stroke .*\"unit\": \"mm\", "
        r"\"offset\": -0\.25",
    ),
    "stroke exceeded": (
        cells(setting("x_m", 0.31), ROW),
        AT + r": `x`: expected m .*-0\.25\d* and 0\.25\d*, got 0\.31 \(stroke exceeded; 1 of 4000",
    ),
    "command in mV": (cells(scaled(1e3, "u_P_V")), r"`u_P`: expected V .*u_max.*is it in mV\?"),
    "command beyond u_max": (
        cells(setting("u_P_V", 5.5), ROW),
        AT + r": `u_P`: expected V between -5\.\d* and 5\.\d*, got 5\.5 .*cut these rows out",
    ),
    "NaN": (
        cells(setting("p_P_Pa", "nan"), ROW),
        AT + r": `p_P` \[Pa\] is nan \(1 of 4000 rows\); cut",
    ),
    "an empty cell": (cells(setting("x_m", ""), ROW), AT + r": `x` \[m\] is nan"),
    "infinity": (cells(setting("x_m", "inf"), ROW), AT + r": `x` \[m\] is inf"),
    "text in a cell": (
        cells(setting("u_N_V", "0.1 V"), ROW),
        AT + r", column `u_N_V`: '0\.1 V' is no number; write plain numbers",
    ),
    "a cell too many": (
        lambda lines: [*lines[:1234], lines[1234] + ",7", *lines[1235:]],
        AT + r" has 8 cells, line 1 names 7 columns",
    ),
    "decimal commas": (
        lambda lines: [lines[0], *(line.replace(".", ",") for line in lines[1:])],
        r"row 1 \(line 2\) has more cells .*point in numbers",
    ),
    "semicolons": (
        lambda lines: [line.replace(",", ";") for line in lines],
        r"line 1 separates columns by semicolon.*use commas",
    ),
    "a position in centimetres": (
        cells(scaled(100, "x_m", "x_ref_m")),
        r"stroke exceeded.*is it in mm or cm\? In columns\.json: .*\"unit\": \"cm\"",
    ),
    "an empty line": (
        lambda lines: [*lines[:1234], "", *lines[1234:]],
        AT + r": `t` \[s\] is nan",
    ),
    "a missing column": (
        lambda lines: [",".join(line.split(",")[:4] + line.split(",")[5:]) for line in lines],
        r"no column `p_N_Pa`; the file has `t_s`, .*`p_P_Pa`.*in columns\.json .*\"p_N_Pa\": ",
    ),
    "no time": (
        lambda lines: [line.partition(",")[2] for line in lines],
        r"no column `t_s`; the file has u_P_V",
    ),
    "a column in another unit": (
        lambda lines: [lines[0].replace("p_P_Pa", "p_P_bar"), *lines[1:]],
        r"`p_P_bar` is in bar, expected `p_P_Pa`; .*columns\.json: .p_P_Pa.: \[.p_P_bar., .bar.\]",
    ),
    "a column named twice": (
        lambda lines: [lines[0].replace("p_P_Pa", "p_N_Pa"), *lines[1:]],
        r"line 1 names column p_N_Pa twice; remove one",
    ),
    "swapped pressures": (
        cells(swapped("p_P_Pa", "p_N_Pa")),
        r"`p_P_Pa` and `p_N_Pa` \(chambers P and N\) swapped\? Rows 1 to 4000",
    ),
    "swapped commands": (
        cells(swapped("u_P_V", "u_N_V")),
        r"`u_P_V` and `u_N_V` swapped, or the valves reversed\?",
    ),
    "a position that counts the wrong way": (
        cells(scaled(-1.0, "x_m", "x_ref_m")),
        r"does `x_m` count the wrong way\?",
    ),
    "a dead sensor": (
        cells(setting("p_P_Pa", "400000")),
        r"row 1 \(line 2\): `p_P` stays at 400000 Pa in all 4000 rows: a dead sensor",
    ),
    "a sensor that freezes": (
        cells(setting("p_N_Pa", "500000"), slice(1233, None)),
        AT + r": `p_N` stays at 500000 Pa for 2767 rows although its noise is 150 Pa: a frozen",
    ),
    "lost samples": (
        lambda lines: lines[:1234] + lines[1237:],
        AT + r": `t` jumps from 1\.232 s to 1\.236 s: 3 samples of 0\.001 s are lost; cut",
    ),
    "a repeated sample": (
        lambda lines: [*lines[:1234], lines[1233], *lines[1234:]],
        AT + r": `t` repeats 1\.232 s; remove",
    ),
    "time that runs backward": (
        lambda lines: [*lines[:1234], *lines[1000:]],
        AT + r": `t` runs backward from 1\.232 s to 0\.999 s; remove",
    ),
    "a clock that stutters": (
        cells(shifted("t_s", 0.0003), slice(1233, None)),
        AT + r": `t` steps by 0\.0013 s where 0\.001 s is usual: the clock is irregular",
    ),
    "time in ms": (cells(scaled(1e3, "t_s")), r"bench samples at 1000 Hz; is `t` in ms\?"),
    "another sampling frequency": (
        cells(scaled(1.01, "t_s")),
        r"990\.099 Hz, but the bench samples at 1000 Hz; correct `t` or .*`sampling_frequency`",
    ),
    "a header alone": (lambda lines: lines[:1], r"identify\.csv: the file has no rows of data"),
    "too few rows": (lambda lines: lines[:30], r"identify\.csv: 29 rows, fewer than 50"),
    "a last line cut short": (
        lambda lines: [*lines[:-1], lines[-1][:20]],
        r"row 4000 \(line 4001\), the last one, ends before column `x_ref_m`: .*cut short",
    ),
}


def test_a_good_case_loads_without_a_note(case_folder):
    case = read_case(case_folder())
    assert case.findings == () and case.identify[0].N == 4000 and case.validate == ()


@pytest.mark.parametrize("name", SPOILT)
def test_spoilt_data_are_refused_with_place_value_unit_and_remedy(case_folder, name):
    change, message = SPOILT[name]
    folder = case_folder(change)
    with pytest.raises(CaseError, match=message) as caught:
        read_case(folder)
    assert str(folder / "identify.csv") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_swapped_areas_are_told_by_the_force_balance(case_folder):
    folder = case_folder()
    text = (folder / "bench.json").read_text()
    text = text.replace("S_P_m2", "S_?").replace("S_N_m2", "S_P_m2").replace("S_?", "S_N_m2")
    (folder / "bench.json").write_text(text)
    finding = read_case(folder).findings[0]
    assert finding.grade is Grade.SEVERE
    assert re.search(r"`S_P` = 0\.000603 m² and `S_N` = 0\.000875 m² look swapped", finding.text)
    assert dict(finding.suggestion) == {"S_P_m2": 8.75e-4, "S_N_m2": 6.03e-4}


def test_gauge_pressures_within_range_are_severe(case_folder):
    def gauge(row):
        for name in ("p_P_Pa", "p_N_Pa"):
            row[name] = float(row[name]) - 1e5

    (finding,) = read_case(case_folder(cells(gauge))).findings
    assert finding.grade is Grade.SEVERE and finding.name == "gauge pressures"
    assert finding.suggestion["p_N_Pa"] == {"column": "p_N_Pa", "offset": 100000}


def test_a_command_that_breaks_the_control_law_is_noted(case_folder):
    (finding,) = read_case(case_folder(cells(setting("u_N_V", 1.5), ROW))).findings
    assert finding.grade is Grade.CAUTION
    assert re.search(r"identify: row 1234: `u_N` = 1\.5 V is not −`u_P`", finding.sentence)


def test_checks_can_be_left_out(case_folder):
    case = read_case(case_folder(cells(scaled(1e-5, "p_P_Pa"))), check=False)
    assert case.identify[0]["p_P"].max() < 10


def test_an_empty_file_is_named(case_folder):
    folder = case_folder()
    (folder / "identify.csv").write_bytes(b"")
    with pytest.raises(CaseError, match=r"identify\.csv: the file is empty \(0 bytes\); copy"):
        read_case(folder)


def test_a_compressed_file_cut_short_is_named(case_folder, good_text):
    folder = case_folder()
    (folder / "identify.csv").unlink()
    whole = gzip.compress(good_text.encode())
    (folder / "identify.csv.gz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(CaseError, match=r"identify\.csv\.gz: the compressed file is cut short"):
        read_case(folder)


def test_a_file_that_only_claims_to_be_compressed_is_named(case_folder, good_text):
    folder = case_folder()
    (folder / "identify.csv").rename(folder / "identify.csv.gz")
    with pytest.raises(CaseError, match=r"identify\.csv\.gz: the compressed file is .* damaged"):
        read_case(folder)


def test_a_last_number_cut_short_does_not_pass_for_another_number(case_folder, good_text):
    folder = case_folder()
    (folder / "identify.csv").write_text(good_text[:-4])
    with pytest.raises(CaseError, match=r"line 4001, the last one, .*fewer decimals.*cut short"):
        read_case(folder)


def test_a_missing_final_newline_alone_is_no_fault(case_folder, good_text):
    folder = case_folder()
    (folder / "identify.csv").write_text(good_text[:-1])
    assert read_case(folder).identify[0].N == 4000


def test_a_folder_without_a_record_says_what_to_add(case_folder):
    folder = case_folder()
    (folder / "identify.csv").unlink()
    with pytest.raises(CaseError, match=r"no record to identify on; add identify\.csv\.gz"):
        read_case(folder)


def test_a_record_in_two_formats_is_refused(case_folder, good_text):
    folder = case_folder()
    (folder / "identify.csv.gz").write_bytes(gzip.compress(good_text.encode()))
    with pytest.raises(CaseError, match="record identify stands there in two formats"):
        read_case(folder)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(CaseError, match=r"nowhere: no such folder"):
        read_case(tmp_path / "nowhere")


def test_an_offset_in_bar_is_told_to_be_added_in_pascal(case_folder):
    """Sensors in bar gauge, and 1 bar meant."""

    def gauge(row):
        for name in ("p_P_Pa", "p_N_Pa"):
            row[name] = 1e-5 * float(row[name]) - 1

    folder = case_folder(cells(gauge))
    entry = {"unit": "bar", "offset": 1}
    entries = {name: {"column": name, **entry} for name in ("p_P_Pa", "p_N_Pa")}
    (folder / "columns.json").write_text(json.dumps(entries))
    first, *others = read_case(folder).findings
    assert "`offset` is in Pa, not in the unit of the column: 1 Pa is added to `p_P`" in first.text
    for finding in (first, *(f for f in others if f.name == "gauge pressures")):
        assert finding.suggestion["p_P_Pa"]["offset"] == 100_000
    (folder / "columns.json").write_text(json.dumps({**entries, **first.suggestion}))
    assert read_case(folder).findings == ()


def test_areas_stated_as_a_share_in_place_of_per_cent_are_questioned(case_folder, bench_json):
    folder = case_folder()
    bench_json('"stroke_m"', '"area_accuracy_percent": 0.01, "stroke_m"')
    (finding,) = read_case(folder).findings
    assert finding.grade is Grade.CAUTION and "`area_accuracy_percent` = 0.01: is 1 % meant?" in (
        finding.text
    )
    bench_json('"stroke_m"', '"area_accuracy_percent": 0.2, "stroke_m"')
    assert read_case(folder).findings == ()


def test_an_offset_in_mm_is_told_before_the_position_that_it_leaves(case_folder):
    """A position from the end of the stroke, in mm, and 250 mm meant: all rows are out of range."""

    def from_end(row):
        row["x_m"] = 1e3 * float(row["x_m"]) + 250.0

    folder = case_folder(cells(from_end))
    entry = {"column": "x_m", "unit": "mm", "offset": -250}
    (folder / "columns.json").write_text(json.dumps({"x_m": entry}))
    with pytest.raises(CaseError, match=r"`offset` is in m, .* is -0\.25 m meant\?"):
        read_case(folder)
    (finding,) = inspect_case(folder).findings
    assert finding.name == "offset in another unit"
    assert finding.suggestion["x_m"]["offset"] == -0.25


def test_an_offset_beside_a_calibrated_scale_is_in_its_unit(case_folder):
    folder = case_folder(cells(lambda row: row.update(p_P_Pa=(float(row["p_P_Pa"]) - 1e5) / 1.02)))
    entry = {"column": "p_P_Pa", "scale": 1.02, "offset": 1e5}
    (folder / "columns.json").write_text(json.dumps({"p_P_Pa": entry}))
    assert read_case(folder).findings == ()
