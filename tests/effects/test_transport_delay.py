"""Delays of flows and commands, hoses of two lengths, and lips that seal one way."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneumo_casadi.effects import (
    EFFECTS,
    HosePerChamber,
    HoseTravelTimePerChamber,
    PistonSealLeakagePerDirection,
    SupplyDroop,
)
from pneumo_casadi.effects.common.reservoir import FASTEST
from pneumo_casadi.effects.lags.transport_delay import (
    delay_rates,
    delay_rest,
    delay_states,
    delayed,
)
from pneumo_casadi.model.junctions import Pair

P = (4e5, 5e5)


def passed(value, delays, times):
    """What arrives at P and N of a value at some times (n, 2), begun at rest."""
    names = [state.name for state in delay_states("V", "V/s", 1.0)]
    rest = delay_rest(Pair(value(0.0), value(0.0)))

    def at(z):
        return dict(zip(names, z, strict=True))

    def rates(t, z):
        of = delay_rates(Pair(value(t), value(t)), delays, at(z))
        return [of[name] for name in names]

    start = [rest[name] for name in names]
    run = solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, max_step=2e-3)
    pairs = zip(times, run.y.T, strict=True)
    return np.array([delayed(Pair(value(t), value(t)), delays, at(z)) for t, z in pairs])


@pytest.mark.parametrize(("T", "f"), [(0.0, 30.0), (2e-3, 50.0), (0.01, 50.0), (0.025, 28.0)])
def test_a_swing_arrives_later_by_the_delay_and_as_large(T, f):
    def swing(t):
        return np.sin(2 * np.pi * f * t)

    times = np.linspace(0.2, 0.2 + 1 / f, 9)
    arrived = passed(swing, (T, 0.0), times)
    np.testing.assert_allclose(arrived[:, 0], swing(times - T), atol=0.15)
    np.testing.assert_allclose(arrived[:, 1], swing(times), atol=1e-3)  # no delay, regularly


def test_a_step_of_the_command_is_felt_after_the_dead_time():
    early, late = passed(lambda t: float(t > 1e-9), (0.02, 0.02), np.array([0.012, 0.03]))[:, 0]
    assert abs(early) < 0.3 and late == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("p", "expected"), [((6e5, 4e5), (-1, 1)), ((4e5, 6e5), (0, 0))])
def test_a_lip_that_seals_one_way_leaks_the_other(made, p, expected):
    plain, axis = made.true_axis(), made.true_axis(PistonSealLeakagePerDirection())
    axis = axis.with_parameters({"piston_seal_leakage_per_direction.C_P": 1e-9})
    u, state = [1.0, -1.0], [*p, 0.0, 0.0]
    rates = [a.rhs(state, u, a.parameters.values).full().ravel() for a in (axis, plain)]
    assert tuple(np.sign(rates[0] - rates[1])[:2].astype(int)) == expected


def test_a_hose_that_is_missing_leaves_its_chamber_alone(made):
    sizes = {"R": 5e9, "zeta": 0.1, "V": 3e-5}
    axis = made.true_axis(HosePerChamber())
    values = {"delay_P": 8e-3, "delay_N": 0.0, **sizes}
    axis = axis.with_parameters({f"hose_per_chamber.{k}": v for k, v in values.items()})
    theta, state = axis.parameters.values, [*P, 0.0, 0.0]
    full = axis.rest(state, [0.0, 0.0], theta).full().ravel()
    change = axis.rhs(full, [2.0, -2.0], theta).full() - axis.rhs(full, [0.0, 0.0], theta).full()
    plain = made.true_axis()
    at = plain.parameters.values
    moved = plain.rhs(state, [2.0, -2.0], at).full() - plain.rhs(state, [0.0, 0.0], at).full()
    assert change[1] == pytest.approx(moved[1], rel=1e-9)
    assert abs(change[0]) < 0.1 * abs(moved[0])  # the flow is under way


def test_of_two_hoses_the_longer_one_takes_more_pressure(made):
    """R and V are those of the mean length: with one hose missing, the other has twice of them."""
    q, p = 2e-3, [*P, 0.0, 0.0]
    both, one = made.true_axis(EFFECTS["hose"]()), made.true_axis(HosePerChamber())
    sizes = {"zeta": 0.1, "delay": 8e-3, "R": 1e10, "V": 6e-5}
    both = both.with_parameters({f"hose.{k}": v for k, v in sizes.items()})
    sizes = {"zeta": 0.1, "delay_P": 8e-3, "delay_N": 0.0, "R": 5e9, "V": 3e-5}
    one = one.with_parameters({f"hose_per_chamber.{k}": v for k, v in sizes.items()})
    rates = []
    for axis in (both, one):
        full = axis.rest(p, [2.0, -2.0], axis.parameters.values).full().ravel()
        full[[axis.states.index(n) for n in axis.states if n.endswith(("q_P", "q_2_P"))]] = q
        rates.append(axis.rhs(full, [2.0, -2.0], axis.parameters.values).full().ravel())
    assert rates[1][0] == pytest.approx(rates[0][0], rel=1e-9)


def test_of_two_travel_times_the_longest_is_asked_to_be_a_hose():
    of = HoseTravelTimePerChamber.credible_at
    assert list(of({"T_P": 0.0, "T_N": 4e-3})) == ["T_N"]
    assert of({"T_P": 2e-4, "T_N": 0.0})["T_P"][0] == 1e-3


@pytest.mark.parametrize("name", ["hose_volume", "hose_sensor_at_valve"])
def test_a_narrow_hose_may_be_small(name):
    """That of a cylinder of 16 mm bore has 5 ml, and was refused as a blend of two axes."""
    of = EFFECTS[name].credible_at
    assert of({"V": 4.8e-6, "C": 3.3e-10})["V"][0] < 4e-7
    assert of({"V": 4.8e-6, "C": 6e-9})["V"][0] == pytest.approx(3e-6)


def test_a_supply_without_a_reservoir_droops_at_once_and_is_not_stiff(made):
    effect = SupplyDroop()
    for C in (5e-10, 5e-8):
        axis = made.true_axis(effect)
        values = {"per_volume": 1e6, "C": C, "C_leak": 0.0}
        axis = axis.with_parameters({f"supply_droop.{k}": v for k, v in values.items()})
        x = [*P, 0.0, 0.0, 1e3]
        J = axis.rhs.jacobian()(x, [1.0, -1.0], axis.parameters.values, 0)[0].full()
        assert -1.5 / FASTEST < J[4, 4] < -100.0
