"""What laboratories own: the records of the bench hold against what is known of them."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import (
    Arrangement,
    CascadeController,
    Clock,
    FlowSource,
    InputHold,
    NoController,
    PidController,
    PressureBench,
    read_case,
)
from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.data.control.memory import memory_at_start
from pneumo_casadi.virtual_bench import Laboratory, make_case, metered_map, random_axis

SEED, SECONDS = 1, 2.0


@pytest.fixture
def made(tmp_path):
    def make(**owned):
        laboratory = Laboratory(**owned)
        return make_case(tmp_path / "case", SEED, duration=SECONDS, laboratory=laboratory)

    return make


PID = PidController(4.0, 0.25, k_i=6.0, k_d=0.05, derivative_filter=0.01, u_0=0.02)
LAWS = [
    PID,
    replace(PID, anti_windup="clamping", sample_time=4e-3),
    replace(PID, anti_windup="back-calculation", tracking_time=0.05),
    CascadeController(6.0, 0.5, 0.2, k_i=2.0, velocity_filter=0.005, v_max=0.4),
    CascadeController(6.0, 0.5, 0.3, k_i=9.0, anti_windup="clamping", sample_time=2e-3),
]


@pytest.mark.parametrize("controller", LAWS)
def test_the_loop_of_the_bench_follows_the_law_as_the_package_states_it(made, controller):
    """Two descriptions of a law, recorded sample by sample: they differ by the converter's step."""
    record = made(controller=controller).case.identify[0]
    law, u = ControlLaw(controller, record.dt), record.stack(("u_P", "u_N")).T
    memory = memory_at_start(law, record["x_ref"], record["x"], u, 0.0)
    replayed, _ = law.replay(record["x_ref"], record["x"], memory)
    assert np.abs(replayed - u).max() < 2e-3
    lower, upper = controller.limits
    assert (np.abs(u[0] - controller.u_0 - upper) < 1e-3).sum() > 10  # it was limited
    assert np.ptp(u[0]) > 0.8 * (upper - lower)


def test_the_weight_of_an_inclined_axis_is_carried_by_the_pressures(made):
    case = made(angle_deg=90.0)
    record, axis = case.case.identify[0], case.axis
    force = axis.S_P * record["p_P"] - axis.S_N * record["p_N"] - (axis.S_P - axis.S_N) * axis.p_ext
    still = np.abs(np.gradient(record["x"], record.dt)) < 1e-3
    carried = float(np.mean(force[still]))
    assert carried == pytest.approx(axis.M * 9.81, abs=max(axis.F_c_plus, axis.F_c_minus))
    assert case.case.bench.load.angle_deg == 90.0


def test_a_laboratory_leaves_an_axis_as_it_is_but_for_what_it_states():
    axis = replace(random_axis(SEED), angle_deg=90.0, controller=PID)
    assert Laboratory().equip(axis) == axis
    assert Laboratory(angle_deg=0.0).equip(axis) == replace(axis, angle_deg=0.0)
    assert Laboratory(controller=NoController()).equip(axis).controller is None


def test_further_sensors_show_what_moves_the_piston(made):
    case = made(v_noise=1e-3, a_noise=0.05, load_force=30.0)
    record, axis = case.case.identify[0], case.axis
    assert case.case.bench.signals == {"v", "a", "F_load"}
    assert case.case.bench.noise.v == 1e-3 and case.case.bench.noise.a == 0.05
    pressed = axis.S_P * record["p_P"] - axis.S_N * record["p_N"]
    pressed -= (axis.S_P - axis.S_N) * axis.p_ext
    up = record["v"] > 0.02  # friction is known there
    left = pressed + record["F_load"] - axis.f_v * record["v"] - axis.F_c_plus
    assert np.abs(left - axis.M * record["a"])[up].mean() < 0.06 * axis.M + 1.0
    assert np.ptp(record["F_load"]) > 50.0


def test_a_recorded_supply_droops_while_chambers_fill(made):
    case = made(supply=True).case
    p_supply = case.identify[0]["p_supply"]
    assert p_supply.min() < case.bench.p_supply - 2e3
    assert p_supply.max() < case.bench.p_supply + 2e3


def test_two_valves_have_a_map_each(made):
    case = made(other_valve=0.25).case
    P, N = (np.loadtxt(case.folder / f"flow_map_{v}.csv", delimiter=",", skiprows=1) for v in "PN")
    filling = (P[:, 0] > 1.0) & (P[:, 1] < 5e5)
    assert (N[filling, 2] / P[filling, 2]).mean() == pytest.approx(1.25, abs=0.01)


def test_a_meter_is_off_by_about_what_is_stated_of_it(made):
    case = made(meter_accuracy=0.01)
    q = np.loadtxt(case.case.folder / "flow_map.csv", delimiter=",", skiprows=1)[:, 2]
    true = metered_map(case.axis, (), SEED)["q_m_kg_per_s"]
    assert 0.001 < abs(q @ true / (true @ true) - 1) < 0.03
    assert case.case.bench.valves.P.accuracy == 0.01


def test_one_valve_has_one_command(made):
    case = made(arrangement=Arrangement.ONE_5_3).case
    with gzip.open(case.folder / "identify.csv.gz", "rt") as file:
        header = file.readline().strip().split(",")
    assert "u_V" in header and "u_P_V" not in header
    assert np.array_equal(case.identify[0]["u_N"], -case.identify[0]["u_P"])


def test_stamps_with_jitter_and_gaps_are_those_of_the_samples(made):
    case = made(jitter=0.1, gaps=((1.0, 1.2),)).case
    assert case.bench.clock is Clock.AS_RECORDED and len(case.identify) == 2
    steps = np.concatenate([np.diff(record.t) for record in case.identify])
    assert steps.std() == pytest.approx(0.1e-3 * np.sqrt(2), rel=0.1)
    assert read_case(case.folder).identify[0].N == case.identify[0].N  # it passes the checks


def test_what_nobody_knows_is_not_in_the_folder(made):
    case = made(controller=NoController(), reference=False, source=FlowSource.NONE).case
    assert "x_ref" not in case.identify[0] and not case.bench.controller.closes_loop
    assert sorted(path.name for path in case.folder.iterdir()) == [
        "bench.json",
        "identify.csv.gz",
        "validate.csv.gz",
    ]


def test_a_data_sheet_is_off_by_what_it_is_said_to_be(made):
    case = made(source=FlowSource.DATA_SHEET, data_sheet_error=0.3)
    valve, stated = case.axis.valve, case.case.bench.valves.P
    assert stated.C_fill == pytest.approx(0.7 * (valve.k_supply * 5.0 + valve.leak_supply))
    assert stated.b == pytest.approx(1.3 * (valve.b_supply + valve.b_exhaust) / 2)


def test_the_moving_mass_alone_has_pressures_for_inputs(made):
    case = made(pressures=True, double_rod=True).case
    assert isinstance(case.bench, PressureBench) and case.bench.S_P == case.bench.S_N
    assert set(case.identify[0].names) == {"p_P", "p_N", "x"}
    assert case.identify[0].hold is InputHold.LINEAR  # pressures are measured, not commanded


def test_a_usual_laboratory_records_what_it_always_did(tmp_path):
    first = make_case(tmp_path / "a", SEED, duration=1.0).case.identify[0]
    again = make_case(
        tmp_path / "b", SEED, duration=1.0, laboratory=Laboratory(), axis=random_axis(SEED)
    ).case.identify[0]
    assert all(np.array_equal(first[name], again[name]) for name in first.names)


@pytest.mark.slow
def test_weak_effects_are_drawn_among_those_that_the_laboratory_can_record(tmp_path):
    laboratory = Laboratory(jitter=0.1, supply=True)
    for seed in range(6):
        case = make_case(
            tmp_path / f"{seed}",
            seed,
            fs=250.0,
            duration=0.5,
            laboratory=laboratory,
            background=True,
        )
        drawn = {effect["name"] for effect in case.labels["background"]}
        assert drawn and not drawn & {"position_delay", "supply_droop"}
