"""The bench: every number in its SI unit, or a question about the unit it is in."""

import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from pneumo_casadi.data import (
    Bench,
    FlowSource,
    ForceBench,
    NestedController,
    ProportionalController,
    SensorNoise,
    ValveData,
    read_bench,
)
from pneumo_casadi.data.bench.bench_file import bench_content, bench_from_content
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.errors import CaseError


def test_a_bench_file_gives_the_bench(bench_json, bench):
    assert read_bench(bench_json()) == bench


@pytest.mark.parametrize(
    ("name", "value", "unit", "question"),
    [
        ("p_supply", 7.0, "absolute Pa", "bar"),
        ("p_supply", 700.0, "absolute Pa", "kPa"),
        ("p_supply", 0.7, "absolute Pa", "MPa"),
        ("p_ext", 1.0, "absolute Pa", "bar"),
        ("p_ext", 0.0, "absolute Pa", "gauge Pa"),
        ("stroke", 500.0, "m", "mm or cm"),
        ("S_P", 8.75, "m²", "cm²"),
        ("S_N", 603.0, "m²", "cm² or mm²"),
        ("T", 20.0, "K", "°C"),
        ("r", 0.287, "J", "kJ"),
        ("sampling_frequency", 5.0, "Hz", "kHz"),
    ],
)
def test_another_unit_is_recognised(bench, name, value, unit, question):
    with pytest.raises(CaseError) as caught:
        replace(bench, **{name: value})
    message = str(caught.value)
    assert message.startswith(f"`{name}`: expected {unit}") and f"got {value:g}" in message
    assert f"is it in {question}" in message


@pytest.mark.parametrize("value", [np.nan, np.inf, "7e5", None, True])
def test_what_is_no_number_is_refused(bench, value):
    with pytest.raises(CaseError, match=r"`p_supply`: expected a (finite )?number in absolute Pa"):
        replace(bench, p_supply=value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"p_ext_Pa": 100000.0,', "", "missing key `p_ext_Pa`"),
        ("p_ext_Pa", "p_ext_bar", "missing key `p_ext_Pa`; there stands `p_ext_bar`"),
        ('"T_K"', '"colour": "red", "T_K"', "unknown key `colour`; known are"),
        ('"T_K"', '"T_K": 290.0, "T_K"', "bench.json: key `T_K` stands twice; keep one"),
        ("700000.0", "6.0", "`p_supply_Pa`: expected absolute Pa .* got 6; is it in bar"),
        ("700000.0", "NaN", "`p_supply_Pa`: expected a finite number"),
        ('"u_max_V": 5.0', '"u_max": 5.0', "missing key `controller.u_max_V`; there stands"),
        (
            '"u_max_V": 5.0',
            '"u_max_V": -5.0',
            "`controller.u_max_V`: expected a positive limit in V",
        ),
        ("proportional", "fuzzy", "`controller.type`: got 'fuzzy'; write 'proportional' or "),
        ("M_kg", "M_lb", "`datasheet.M_lb`: the name must end in its SI unit"),
        ('{"M_kg": 17.0}', "17.0", "`datasheet`: expected a JSON object, got 17.0"),
        ('"p_Pa": 150.0', '"p_Pa": -1', "`sensor_noise.p_Pa`: expected Pa between 0"),
        ('"p_Pa": 150.0', '"p_Pa": 0', "`sensor_noise.p_Pa`: 0 Pa; no sensor is exact"),
        ('"x_m": 1.5e-05', '"x_m": 0', "`sensor_noise.x_m`: 0 m; no sensor is exact"),
        (
            '"x_m": 1.5e-05',
            '"x_m": 0.015',
            r"`sensor_noise.x_m`: expected m .* got 0\.015; is it in mm",
        ),
        ("}\n}", "}", "line 13: .*cut short or no JSON"),
    ],
)
def test_a_bench_file_with_a_fault_is_named_with_the_key(bench_json, old, new, message):
    path = bench_json(old, new)
    with pytest.raises(CaseError, match=message) as caught:
        read_bench(path)
    assert str(path) in str(caught.value)


def test_noise_and_datasheet_may_be_unknown(bench_json):
    path = bench_json()
    text = path.read_text().split(',\n "datasheet"')[0] + "\n}"
    path.write_text(text)
    bench = read_bench(path)
    assert bench.noise is None and not bench.datasheet


def test_a_bench_cannot_be_changed(bench):
    with pytest.raises(FrozenInstanceError):
        bench.stroke = 1.0
    with pytest.raises(TypeError):
        bench.datasheet["M_kg"] = 1.0


def test_a_bench_survives_pickling_and_replacement(bench):
    assert pickle.loads(pickle.dumps(bench)) == bench
    assert replace(bench, stroke=0.4).stroke_limits == (-0.2, 0.2)
    force = ForceBench(1000.0, None, NestedController(160.0, 243.0, 35.0, 10.0))
    assert pickle.loads(pickle.dumps(force)) == force


def test_supply_must_exceed_ambient(bench):
    with pytest.raises(CaseError, match="p_ext"):
        replace(bench, p_supply=1.2e5, p_ext=1.2e5)


def test_a_controller_of_the_wrong_kind_is_refused(bench):
    with pytest.raises(CaseError, match="NestedController sets F, but the inputs"):
        replace(bench, controller=NestedController(1.0, 1.0, 1.0, 1.0))


def test_zero_noise_is_refused_where_there_is_a_sensor(bench):
    with pytest.raises(CaseError, match="no sensor is exact"):
        replace(bench, noise=SensorNoise(p=0.0, x=1e-5))
    with pytest.raises(CaseError, match="no sensor is exact"):
        SensorNoise(p=150.0, x=0.0)


def test_proportional_commands_oppose_each_other_and_saturate():
    controller = ProportionalController(gain=10.0, u_max=5.0)
    command = controller.command(np.array([0.1, 1.0, -1.0]), np.zeros(3), np.zeros(3))
    assert np.array_equal(command, [[1.0, -1.0], [5.0, -5.0], [-5.0, 5.0]])


def test_the_nested_controller_saturates_before_the_drive_gain():
    controller = NestedController(k_p=2.0, k_v=3.0, gain=4.0, u_max=5.0)
    command = controller.command(np.array([0.5, 9.0]), np.zeros(2), np.array([0.25, 0.0]))
    assert np.array_equal(command, [[4 * 3 * (2 * 0.5 - 0.25)], [4 * 5.0]])


@pytest.mark.parametrize("kwargs", [{"gain": 0.0, "u_max": 5.0}, {"gain": 1.0, "u_max": 0.0}])
def test_a_controller_without_gain_or_range_is_refused(kwargs):
    with pytest.raises(CaseError, match="closes no loop"):
        ProportionalController(**kwargs)


def test_the_stroke_has_its_zero_in_the_middle(bench):
    assert isinstance(bench, Bench) and bench.stroke_limits == (-0.25, 0.25)


@pytest.mark.parametrize(
    "fields",
    [
        {"valve": {"source": "none"}, "arrangement": "one 5/3", "clock": "as recorded"},
        {"valve": {"source": "metered", "accuracy_percent": 2}, "area_accuracy_percent": 0.5},
        {
            "valve": {
                "source": "data sheet",
                "C_fill_m3_per_s_Pa": 1.2e-8,
                "C_exhaust_m3_per_s_Pa": 1.4e-8,
                "b": 0.3,
                "u_full_V": 5,
            },
            "load": {"angle_deg": 90, "force_N": -20},
        },
        {"controller": {"type": "none", "u_max_V": 5}},
        {
            "controller": {"type": "none"},
            "sensor_noise": {"p_Pa": 150, "x_m": 1e-5, "v_m_per_s": 1},
        },
    ],
)
def test_what_laboratories_have_is_read_and_written_back(bench, fields):
    read = bench_from_content(bench_content(bench) | fields)
    assert bench_from_content(bench_content(read)) == read != bench


MISSING = "`valve.C_fill_m3_per_s_Pa`, `valve.C_exhaust_m3_per_s_Pa`, `valve.u_full_V` for a"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"T_K": "293"}, r"`T_K`: expected a number in K, got '293'"),
        ({"area_accuracy_percent": 0}, r"`area_accuracy_percent`: expected % between 0.01 and 50"),
        (
            {"valve": {"source": "metered", "accuracy_percent": 200}},
            r"`valve.accuracy_percent`: expected % between 0 and 100, got 200; check",
        ),
        (
            {"valve": {name: {"source": "metered", "accuracy_percent": -2} for name in "PN"}},
            r"`valve.P.accuracy_percent`: expected % between 0 and 100, got -2; check",
        ),
        (
            {"valve": {"source": "metered", "u_full_V": 1e6}},
            r"`valve.u_full_V`: expected V between",
        ),
        ({"load": {"angle_deg": 100}}, r"`load.angle_deg`: expected ° between"),
        ({"load": {"force_N": "9"}}, r"`load.force_N`: expected a number in N"),
        (
            {"controller": {"type": "pid", "k_p_V_per_m": "2", "u_max_V": 5}},
            r"`controller.k_p_V_per_m`: expected a number in V/m",
        ),
    ],
)
def test_a_value_that_cannot_be_is_named_by_its_key_in_its_unit(bench, fields, message):
    with pytest.raises(CaseError, match=message):
        bench_from_content(bench_content(bench) | fields)


def test_a_valve_without_conductances_is_no_data_sheet(bench):
    content = bench_content(bench) | {"valve": {"source": "data sheet", "b": 0.3}}
    with pytest.raises(CaseError, match=MISSING):
        bench_from_content(content)


def test_the_moving_mass_alone_takes_its_pressures_as_inputs():
    content = {
        "axis": "pressures",
        "sampling_frequency_Hz": 100.0,
        "S_P_m2": 5.25e-4,
        "S_N_m2": 0,
        "stroke_m": None,
        "p_ext_Pa": 1e5,
    }
    bench = bench_from_content(content)
    assert bench.kind.inputs == ("p_P",)
    assert bench_from_content(bench_content(bench)) == bench


def test_an_exact_flow_meter_is_as_one_of_which_nothing_is_stated():
    assert ValveData(FlowSource.METERED, accuracy=0.0) == ValveData(FlowSource.METERED)
    sheet = {"C_fill": 1.2e-8, "C_exhaust": 1.4e-8, "u_full": 5.0}
    with pytest.raises(CaseError, match=r"accuracy_percent`: 0 for a data sheet.* leave it out"):
        ValveData(FlowSource.DATA_SHEET, accuracy=0.0, **sheet)


@pytest.mark.parametrize(
    ("load", "M"),
    [(Load(force=1e5), 17.0), (Load(force=-1e4), None), (Load(angle_deg=90.0), 200.0)],
)
def test_a_load_that_no_pressure_moves_is_refused(bench, load, M):
    datasheet = {} if M is None else {"M_kg": M}
    with pytest.raises(CaseError, match=r"exceed the largest piston force.*= 612\.5 N"):
        replace(bench, load=load, datasheet=datasheet)


@pytest.mark.parametrize(("force", "M"), [(1900.0, 200.0), (1900.0, None), (250.0, 17.0)])
def test_a_force_may_balance_a_weight_known_or_not(bench, force, M):
    datasheet = {} if M is None else {"M_kg": M}
    load = Load(angle_deg=90.0, force=force)
    assert replace(bench, load=load, datasheet=datasheet).load == load
