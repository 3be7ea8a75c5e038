"""The axis in laboratory units: numbers are those of the result, and every symbol is explained."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.estimation.output_error.conductance import conductances
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.tables.laboratory import LEGEND, laboratory_tables, legend_table
from pneumo_casadi.report.tables.parameters import parameter_table
from pneumo_casadi.report.tables.table import Table
from pneumo_casadi.report.text.final_model import least_certain


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
    assert " ± " in C[1] and " ± " in C[2]


def test_the_interval_of_a_conductance_is_that_of_the_map(quick):
    """A common factor of the map is the most uncertain of it; its scatter adds to that."""
    entry = conductances(quick.output_error, quick.flow_map, quick.flow)["both"]
    relative = entry["C_fill_std"] / entry["C_fill_m3_per_s_Pa"]
    model = quick.flow
    assert 0.5 * model.scale_sigma < relative < 0.03
    nothing_known = replace(
        quick.output_error.uncertainty,
        covariance=np.full_like(quick.output_error.uncertainty.covariance, np.inf),
    )
    blind = replace(quick.output_error, uncertainty=nothing_known)
    assert conductances(blind, quick.flow_map, quick.flow)["both"]["C_fill_std"] is None


def test_effects_stand_in_a_table_of_their_own(quick):
    content = result_dict(quick)
    V = {"value": 1.3e-4, "std": 1e-6, "std_robust": 1e-6, "unit": "m3"}
    content["output_error"]["parameters"]["hose_volume.V"] = V
    (effects,) = (t for t in laboratory_tables(content) if t.title.startswith("Effects"))
    assert effects.rows == (("hose: V", "130.0 ± 2.0 cm³"),)
    assert effects.notes == ("hose: V: volume between valve and restriction.",)


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


@pytest.mark.parametrize(
    ("valve", "maps", "stated"),
    [
        ({"source": "metered"}, 1, False),
        ({"source": "metered", "accuracy_percent": 2.0}, 1, True),
        ({"P": {"accuracy_percent": 2.0}, "N": {}}, 1, True),
        ({"P": {"accuracy_percent": 2.0}, "N": {}}, 2, False),
    ],
)
def test_an_accuracy_that_is_not_stated_of_each_meter_is_missed(quick, valve, maps, stated):
    content = result_dict(quick)
    conductance = content["flow"]["conductance"]["both"]
    if maps == 2:
        flow = {**content["flow"], "conductance": {"P": conductance, "N": conductance}}
        content = {**content, "flow": flow}
    bench = {"area_accuracy_percent": 2.0, "valve": valve}
    content = {**content, "model": {**content["model"], "bench": bench}}
    (table,) = (t for t in laboratory_tables(content) if t.title.startswith("Valve"))
    assert bool(table.notes) is not stated


def test_the_least_certain_parameter_is_so_by_the_wider_interval():
    items = {
        "M": {"value": 16.0, "std": 0.5, "std_robust": 0.2},
        "f_v": {"value": 11.0, "std": 0.2, "std_robust": 0.21},
        "v_s": {"value": 1e-4, "std": None, "std_robust": None},
    }
    assert least_certain({"output_error": {"parameters": items}}) == "M, ± 6.2 % (2σ)"


def test_the_difference_from_a_negative_truth_has_its_sign(quick):
    known = replace(quick, truth={"F_c_plus": -15.0})
    table = parameter_table(known)
    (row,) = (row for row in table.rows if row[0] == "F_c⁺")
    at = table.columns.index("OE - truth")
    assert row[at].startswith("+")
