"""The air obeys its laws: mass, energy, choking, against equations typed out here."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pneumo_casadi.effects import (
    ExhaustRestriction,
    HeatTransfer,
    HeatTransferForced,
    Hose,
    HoseSensorAtValve,
    LeakageN,
    LeakageP,
    PistonSealLeakage,
    PistonSealLeakageScored,
    SupplyDroop,
    SupplyDroopProportional,
)
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.valve import fit_iso6358, orifice_flow

P_SUPPLY, P_EXT, T_0, R_AIR = 7e5, 1e5, 293.15, 287.0
GAMMA = 1.4
U, CLOSED = [1.5, -1.0], [0.0, 0.0]


def rates(axis, x, u=CLOSED):
    return axis.rhs(x, u, axis.parameters.values).full().ravel()


def stored_rate(axis, x, u=CLOSED, dx=None):
    """Mass flow into each chamber that the rates of the pressures imply [kg/s]."""
    p, dp = axis.parameters, rates(axis, x, u) if dx is None else dx
    X = [p[f"X_s{i}"].value for i in range(1, 7)]
    return np.array(
        [
            (X[0] + X[1] * x[2]) * dp[0] + X[2] * x[0] * x[3],
            (X[3] - X[4] * x[2]) * dp[1] - X[5] * x[1] * x[3],
        ]
    )


def started(made, effect, **values):
    axis = made.true_axis(effect).at_starting_values()
    return axis.with_parameters({f"{effect.name}.{name}": v for name, v in values.items()})


@pytest.mark.parametrize("p", [(6e5, 2e5), (3e5, 5e5), (4e5, 4e5), (4.01e5, 4e5)])
def test_what_leaves_one_chamber_past_the_piston_arrives_in_the_other(made, p):
    axis, x = started(made, PistonSealLeakage()), [*p, 0.05, 0.3]
    leak = stored_rate(axis, x) - stored_rate(made.true_axis(), x)
    assert leak.sum() == pytest.approx(0.0, abs=1e-15)
    assert np.sign(leak[1]) == np.sign(p[0] - p[1])


@pytest.mark.parametrize(("effect", "chamber"), [(LeakageP(), 0), (LeakageN(), 1)])
def test_a_leak_empties_its_chamber_alone_and_is_choked_far_above_the_outside(
    made, effect, chamber
):
    axis, nominal, C = started(made, effect), made.true_axis(), 3e-10
    for p in (2e5, 4e5, 6e5):
        x = [p, p, 0.0, 0.0]
        leak = stored_rate(axis, x) - stored_rate(nominal, x)
        assert leak[1 - chamber] == 0.0
        assert leak[chamber] == pytest.approx(-float(orifice_flow(C, 0.4, 0.5, p, P_EXT, T_0)))
        if p > P_EXT / 0.4:  # choked: C ρ₀ p, whatever is outside
            assert leak[chamber] == pytest.approx(-C * 1.185 * p, rel=1e-9)
    x = [P_EXT, P_EXT, 0.0, 0.0]
    np.testing.assert_allclose(stored_rate(axis, x), stored_rate(nominal, x), atol=1e-18)


def test_a_scored_tube_leaks_where_the_piston_passes_the_score(made):
    name, C = "piston_seal_leakage_scored", 3e-10
    axis = made.true_axis(PistonSealLeakageScored()).with_parameters(
        {f"{name}.C": C, f"{name}.s": 0.05, f"{name}.w": 0.1}
    )
    whole = float(orifice_flow(C, 0.4, 0.5, 6e5, 3e5, T_0))
    for s, share in ((0.05, 1.0), (0.15, np.exp(-1)), (-0.05, np.exp(-1)), (0.4, 0.0)):
        at = [6e5, 3e5, s * made.BENCH.stroke, 0.0]
        leak = stored_rate(axis, at) - stored_rate(made.true_axis(), at)
        np.testing.assert_allclose(leak, [-share * whole, share * whole], rtol=1e-6, atol=1e-12)


def test_leaks_join_the_regression_because_they_are_linear(made):
    axis = started(made, LeakageP()).with_effects(LeakageN(), PistonSealLeakage())
    names = [f"{name}.C" for name in ("leakage_P", "leakage_N", "piston_seal_leakage")]
    assert axis.regressor_names[-3:] == tuple(names)
    x = [6e5, 3e5, 0.1, 0.2]
    _, W = axis.regressor()(x, [0.0] * 4, U)
    leaks = {"P": orifice_flow(1.0, 0.4, 0.5, x[0], P_EXT, T_0)}
    leaks["N"] = orifice_flow(1.0, 0.4, 0.5, x[1], P_EXT, T_0)
    leaks["PN"] = orifice_flow(1.0, 0.4, 0.5, x[0], x[1], T_0)
    wanted = [[leaks["P"], 0.0, leaks["PN"]], [0.0, leaks["N"], -leaks["PN"]], [0.0] * 3]
    np.testing.assert_allclose(W.full()[:, -3:], wanted, rtol=1e-9)


@pytest.fixture
def thermal(made):
    """Make an axis whose X_s are those of given volumes and the adiabatic exponent."""

    def build(h, sealed=False):
        V_P, V_N, S_P, S_N = 2.9e-4, 2.0e-4, made.BENCH.S_P, made.BENCH.S_N
        axis = made.true_axis(HeatTransfer())
        rT = R_AIR * T_0
        X = [V_P / GAMMA, S_P / GAMMA, S_P, V_N / GAMMA, S_N / GAMMA, S_N]
        values = {f"X_s{i + 1}": value / rT for i, value in enumerate(X)}
        values |= {"heat_transfer.share": 1.0, "heat_transfer.h": h, "M": 5.0}
        if sealed:
            values |= dict.fromkeys(axis.flow.parameters.names, 0.0)
        axis = axis.with_parameters(axis.parameters.bounded("heat_transfer.h", 0.0, 1e7))
        axis = axis.with_parameters(values)
        return axis, SimpleNamespace(V_P=V_P, V_N=V_N, S_P=S_P, S_N=S_N)

    return build


def run(f, x_0, seconds):
    t = np.linspace(0.0, seconds, 41)
    solution = solve_ivp(f, (0.0, seconds), x_0, "LSODA", t, rtol=1e-9, atol=1e-10)
    assert solution.success
    return solution.y


def simulated(axis, x_0, u, seconds):
    theta = axis.parameters.values
    full = axis.rest(x_0, u, theta).full().ravel()
    return run(lambda t, x: axis.rhs(x, u, theta).full().ravel(), full, seconds)


def test_heat_transfer_is_the_mass_and_energy_balance_of_both_chambers(made, thermal):
    """Against states of its own: mass and internal energy, integrated by SciPy."""
    h = 80.0
    axis, g = thermal(h)
    p, flow = axis.parameters.as_dict(), axis.flow
    c_v = R_AIR / (GAMMA - 1)
    c_p = GAMMA * c_v

    def gas(m, E, V, S, command):
        T, pressure = E / (m * c_v), (GAMMA - 1) * E / V
        q = float(flow(command, pressure))
        q_out = max(-q, 0.0) * np.sqrt(T_0 / T)
        q_in = max(q, 0.0)
        wall = 2 * S + 2 * np.sqrt(np.pi * S) * V / S
        power = c_p * (T_0 * q_in - T * q_out) + h * wall * (T_0 - T)
        return pressure, T, q_in - q_out, power

    def derivative(t, z):
        m_P, E_P, m_N, E_N, x, v = z
        p_P, _, dm_P, power_P = gas(m_P, E_P, g.V_P + g.S_P * x, g.S_P, U[0])
        p_N, _, dm_N, power_N = gas(m_N, E_N, g.V_N - g.S_N * x, g.S_N, U[1])
        s = np.tanh(v / p["v_s"])
        friction = p["f_v"] * v + p["F_c_plus"] * (1 + s) / 2 - p["F_c_minus"] * (1 - s) / 2
        F = g.S_P * p_P - g.S_N * p_N - (g.S_P - g.S_N) * P_EXT - friction
        return [dm_P, power_P - p_P * g.S_P * v, dm_N, power_N + p_N * g.S_N * v, v, F / p["M"]]

    p_0 = (3e5, 4e5)
    mass = [p_0[0] * g.V_P / (R_AIR * T_0), p_0[1] * g.V_N / (R_AIR * T_0)]
    start = [mass[0], mass[0] * c_v * T_0, mass[1], mass[1] * c_v * T_0, 0.0, 0.0]
    m_P, E_P, m_N, E_N, x, v = run(derivative, start, 0.3)
    result = simulated(axis, [*p_0, 0.0, 0.0], U, 0.3)
    own = [(GAMMA - 1) * E_P / (g.V_P + g.S_P * x), (GAMMA - 1) * E_N / (g.V_N - g.S_N * x), x, v]
    own += [E_P / (m_P * c_v) - T_0, E_N / (m_N * c_v) - T_0]
    assert np.ptp(own[4]) > 10, "the air hardly warms: nothing is tested"
    for computed, expected in zip(result, own, strict=True):
        np.testing.assert_allclose(
            computed, expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max()
        )


@pytest.mark.parametrize(("h", "k"), [(0.0, GAMMA), (1e6, 1.0)])
def test_a_sealed_chamber_is_adiabatic_without_exchange_and_isothermal_with_much(thermal, h, k):
    axis, g = thermal(h, sealed=True)
    p_P, p_N, x, _, dT_P, _ = simulated(axis, [4e5, 4e5, 0.0, 1.5], CLOSED, 0.2)
    for p, V in ((p_P, g.V_P + g.S_P * x), (p_N, g.V_N - g.S_N * x)):
        assert np.ptp(V) / V[0] > 0.1
        np.testing.assert_allclose(p * V**k, p[0] * V[0] ** k, rtol=2e-3 if h else 1e-6)
        if not h:
            np.testing.assert_allclose((p * V)[-1] / (p * V)[0], 1 + _warmth(p, V), rtol=1e-6)
    assert np.abs(dT_P).max() < 0.2 if h else np.abs(dT_P).max() > 5.0


def _warmth(p, V):
    """Relative rise of temperature that the adiabatic law gives."""
    return (V[0] / V[-1]) ** (GAMMA - 1) - 1


def iso_axis(made, effect, **values):
    axis = made.true_axis(effect, flow=fit_iso6358(made.smooth_map(), T=T_0))
    return axis.with_parameters({f"{effect.name}.{name}": v for name, v in values.items()})


def through_valves(axis, x, u):
    return axis.valve_flow(x, u, axis.parameters.values).full().ravel()


def test_an_exhaust_restriction_is_not_felt_while_the_valve_is_choked(made):
    axis = iso_axis(made, ExhaustRestriction(), R=5e8)
    for p, felt in ((6e5, False), (1.6e5, True)):
        free, held = (through_valves(axis, [p, p, 0, 0, b], [-2, 0]) for b in (0.0, 5e4))
        if felt:
            assert 0.3 < held[0] / free[0] < 0.97
        else:
            assert held[0] == pytest.approx(free[0], rel=1e-6)


def test_the_silencer_passes_what_the_valves_let_out_at_darcys_pressure(made):
    axis = iso_axis(made, ExhaustRestriction(), R=5e8)
    x, u = [5e5, 5e5, 0.0, 0.0, 0.0], [-2.0, 0.5]
    q = through_valves(axis, x, u)
    assert q[0] < 0 < q[1]
    back = np.sqrt(P_EXT**2 + 2 * R_AIR * T_0 * 5e8 * q[0] ** 2) - P_EXT
    assert back > 1e3
    assert rates(axis, x, u)[-1] == pytest.approx(back / 2e-3)
    assert rates(axis, [*x[:4], back], u)[-1] == pytest.approx(0.0, abs=1e-3 * back / 2e-3)
    low = [1.2 * P_EXT, 5e5, 0.0, 0.0]  # below the back pressure the flow turns round
    assert through_valves(axis, [*low, 0.0], u)[0] < 0 < through_valves(axis, [*low, 5e4], u)[0]


def leaked(C, d=0.0, back=0.0):
    """Return what the valves pass from supply to exhaust at a droop and a back pressure."""
    return float(orifice_flow(C, 0.3, 0.5, P_SUPPLY - d, P_EXT + back, T_0, 0.95))


def test_the_silencer_passes_internal_leakage_too_which_never_exceeds_the_supply(made):
    """Its back pressure is that of all flow; the leak falls as it rises, and turns round."""
    R, C = 5e11, 1e-9
    axis = iso_axis(made, ExhaustRestriction(), R=R, C_leak=C, tau=0.02)
    x, u = [5e5, 5e5, 0.0, 0.0], [-2.0, 0.5]
    for back in (0.0, 3e4, 4e5):
        out = leaked(C, back=back) - min(through_valves(axis, [*x, back], u)[0], 0.0)
        raised = np.sqrt(P_EXT**2 + 2 * R_AIR * T_0 * R * out**2) - P_EXT
        assert rates(axis, [*x, back], u)[-1] == pytest.approx((raised - back) / 0.02)
    clogged = iso_axis(made, ExhaustRestriction(), R=1e13, C_leak=3e-9, tau=0.02)
    assert rates(clogged, [*x, P_SUPPLY - P_EXT], u)[-1] < 0


def test_the_reservoir_gains_what_the_regulator_gives_and_loses_what_the_valves_draw(made):
    """Mass at one temperature: V ṗ/(r T) is the net flow."""
    V, C, C_l = 1e-3, 5e-9, 3e-10
    axis = started(made, SupplyDroop(), per_volume=1 / V, C=C, C_leak=C_l)
    for d in (0.0, 2e4, 1.5e5):
        x = [3e5, 3e5, 0.0, 0.0, d]
        for u in ([2.0, 1.0], [2.0, -1.0]):
            drawn = leaked(C_l, d) + np.maximum(through_valves(axis, x, u), 0.0).sum()
            given = float(orifice_flow(C, 0.3, 0.5, P_SUPPLY, P_SUPPLY - d, T_0, 0.95))
            lost = V / (R_AIR * T_0) * rates(axis, x, u)[-1]
            assert lost == pytest.approx(drawn - given, rel=1e-9, abs=1e-15)
    still = rates(axis, [P_SUPPLY, P_SUPPLY, 0.0, 0.0, 0.0])
    assert V / (R_AIR * T_0) * still[-1] == pytest.approx(leaked(C_l), rel=1e-4)


def test_a_regulator_in_proportion_gives_its_slope_times_the_droop(made):
    V, G, C_l, u = 1e-3, 3e-8, 3e-10, [2.0, 1.0]
    axis = started(made, SupplyDroopProportional(), per_volume=1 / V, G=G, C_leak=C_l)
    for d in (0.0, 2e4, 1.5e5):
        x = [3e5, 3e5, 0.0, 0.0, d]
        drawn = leaked(C_l, d) + np.maximum(through_valves(axis, x, u), 0.0).sum()
        lost = V / (R_AIR * T_0) * rates(axis, x, u)[-1]
        assert lost == pytest.approx(drawn - G * d, rel=1e-9)


def response(axis, x, u, output=0):
    """Static gain and delay from u_P to the rate of a pressure, over the effect's states."""
    n = 4
    J = axis.rhs.jacobian()(x, u, axis.parameters.values, 0)
    by_x, by_u = J[0].full(), J[1].full()
    A, b = by_x[n:, n:], by_u[n:, 0]
    c, d = by_x[output, n:], by_u[output, 0]
    inner = np.linalg.solve(A, b)
    static = d - c @ inner
    return static, c @ np.linalg.solve(A, inner) / static


def swings_of(axis, x):
    """Poles of a hose's states, those of chamber P and N, (2, 4)."""
    by_x = axis.rhs.jacobian()(at_rest(axis, x), U, axis.parameters.values, 0)[0].full()
    return np.stack([np.linalg.eigvals(by_x[i : i + 4, i : i + 4]) for i in (4, 8)])


def test_a_hose_rings_and_loses_no_flow(made):
    x = [3e5, 4e5, 0.0, 0.0]
    nominal = made.true_axis()
    static, _ = response(nominal.with_effects(Hose()), at_rest(nominal.with_effects(Hose()), x), U)
    for delay, zeta in ((1e-4, 0.1), (2e-3, 0.02), (2e-2, 0.4)):
        axis = started(made, Hose(), R=0.0, delay=delay, zeta=zeta, V=0.0)
        full = at_rest(axis, x)
        np.testing.assert_allclose(rates(axis, full, U)[:4], rates(nominal, x, U), rtol=1e-12)
        np.testing.assert_allclose(rates(axis, full, U)[4:], 0.0, atol=1e-12)
        gain, lag = response(axis, full, U)
        # What is under way is the delay of a slow flow times the flow: 2 ζ (m - n) = 2 ζ D, and
        # a ninth of it in the second mode.
        assert lag == pytest.approx(2 * zeta * delay * (1 + 1 / 9), rel=1e-9)
        assert gain == pytest.approx(static, rel=1e-9)
        for wave in (1, 3):
            m = delay / wave + 1e-6 / (1e-3 + delay / wave)
            poles = np.roots([m**2, 2 * zeta / wave * m, 1.0])
            for swings in swings_of(axis, x):
                far = np.abs(swings[:, None] - poles).min(axis=0)
                np.testing.assert_allclose(far * m, 0.0, atol=1e-6)


@pytest.fixture
def waves(made):
    """Make a hose before chamber P at mid-stroke, and q_v = p (sinh γ/Z + cosh γ s C) of its waves.

    The second is a function of s: q_v over s p times the capacity of chamber and hose.
    """

    def build(bore, length=3.0):
        bench, rT = made.BENCH, R_AIR * T_0
        V, sound = np.pi * bore**2 / 4 * length, length / np.sqrt(rT)
        C_c, C_l = 1.2 * bench.S_P * bench.stroke / 2 / rT, V / rT

        def entering(s):
            taken = np.sinh(s * sound) * C_l / sound + s * C_c * np.cosh(s * sound)
            return taken / (s * (C_c + C_l))

        axis = started(made, Hose(), R=0.0, delay=2 / np.pi * sound, zeta=0.005, V=V)
        return axis, entering, sound

    return build


@pytest.mark.parametrize("bore", [2e-3, 4e-3, 6e-3, 9e-3, 14e-3, 20e-3])
def test_a_hose_rings_as_the_waves_along_it_do_before_any_chamber(waves, bore):
    axis, entering, sound = waves(bore)
    rings = np.sort(np.abs(swings_of(axis, [3e5, 4e5, 0.0, 0.0])[0]))[::2]
    for ring, between in zip(rings, ((1.57, 3.14), (4.71, 6.28)), strict=True):
        pole = brentq(lambda w: entering(1j * w).real, *(f / sound for f in between))
        n = 1e-6 / (1e-3 + 1 / ring)  # the numerator makes it slower
        assert 1 / (1 / ring - n) == pytest.approx(pole, rel=0.04)


def test_below_its_resonance_a_hose_passes_what_the_waves_pass(waves):
    axis, entering, _ = waves(6e-3)
    x = [3e5, 4e5, 0.0, 0.0]
    first = np.abs(swings_of(axis, x)[0]).min()
    for share, tolerance in ((0.2, 0.02), (0.4, 0.05), (0.6, 0.12)):
        s = 1j * share * first
        assert abs(transfer(axis, at_rest(axis, x), s) * entering(s) - 1) < tolerance


def test_a_hose_rings_faster_before_a_smaller_chamber(made):
    axis, far = started(made, Hose(), R=0.0, delay=8e-3, V=8e-5), 0.4 * made.BENCH.stroke
    left, right = (np.abs(swings_of(axis, [3e5, 4e5, x, 0.0])).min(axis=1) for x in (-far, far))
    assert left[0] > 1.02 * right[0] and right[1] > 1.02 * left[1]


@pytest.mark.slow
def test_a_hose_loses_no_air_while_the_piston_moves(made):
    """Over a period of chamber and command the air that has entered has left."""
    axis = started(made, Hose(), R=0.0, delay=2e-2, zeta=0.4, V=2.5e-4)
    start = [3e5, 4e5, 0.0, 0.0]

    def at(t):
        phase = 4 * np.pi * t
        x = [*start[:2], 0.4 * made.BENCH.stroke * np.sin(phase), 0.0]
        return x, np.sin(phase + 0.8) * np.array(U)

    def rhs(t, y):
        x, u = at(t)
        full = [*x, *y[:8]]
        d = rates(axis, full, u)
        arrived, entered = stored_rate(axis, full, u, d), through_valves(axis, full, u)
        return np.concatenate([d[4:], arrived - entered, np.abs(entered)])

    begin = np.concatenate([at_rest(axis, start, at(0.0)[1])[4:], np.zeros(4)])
    solution = solve_ivp(rhs, (0.0, 1.5), begin, "LSODA", (1.0, 1.5), rtol=1e-6, atol=1e-10)
    kept, passed = np.split(np.diff(solution.y[8:], axis=1).ravel(), 2)
    np.testing.assert_array_less(np.abs(kept), 5e-4 * passed)


def transfer(axis, x, s):
    """Return the rate of p_P over u_P at a complex frequency, over its value at rest."""
    n = 4
    J = axis.rhs.jacobian()(x, U, axis.parameters.values, 0)
    by_x, by_u = J[0].full(), J[1].full()
    A, b, c, d = by_x[n:, n:], by_u[n:, 0], by_x[0, n:], by_u[0, 0]
    at = [d + c @ np.linalg.solve(z * np.eye(len(A)) - A, b) for z in (s, 0.0)]
    return at[0] / at[1]


def at_rest(axis, x, u=U):
    return axis.rest(x, u, axis.parameters.values).full().ravel()


def test_the_valve_sees_the_pressure_that_the_hose_takes(made):
    R, p = 2e9, 3e5
    axis, flow = started(made, Hose(), R=R), made.true_flow()
    q = 5e-3
    x = [p, p, 0.0, 0.0, q, 0.0, q, 0.0, -q, 0.0, -q, 0.0]
    before = np.sqrt(p**2 + 2 * R_AIR * T_0 * R * q * np.array([q, -q]))
    wanted = [float(flow(1.5, before[0])), float(flow(-1.0, before[1]))]
    np.testing.assert_allclose(through_valves(axis, x, U), wanted, rtol=1e-9)
    # Without flow a hose takes nothing.
    np.testing.assert_array_equal(
        through_valves(axis, [p, p, *[0.0] * 10], U),
        through_valves(made.true_axis(), x[:4], U),
    )


def behind_a_hose(made, *others):
    """Axis with sensors at the valves, and a state in which the chambers are at 3 and 4 bar."""
    axis = made.true_axis(HoseSensorAtValve(), *others).at_starting_values()
    states = dict.fromkeys(axis.states, 0.0) | {"p_P": 5e5, "p_N": 2e5, "x": 0.05, "v": 0.2}
    states |= {"hose_sensor_at_valve.p_P": 3e5, "hose_sensor_at_valve.p_N": 4e5}
    return axis, list(states.values())


def test_behind_a_hose_a_leak_empties_the_chamber_and_not_the_hose(made):
    pairs = [behind_a_hose(made, *others) for others in ((), (LeakageP(),))]
    without, leaking = (dict(zip(axis.states, rates(axis, x), strict=True)) for axis, x in pairs)
    open_air = stored_rate(started(made, LeakageP()), [3e5, 4e5, 0.05, 0.2])
    leak = open_air - stored_rate(made.true_axis(), [3e5, 4e5, 0.05, 0.2])
    X_s1, X_s2 = (pairs[0][0].parameters[name].value for name in ("X_s1", "X_s2"))
    lost = leaking["hose_sensor_at_valve.p_P"] - without["hose_sensor_at_valve.p_P"]
    assert leaking["p_P"] == pytest.approx(without["p_P"], rel=1e-6)
    assert lost * (X_s1 + 0.05 * X_s2) == pytest.approx(leak[0], rel=1e-6)


def test_behind_a_hose_the_pressures_of_the_chambers_move_the_piston(made):
    axis, x = behind_a_hose(made)
    acceleration = dict(zip(axis.states, rates(axis, x), strict=True))["v"]
    nominal = rates(made.true_axis(), [3e5, 4e5, 0.05, 0.2])[3]
    assert acceleration == pytest.approx(nominal, rel=1e-4)  # the hose fades in to 1 - e^-17


def test_growing_capacities_do_not_shrink_the_residual_of_a_hose_with_its_sensor_at_the_valve(made):
    axis, x = behind_a_hose(made)
    model = BalanceFunctions(axis)
    n = len(axis.motion_states)
    given = [
        np.array(part, dtype=float)[:, None] for part in (x[:n], [1e6, -1e6, 0.2, 0.0], U, x[n:])
    ]
    sizes = []
    for factor in (1.0, 10.0):
        more = {name: factor * axis.parameters[name].value for name in ("X_s1", "X_s2")}
        theta = axis.with_parameters(more).parameters.values
        (r,) = model.functions["residual"].evaluate(1, *given, model.constant_values, theta)
        sizes.append(abs(r[0, 0]))
    assert sizes[1] > 0.5 * sizes[0]


@pytest.mark.parametrize(("v", "stirred"), [(0.0, 1.0), (0.1, 3.0), (-0.2, 1.0 + 2.0 * 2**0.8)])
def test_the_piston_stirs_the_air_by_its_speed_to_the_power_of_eight_tenths(v, stirred):
    class At(dict):
        """Parameters, and the velocity."""

    at = At(h=50.0, b=2.0)
    at.v = v
    assert HeatTransferForced().coefficient(at) == pytest.approx(50.0 * stirred, rel=0.02)
