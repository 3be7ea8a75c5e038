"""Tables and the HTML report: what is printed is what was found."""

import math
import re
from dataclasses import replace

import pytest

from pneumo_casadi.data import Grade, ValveData, Valves
from pneumo_casadi.identification.warnings import ResultWarning
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.report.pages.identification import html_report
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.tables.paper import TABLE_1
from pneumo_casadi.report.tables.parameters import parameter_table, scale_notes
from pneumo_casadi.report.tables.table import interval_text, with_symbols
from pneumo_casadi.report.text.identification import render, render_warnings, text_report
from pneumo_casadi.valve import FlowPair

PIXEL = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x03\x20\x00\x00\x02\x58"


@pytest.mark.parametrize(
    ("value", "half", "exponent", "text"),
    [
        (16.8975, 0.0044, 0, "16.8975 ± 0.0044"),
        (3.4879e-9, 7.4e-12, -9, "3.4879 ± 0.0074"),
        (195.0, 16.2, 0, "195 ± 16"),
        (1.0, math.inf, 0, "1.000 (no interval)"),
        (1.0, None, 0, "1.000"),
    ],
)
def test_an_estimate_has_as_many_digits_as_its_interval_allows(value, half, exponent, text):
    assert interval_text(value, half, exponent) == text


@pytest.mark.parametrize(
    ("P", "N", "maps", "notes"),
    [
        (0.01, 0.01, 1, ["X_s1 ... X_s6 have the scale of the flow meter, whose .* 1 %"]),
        (0.01, 0.02, 1, ["X_s1 ... X_s6 have the scale of the flow meter, whose .* 2 %"]),
        (
            0.01,
            None,
            2,
            [
                "X_s1 ... X_s3 have the scale of .* chamber P's valve, whose .* 1 %",
                "accuracy of .* chamber N's valve is not stated .* X_s4 ... X_s6 1 % too large",
            ],
        ),
    ],
)
def test_a_note_says_for_each_chamber_how_well_its_flow_meter_is_known(quick, P, N, maps, notes):
    meters = Valves(ValveData(accuracy=P), ValveData(accuracy=N))
    bench, flow = replace(quick.case.bench, valves=meters), quick.axis.flow
    axis = Servosystem(bench, flow if maps == 1 else FlowPair(flow, flow))
    identification = replace(
        quick,
        case=replace(quick.case, bench=bench),
        output_error=replace(quick.output_error, axis=axis),
    )
    written = scale_notes(identification)
    assert len(written) == len(notes)
    assert all(re.search(pattern, note) for pattern, note in zip(notes, written, strict=True))


def test_wls_output_error_truth_and_the_paper_stand_side_by_side(quick):
    table = parameter_table(quick, paper=True)
    assert table.columns == (
        "",
        "unit",
        "WLS",
        "output error",
        "truth",
        "OE - truth",
        "Table 1",
    )
    assert [row[0] for row in table.rows] == [*map(with_symbols, TABLE_1), "k_P", "k_N"]
    assert {"F_c⁺", "F_c⁻"} <= {row[0] for row in table.rows}
    mass = dict(zip(table.columns, table.rows[6], strict=True))
    assert mass["truth"] == "16.9"
    assert mass["Table 1"] == "16.900 ± 0.074"


def test_without_truth_there_is_no_column_for_it(quick):
    table = parameter_table(replace(quick, truth=None))
    assert table.columns == ("", "unit", "WLS", "output error")


def test_a_parameter_at_a_bound_has_no_interval(quick):
    estimate = replace(quick.output_error.uncertainty, at_bound=("f_v",))
    changed = replace(quick, output_error=replace(quick.output_error, uncertainty=estimate))
    row = next(row for row in parameter_table(changed).rows if row[0] == "f_v")
    assert "±" not in row[3]


def test_the_intervals_printed_are_the_wider_ones(quick):
    result = quick.output_error
    row = next(row for row in parameter_table(quick).rows if row[0] == "M")
    half = float(row[3].split("±")[1])
    assert half == pytest.approx(2 * max(result.std("M"), result.std("M", robust=True)), rel=0.06)


def test_columns_of_a_printed_table_line_up(quick):
    lines = render(parameter_table(quick)).splitlines()[2:14]
    rule = lines[1]
    edges = [m.end() for m in re.finditer("-+", rule)]
    assert len(edges) == len(parameter_table(quick).columns)
    assert all(len(line) <= len(rule) for line in lines)


def test_the_report_begins_with_the_warnings(quick):
    text = text_report(quick)
    assert text.index("Before you use these numbers") < text.index("Identified parameters")


def test_no_warning_is_said_too():
    assert render_warnings(()) == "No warnings."


@pytest.mark.slow
def test_the_page_stands_alone_and_escapes_what_it_shows(quick):
    changed = replace(
        quick, warnings=(ResultWarning(Grade.NOTE, "wls", "a < b & <script>: `std` of F_c_plus"),)
    )
    picture = Picture("overview", PIXEL, "Flow map & parameters.")
    page = html_report(changed, [picture], paper=True)
    assert '<html lang="en">' in page
    own, _, scripts = page.partition("<script>")  # the scripts of plots stand at the end
    assert "</script" not in own.replace("</script>\n</div>", "") and "&lt;script&gt;" in own
    assert scripts.count("<script>") == 1
    assert "a &lt; b &amp; &lt;script&gt;: <code>std</code> of F_c⁺" in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", own)
    assert 'alt="Flow map &amp; parameters."' in page
    assert 'width="800" height="600"' in page
    order = ("Usable", "Parameters", "Before you use these numbers", "Why to trust it", "Details")
    at = [page.index(f">{title}</h2>") for title in order]
    assert at == sorted(at)
