"""Controllers with a memory against laws typed out in NumPy, sample by sample."""

import json
import pickle
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.data import (
    Arrangement,
    CascadeController,
    CustomController,
    NoController,
    PidController,
    ProportionalController,
)
from pneumo_casadi.data.bench.bench_file import bench_content, bench_from_content
from pneumo_casadi.data.control.law import ControlLaw
from pneumo_casadi.data.control.memory import memory_at_start, unexplained_share
from pneumo_casadi.errors import CaseError, ModelError

DT = 1e-3
N = 1500


def path(seed=0):
    """Reference and position that drive a law of some V/m into its limits and out again."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    x_ref = 0.2 * np.sign(np.sin(7 * t)) + 0.05 * np.sin(31 * t)
    x = 0.15 * np.sin(7 * t - 0.8) + 1e-4 * rng.standard_normal(N)
    return x_ref, x


def windup(kind, T, tracking):
    """One sample of an integrator with its limits: (demand before it, increment, state) -> u."""

    def apply(direct, integral, increment, low, high):
        wanted = direct + integral + increment
        u = min(max(wanted, low), high)
        if kind == "clamping" and (
            (wanted > high and increment > 0) or (wanted < low and increment < 0)
        ):
            return u, integral
        if kind == "back-calculation":
            return u, integral + increment + T / tracking * (u - wanted)
        return u, integral + increment

    return apply


def pid_by_hand(x_ref, x, gains, limits, anti, rows, integral, d, e_before):
    k_p, k_i, k_d, tau = gains
    T, u, held = rows * DT, np.empty(N), 0.0
    apply = windup(anti[0], T, anti[1])
    for k in range(N):
        if k % rows == 0:
            e = x_ref[k] - x[k]
            d = (tau * d + e - e_before) / (tau + T)
            held, integral = apply(k_p * e + k_d * d, integral, k_i * T * e, *limits)
            e_before = e
        u[k] = held
    return u


def cascade_by_hand(x_ref, x, gains, limits, v_max, anti, rows, integral, v, x_before):
    k_p, k_v, k_i, tau = gains
    T, u, held = rows * DT, np.empty(N), 0.0
    apply = windup(anti[0], T, anti[1])
    for k in range(N):
        if k % rows == 0:
            v = (tau * v + x[k] - x_before) / (tau + T)
            e = min(max(k_p * (x_ref[k] - x[k]), -v_max), v_max) - v
            held, integral = apply(k_v * e, integral, k_i * T * e, *limits)
            x_before = x[k]
        u[k] = held
    return u


KINDS = [("none", None), ("clamping", None), ("back-calculation", 0.05)]


@pytest.mark.parametrize("anti", KINDS)
@pytest.mark.parametrize("rows", [1, 4])
def test_a_pid_law_is_that_typed_out(anti, rows):
    x_ref, x = path()
    controller = PidController(
        k_p=20.0,
        u_max=4.0,
        k_i=60.0,
        k_d=0.3,
        derivative_filter=5e-3,
        u_min=-3.0,
        u_0=0.1,
        anti_windup=anti[0],
        tracking_time=anti[1],
        sample_time=rows * DT if rows > 1 else None,
    )
    law = ControlLaw(controller, DT)
    u, _ = law.replay(x_ref, x, law.rest(x_ref[0], x[0], 0.5))
    e_before = x_ref[0] - x[0] + 0.5 * law.period
    hand = pid_by_hand(
        x_ref, x, (20.0, 60.0, 0.3, 5e-3), (-3.0, 4.0), anti, rows, 0.0, -0.5, e_before
    )
    np.testing.assert_allclose(u, [0.1 + hand, 0.1 - hand], atol=1e-11)
    assert hand.max() == 4.0 and hand.min() == -3.0 and np.ptp(np.diff(hand)) > 0.1


@pytest.mark.parametrize("anti", KINDS)
@pytest.mark.parametrize("rows", [1, 5])
def test_a_cascade_is_that_typed_out(anti, rows):
    x_ref, x = path(1)
    controller = CascadeController(
        k_p=10.0,
        k_v=1.5,
        u_max=1.2,
        k_i=12.0,
        velocity_filter=8e-3,
        v_max=1.2,
        anti_windup=anti[0],
        tracking_time=anti[1],
        sample_time=rows * DT if rows > 1 else None,
    )
    law = ControlLaw(controller, DT, Arrangement.ONE_5_3)
    u, _ = law.replay(x_ref, x, law.rest(x_ref[0], x[0], -0.2))
    x_before = x[0] + 0.2 * law.period
    hand = cascade_by_hand(
        x_ref, x, (10.0, 1.5, 12.0, 8e-3), (-1.2, 1.2), 1.2, anti, rows, 0.0, -0.2, x_before
    )
    np.testing.assert_allclose(u, [hand, -hand], atol=1e-11)
    assert hand.max() == 1.2 and hand.min() == -1.2


def test_anti_windup_tells_the_laws_apart():
    x_ref, x = path()
    base = PidController(k_p=20.0, u_max=4.0, k_i=60.0)
    clamped = replace(base, anti_windup="clamping")
    back = replace(base, anti_windup="back-calculation", tracking_time=0.02)
    runs = [
        law.replay(x_ref, x, law.rest(0.0, 0.0, 0.0))[0][0]
        for law in (ControlLaw(c, DT) for c in (base, clamped, back))
    ]
    assert min(np.abs(a - b).max() for a, b in pairwise(runs)) > 0.5


def test_the_null_voltage_of_one_valve_reaches_both_chambers_with_its_sign():
    controller = ProportionalController(gain=2.0, u_max=5.0, u_0=0.3)
    for arrangement, expected in ((Arrangement.TWO_3_2, 0.1), (Arrangement.ONE_5_3, -0.5)):
        u, _ = ControlLaw(controller, DT, arrangement).replay([0.1], [0.0], np.zeros(0))
        np.testing.assert_allclose(u[:, 0], [0.5, expected])
    np.testing.assert_allclose(controller.command(0.1, 0.0), [0.5, 0.1])


@pytest.mark.parametrize("rows", [1, 5])
@pytest.mark.parametrize("first", [0, 3])
def test_the_memory_at_the_start_is_that_with_which_the_commands_follow(rows, first):
    x_ref, x = path()
    sample_time = rows * DT if rows > 1 else None
    controller = PidController(
        20.0, 4.0, k_i=60.0, k_d=0.3, derivative_filter=0.01, sample_time=sample_time
    )
    law = ControlLaw(controller, DT)
    u, memory = law.replay(x_ref, x, law.rest(x_ref[0], x[0], 0.0))
    begin = 400 + first
    found = memory_at_start(law, x_ref[begin:], x[begin:], u[:, begin:], 0.0)
    again, _ = law.replay(x_ref[begin:], x[begin:], found)
    np.testing.assert_allclose(again, u[:, begin:], atol=1e-9)
    assert found[0] == pytest.approx(memory[0, begin], abs=1e-9)


def test_what_a_law_leaves_unexplained_tells_the_right_gains():
    x_ref, x = path()
    controller = PidController(8.0, 4.0, k_i=20.0)
    law = ControlLaw(controller, DT)
    u, _ = law.replay(x_ref, x, np.array([0.2, 0.0]))
    assert unexplained_share(law, x_ref, x, u) < 1e-9
    other = ControlLaw(replace(controller, k_p=6.0), DT)
    assert 0.1 < unexplained_share(other, x_ref, x, u) < 0.5


CONTROLLERS = [
    ProportionalController(2.4, 5.0, u_0=0.05, sample_time=0.005),
    PidController(20.0, 5.0, 4.0, 0.3, 0.01, -4.0, 0.1, "back-calculation", 0.2, 0.002),
    PidController(20.0, 5.0),
    CascadeController(8.0, 2.0, 5.0, 3.0, 0.005, 1.0, anti_windup="clamping"),
]


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_controller_survives_the_file_and_pickling(bench, controller):
    stated = replace(bench, controller=controller)
    content = json.loads(json.dumps(bench_content(stated)))
    assert bench_from_content(content) == stated
    assert pickle.loads(pickle.dumps(stated)) == stated


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"k_p_V_per_m": 0}, "`controller.k_p_V_per_m`: 0 V/m closes no loop"),
        ({"u_min_V": 6}, "`controller.u_min_V`: 6 V is not below u_max = 5 V"),
        ({"anti_windup": "yes"}, "`controller.anti_windup`: got 'yes'; write 'none' or"),
        (
            {"anti_windup": "back-calculation"},
            "`controller.tracking_time_s`: back-calculation needs it",
        ),
        ({"tracking_time_s": 0.1}, "other kinds of anti-windup do not use it"),
        (
            {"sample_time_s": 0.0015},
            r"`controller.sample_time_s`: 0\.0015 s is no whole multiple of the record's step",
        ),
        ({"sample_time_s": -1}, "`controller.sample_time_s`: expected at least 1e-06 s"),
        ({"derivative_filter_s": -1}, "`controller.derivative_filter_s`: expected at least 0 s"),
        ({"k_i": 1}, "unknown key `controller.k_i`; known are .*k_i_V_per_m_s"),
    ],
)
def test_a_section_with_a_fault_is_named(bench, section, message):
    controller = {"type": "pid", "k_p_V_per_m": 20, "u_max_V": 5} | section
    with pytest.raises(CaseError, match=message):
        bench_from_content(bench_content(bench) | {"controller": controller})


def test_of_another_law_it_is_told_what_to_state(bench):
    controller = {"type": "cascade", "speed_gain": 0.6, "u_max_V": 5}
    with pytest.raises(
        CaseError, match=r'missing key .*speed_gain`; of any other law state `"type"'
    ):
        bench_from_content(bench_content(bench) | {"controller": controller})


def lag(memory, x_ref, x):
    kept = 0.9 * memory + 0.1 * (x_ref - x)
    return ca.vertcat(20 * kept, -20 * kept), kept


@pytest.mark.parametrize("as_function", [False, True])
def test_a_law_of_ones_own_is_used_pickled_and_not_written(bench, as_function):
    law = lag
    if as_function:
        m, r, x = ca.SX.sym("m"), ca.SX.sym("r"), ca.SX.sym("x")
        law = ca.Function("lag", [m, r, x], list(lag(m, r, x)))
    controller = pickle.loads(pickle.dumps(CustomController(law, memory=[0.5])))
    on_clock = ControlLaw(controller, DT)
    u, memory = on_clock.replay([0.1, 0.1], [0.0, 0.0], on_clock.rest(0.0, 0.0, 0.0))
    np.testing.assert_allclose(u, [[9.2, 8.48], [-9.2, -8.48]])
    np.testing.assert_allclose(memory, [[0.5, 0.46]])
    content = bench_content(replace(bench, controller=controller))
    assert bench_from_content(content).controller == NoController()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda memory, x_ref, x: (x, memory), "it returns 1 commands and 1 values of memory"),
        (lambda memory, x_ref: x_ref, "TypeError: .*it is called with CasADi symbols"),
    ],
)
def test_a_law_of_ones_own_of_another_shape_is_refused(law, message):
    with pytest.raises(CaseError, match=message):
        CustomController(law, memory=[0.0])


def test_no_controller_has_no_law():
    with pytest.raises(ModelError, match="no controller is known"):
        ControlLaw(NoController(), DT)
