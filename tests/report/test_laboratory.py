"""The axis in laboratory units: numbers are those of the result, and every symbol is explained."""

import pytest

from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.tables.laboratory import LEGEND, laboratory_tables, legend_table
from pneumo_casadi.report.tables.table import Table


@pytest.fixture(scope="module")
def tables(quick):
    return {table.title.partition(",")[0]: table for table in laboratory_tables(result_dict(quick))}


def number(text):
    return float(text.split()[0])


def test_areas_and_volumes_are_in_centimetres(quick, tables):
    rows = {row[0]: row for row in tables["Chambers"].rows}
    derived = quick.output_error.derived
    assert rows["Piston area S"][1].endswith("cm²")
    assert number(rows["Piston area S"][1]) == pytest.approx(1e4 * derived["S_P"].value, rel=1e-3)
    volume = rows["Volume at mid-stroke V(0)"][2]
    assert volume.endswith("cm³")
    assert number(volume) == pytest.approx(1e6 * derived["V_N(0)"].value, rel=1e-2)
    assert rows["Dead length l_D"][1].endswith("mm")


def test_the_valve_has_the_conductance_of_its_largest_command(quick, tables):
    (C, *_) = tables["Valve"].rows
    bench, table = quick.case.bench, quick.flow_map
    choked = table.q_m[(table.u == table.u.max()) & (table.p == table.p.min())]
    expected = 1e8 * float(choked.mean()) / (1.185 * bench.p_supply)
    assert number(C[1]) == pytest.approx(expected, rel=0.03)
    assert "3 V" in C[1] and "-3 V" in C[2]


def test_a_held_parameter_says_so(quick):
    content = result_dict(quick)
    held = {"value": 16.4, "std": None, "std_robust": None, "unit": "kg", "note": "held fixed"}
    content["output_error"]["parameters"]["M"] = held
    (_, motion, *_) = laboratory_tables(content)
    assert motion.rows[0][1] == "16.400 kg (held fixed)"


def test_the_legend_explains_what_is_used():
    assert [row[0] for row in legend_table("M and X_s1").rows[-2:]] == ["X_s1, X_s4", "M"]
    assert all(meaning for meaning in LEGEND.values())


def test_the_legend_reads_headings_and_first_cells_of_tables():
    table = Table("", ("", "p_P [kPa]"), (("Piston area S", "M"),))
    assert [row[0] for row in legend_table("x", table).rows] == ["x, v", "p_P, p_N", "S, S_P, S_N"]
