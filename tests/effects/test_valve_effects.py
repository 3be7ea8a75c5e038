"""Spools: their dynamics, their edges, their play, and the shape that a map shows of them."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.effects import (
    FlowMapShape,
    FlowMapShapeFittings,
    ValveDeadZone,
    ValveDeadZonePerEdge,
    ValveDynamics,
    ValveHysteresis,
    ValveMismatch,
    ValveMismatchEdges,
    ValveNullShift,
)
from pneumo_casadi.effects.valve.flow_map_shape import LocalFlowMapShape
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.flow_anchor import anchor_to_flow_map
from pneumo_casadi.model.effect import Scope
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.model.stepping import Stepping
from pneumo_casadi.valve import FlowMap, fit_polynomials

P = (4e5, 5e5)


def made_with(made, effect, **values):
    axis = made.true_axis(effect)
    return axis.with_parameters({f"{effect.name}.{name}": v for name, v in values.items()})


def opening(axis, u, extra=()):
    """Opening of each valve as the command that would give its flow, both signs alike."""
    theta = axis.parameters.values
    q = axis.valve_flow([*P, 0.0, 0.0, *extra], u, theta).full().ravel()
    results = []
    for flow, p in zip(q, P, strict=True):
        closed = axis.flow(0.0, p)
        side = 1.0 if flow > closed else -1.0
        results.append(side * float((flow - closed) / (axis.flow(side, p) - closed)))
    return np.array(results)


def test_the_spool_is_a_second_order_system_of_its_natural_frequency_and_damping(made):
    for tau, zeta in ((0.02, 0.7), (0.05, 0.4), (0.02, 1.2)):
        axis = made_with(made, ValveDynamics(), tau=tau, zeta=zeta)
        x = [*P, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0]
        A = axis.rhs.jacobian()(x, [1.0, -1.0], axis.parameters.values, 0)[0].full()[4:6, 4:6]
        omega, damping = np.sqrt(np.linalg.det(A)), -np.trace(A) / 2
        # The regularising zeros, 1/20 and 1/50 of τ² away, are all that differs.
        assert omega == pytest.approx(2 * zeta / tau, rel=0.01)
        assert damping / omega == pytest.approx(zeta, rel=0.01)
        np.testing.assert_allclose(opening(axis, [1.0, -1.0], x[4:]), [1.0, -1.0], rtol=1e-9)


def test_a_slow_command_is_delayed_by_tau_at_any_size_of_it(made):
    for tau in (0.0, 1e-4, 1e-3, 3e-2):
        axis = made_with(made, ValveDynamics(), tau=tau)
        J = axis.rhs.jacobian()([*P, 0, 0, 1, 0, -1, 0], [1, -1], axis.parameters.values, 0)
        by_x, by_u = J[0].full(), J[1].full()
        A, b, c, d = by_x[4:, 4:], by_u[4:, 0], by_x[0, 4:], by_u[0, 0]
        inner = np.linalg.solve(A, b)
        lag = c @ np.linalg.solve(A, inner) / (d - c @ inner)
        assert lag == pytest.approx(tau, abs=1e-12)


def steps(axis, x, commands, dt=1e-3):
    step = step_function(axis, Stepping(dt, InputHold.ZERO, 10))
    chain = step.mapaccum(len(commands))
    theta = np.tile(axis.parameters.values[:, None], (1, len(commands)))
    return np.hstack([np.reshape(x, (-1, 1)), chain(x, np.array(commands).T, theta).full()])


def test_the_spool_moves_no_faster_than_its_slew_allows(made):
    held = [*P, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    commands = [[3.0, -3.0]] * 60
    limit = 100.0
    for slew, limited in ((0.0, False), (1 / limit, True)):
        axis = made_with(made, ValveDynamics(), tau=5e-3, slew=slew)
        w = steps(axis, held, commands)[4]
        fastest = np.diff(w).max() / 1e-3
        assert fastest < limit if limited else fastest > 3 * limit
        assert w[-1] == pytest.approx(3.0, rel=0.05)


def test_the_dead_zone_closes_its_width_and_shortens_the_rest(made):
    delta = 0.1
    axis = made_with(made, ValveDeadZone(), delta=delta)
    for u in (0.5, 2.0):
        np.testing.assert_allclose(opening(axis, [u, -u]), [u - delta, delta - u], atol=2e-4)
    for u in (0.0, 0.05):
        assert np.abs(opening(axis, [u, -u])).max() < 1e-3
    grid = np.linspace(-0.3, 0.3, 61)
    computed = np.array([opening(axis, [u, u])[0] for u in grid])
    assert np.all(np.diff(computed) >= 0)
    np.testing.assert_allclose(computed, -computed[::-1], atol=1e-12)


def test_null_shift_and_mismatch_act_on_the_valve_they_name(made):
    shifted = made_with(made, ValveNullShift(), u_0P=0.1, u_0N=-0.2)
    np.testing.assert_allclose(opening(shifted, [1.0, -1.0]), [1.1, -1.2], rtol=1e-9)
    unequal = made_with(made, ValveMismatch(), epsilon=0.1)
    np.testing.assert_allclose(opening(unequal, [1.0, -1.0]), [1.0, -1.1], rtol=1e-9)


def test_of_another_valve_N_each_edge_opens_its_way(made):
    axis = made_with(made, ValveMismatchEdges(), delta=0.1)
    np.testing.assert_allclose(opening(axis, [-1.0, 1.0]), [-1.0, 1.05], rtol=1e-9)  # to supply
    np.testing.assert_allclose(opening(axis, [1.0, -1.0]), [1.0, -0.95], rtol=1e-9)  # to exhaust


def test_the_play_holds_the_spool_until_the_command_has_crossed_it(made):
    h = 0.1
    axis = made_with(made, ValveHysteresis(), h=h, s=0.0)  # two plays of one width are one
    sweep = np.concatenate([np.linspace(0.5, 1.5, 200), np.linspace(1.5, 0.5, 200), [0.5] * 200])
    x = steps(axis, [*P, 0.0, 0.0, 0.5, 0.5, -0.5, -0.5], np.column_stack([sweep, -sweep]))
    z = x[4, 1:]
    up, turn, down, hold = z[150], z[215], z[380], z[-1]
    assert up == pytest.approx(sweep[150] - h, abs=6e-3)
    assert turn == pytest.approx(1.4, abs=6e-3)  # within the play nothing moves
    assert down == pytest.approx(sweep[380] + h, abs=6e-3)
    assert hold == pytest.approx(0.6, abs=1e-6)  # and nothing creeps
    at_rest = [hold, hold, -hold, -hold]
    assert opening(axis, [0.5, -0.5], at_rest)[0] == pytest.approx(0.6, abs=1e-6)


@pytest.mark.slow
def test_two_plays_give_way_one_after_the_other(made):
    h, s = 0.1, 0.5
    axis = made_with(made, ValveHysteresis(), h=h, s=s)
    sweep = np.concatenate([np.linspace(0.5, 1.5, 400), np.linspace(1.5, 1.0, 400)])
    x = steps(axis, [*P, 0.0, 0.0, 0.5, 0.5, -0.5, -0.5], np.column_stack([sweep, -sweep]))
    z = x[4:8, 1:]
    spool = np.array([opening(axis, [u, -u], at)[0] for u, at in zip(sweep, z.T, strict=True)])
    assert spool[399] == pytest.approx(sweep[399] - h, abs=6e-3)
    # On the way back nothing moves for twice the narrow play, then half of the spool, then all.
    back, way = spool[400:], 1.5 - sweep[400:]
    for part, slope in (((0.0, 0.1), 0.0), ((0.12, 0.3), 0.5), ((0.32, 0.5), 1.0)):
        within = (way > part[0]) & (way < part[1])
        fitted = -np.polyfit(way[within], back[within], 1)[0]
        assert fitted == pytest.approx(slope, abs=0.06)


def test_the_derivative_to_the_play_at_none_is_that_of_true_play(made):
    axis = made_with(made, ValveHysteresis(), h=0.0)
    at = axis.parameters.index("valve_hysteresis.h")
    gain = float(axis.flow(1.0, P[0]) - axis.flow(0.5, P[0])) / 0.5
    for lag, sign in ((-1e-4, -1.0), (1e-4, 1.0)):
        J = axis.valve_flow.jacobian()(
            [*P, 0, 0, 1.0 + lag, 1.0 + lag, -1.0, -1.0], [1.0, -1.0], axis.parameters.values, 0
        )
        assert float(J[2][0, at]) == pytest.approx(sign * gain, rel=1e-9)


def bent_map(made):
    """A metered valve with edges that open more than in proportion, and differently."""
    table = made.smooth_map()
    bent = np.where(table.u > 0, table.u + 0.06 * table.u**2, table.u - 0.03 * table.u**2)
    straight = fit_polynomials(table, (5, 5, 5))
    return FlowMap(table.u, table.p, straight(bent, table.p), table.p_supply, table.p_ext, "bent")


def test_a_bent_map_is_met_by_its_local_shape_and_not_by_polynomials(made):
    table = bent_map(made)
    flow = fit_polynomials(table, (5, 5, 5))
    shape = LocalFlowMapShape((3.0, 3.0))
    known = anchor_to_flow_map(table, flow, effects=(shape,))
    assert known.names[len(flow.parameters) :] == tuple(
        f"flow_map_shape.{item.name}" for item in shape.parameters
    )
    open_ = table.u != 0  # at null the polynomials' φ was bent too and a valve is closed
    c = known.fitted
    for _ in range(5):
        step, *_ = np.linalg.lstsq(known.jacobian(c)[open_], known(c)[open_], rcond=1e-9)
        c = c - step
    assert np.std(known(c)[open_]) < 0.2 * np.std(known(known.fitted)[open_])
    own = dict(
        zip((item.name for item in shape.parameters), c[len(flow.parameters) :], strict=True)
    )
    at = Scope(0.0, 0.0, Pair(4e5, 5e5), 0.0, 0.0, {}, own)
    for u in np.unique(table.u[table.u > 0]):
        # The parabola over its chord from null to 3 V, which is the gain's.
        assert float(shape.height(u, at)) == pytest.approx(0.06 * u * (u - 3.0) / 1.18, abs=0.015)


def test_effects_that_a_metered_valve_has_not_leave_the_map_alone(made):
    table = made.smooth_map()
    flow = fit_polynomials(table, (3, 3, 3))
    assert (
        anchor_to_flow_map(table, flow, effects=(ValveDeadZone(),)).names == flow.parameters.names
    )


def test_a_local_shape_is_zero_at_null_and_beyond_the_metered_commands():
    shape = LocalFlowMapShape((3.0, 2.0))
    own = {item.name: 0.01 for item in shape.parameters}
    at = Scope(0.0, 0.0, Pair(4e5, 5e5), 0.0, 0.0, {}, own)
    computed = [float(shape.height(u, at)) for u in (0.0, 1.2, 2.0, 5.0, -1.2, -3.0, -9.0)]
    np.testing.assert_allclose(computed, [0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.0], atol=1e-12)


def test_the_shape_of_a_valve_metered_on_one_side_is_the_generic_bend():
    assert FlowMapShape.on_metered(0.0, 3.0) is FlowMapShape
    assert FlowMapShape.on_metered(-3.0, 3.0)().name == "flow_map_shape"
    with pytest.raises(ModelError, match="both sides"):
        LocalFlowMapShape((0.0, 3.0))


def omega(r: float, b: float) -> float:
    """Subsonic flow of ISO 6358 in parts of the choked one."""
    return np.sqrt(1 - (max(r - b, 0.0) / (1 - b)) ** 2)


@pytest.mark.parametrize("beta", [-0.1, 0.15])
def test_fittings_leave_choked_and_emptying_flow_as_it_was_metered(made, beta):
    plain = made_with(made, FlowMapShapeFittings(), beta=0.0)
    axis = made_with(made, FlowMapShapeFittings(), beta=beta)

    def flows(of, p, u):
        return of.valve_flow([p, p, 0.0, 0.0], [u, u], of.parameters.values).full().ravel()

    for r in (0.1, 0.19, 0.25, 0.4, 0.6, 0.95):
        p = r * made.BENCH.p_supply
        expected = omega(r, 0.3 + beta) / omega(r, 0.3)
        np.testing.assert_allclose(flows(axis, p, 1.0), expected * flows(plain, p, 1.0), rtol=1e-9)
        np.testing.assert_allclose(flows(axis, p, -1.0), flows(plain, p, -1.0), rtol=1e-12)


def test_the_generic_bend_opens_by_its_square(made):
    axis = made_with(made, FlowMapShape(), c_plus=0.05, c_minus=0.02)
    np.testing.assert_allclose(opening(axis, [2.0, -2.0]), [2.2, -2.08], rtol=1e-9)


def test_each_edge_of_each_valve_opens_beyond_its_own_overlap(made):
    overlaps = {
        "delta_P_plus": 0.1,
        "delta_P_minus": 0.2,
        "delta_N_plus": 0.3,
        "delta_N_minus": 0.4,
    }
    axis = made_with(made, ValveDeadZonePerEdge(), **overlaps)
    np.testing.assert_allclose(opening(axis, [0.7, 0.7]), [0.6, 0.4], atol=1e-4)
    np.testing.assert_allclose(opening(axis, [-0.7, -0.7]), [-0.5, -0.3], atol=1e-4)
    np.testing.assert_allclose(opening(axis, [0.05, -0.3]), [0.0, 0.0], atol=1e-4)
