"""What the physics demands of the model, whatever its parameters."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.effects import AsymmetricViscousFriction, Stribeck
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.junctions import Supply
from pneumo_casadi.parameters import Parameter


@pytest.fixture(scope="module")
def commands(made):
    """Commands of a closed loop, its first state and its states."""
    u, x = made.controlled(made.true_axis(), 300, substeps=4)
    return u, x[:, 0], x


def scaled_gauge(axis, factor, flow=True, chambers=True):
    coefficients = axis.flow.parameters.names if flow else ()
    masses = [f"X_s{i}" for i in range(1, 7)] if chambers else ()
    p = axis.parameters
    return axis.with_parameters({n: factor * p[n].value for n in (*coefficients, *masses)})


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.3, 1.7])
@pytest.mark.parametrize("kind", ["true_axis", "spline_axis"])
def test_the_common_scale_of_flows_and_x_s_changes_no_trajectory(made, commands, factor, kind):
    u, x_0, _ = commands
    axis = getattr(made, kind)()
    one, two = (made.steps(a, u, x_0, substeps=2) for a in (axis, scaled_gauge(axis, factor)))
    np.testing.assert_allclose(one, two, rtol=1e-9, atol=1e-11)
    for part in ({"chambers": False}, {"flow": False}):
        other = made.steps(scaled_gauge(axis, factor, **part), u, x_0, substeps=2)
        assert np.abs(other[2] - one[2]).max() > 1e-3


@pytest.mark.slow
def test_the_mirrored_axis_moves_in_the_mirror(made, commands):
    u, x_0, x = commands
    axis = made.true_axis()
    p, bench = axis.parameters.as_dict(), axis.bench
    swapped = {f"X_s{i}": p[f"X_s{(i + 2) % 6 + 1}"] for i in range(1, 7)}
    mirror = replace(axis, bench=replace(bench, S_P=bench.S_N, S_N=bench.S_P)).with_parameters(
        swapped | {"F_c_plus": p["F_c_minus"], "F_c_minus": p["F_c_plus"]}
    )
    turned = np.array([x_0[1], x_0[0], -x_0[2], -x_0[3]])
    found = made.steps(mirror, u[:, ::-1], turned, substeps=4)
    np.testing.assert_allclose(found[[1, 0]], x[:2], rtol=1e-9)
    np.testing.assert_allclose(-found[2:], x[2:], rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("effects", [(), (Stribeck,), (AsymmetricViscousFriction,)])
def test_friction_never_adds_energy_beyond_the_smoothed_layer(made, effects):
    axis = made.true_force_axis(*(effect() for effect in effects))
    values = {
        "stribeck.delta_F": 20.0,
        "asymmetric_viscous_friction.delta_f_v": 20.0,
    }
    axis = axis.with_parameters({n: v for n, v in values.items() if n in axis.parameters})
    p = axis.parameters.as_dict()
    # Inside the layer unequal Coulomb forces act as the constant force (F_c+ - F_c-)/2.
    edge = p["v_s"] * np.arctanh(
        abs(p["F_c_plus"] - p["F_c_minus"]) / (p["F_c_plus"] + p["F_c_minus"])
    )
    speeds = np.concatenate([np.geomspace(edge, 3.0, 200), -np.geomspace(edge, 3.0, 200)])
    for v in speeds:
        a = float(axis.rhs([0.0, v], [0.0], axis.parameters.values)[1])
        assert a * v < 1e-12


def test_equal_coulomb_forces_never_add_energy_at_all(made):
    axis = made.true_force_axis().with_parameters({"F_c_plus": 14.0, "F_c_minus": 14.0})
    for v in np.linspace(-0.05, 0.05, 201):
        assert v * float(axis.rhs([0.0, v], [0.0], axis.parameters.values)[1]) <= 0.0


def test_friction_far_from_standstill_is_eq_4(made):
    axis = made.true_force_axis()
    p = axis.parameters.as_dict()
    for v in (-1.0, -0.2, 0.2, 1.0):
        friction = -p["M"] * float(axis.rhs([0.0, v], [0.0], axis.parameters.values)[1])
        coulomb = p["F_c_plus"] if v > 0 else -p["F_c_minus"]
        assert friction == pytest.approx(p["f_v"] * v + coulomb, rel=1e-10)


def test_gas_shut_in_is_compressed_on_a_polytrope_of_exponent_k(made):
    """Without flow p V^k stays, V = V(0) ± S x and k = X_s3/X_s2 (eq. 1, 10 and 11)."""
    axis = scaled_gauge(made.true_axis(), 0.0, chambers=False)
    x = made.steps(axis, np.zeros((200, 2)), [5e5, 3e5, -0.1, 0.2], substeps=4)
    assert np.ptp(x[2]) > 0.02
    p = made.TRUE
    V_P, V_N = p["X_s1"] + p["X_s2"] * x[2], p["X_s4"] - p["X_s5"] * x[2]
    for pressure, V, k in (
        (x[0], V_P, p["X_s3"] / p["X_s2"]),
        (x[1], V_N, p["X_s6"] / p["X_s5"]),
    ):
        np.testing.assert_allclose(pressure * V**k, pressure[0] * V[0] ** k, rtol=1e-8)


class Ports(Effect):
    """Other pressures at the valves' ports."""

    name = "ports"
    parameters = (
        Parameter("filling", 1.0, "1", lower=0.0, null=1.0),
        Parameter("emptying", 1.0, "1", lower=0.0, null=1.0),
    )

    def supply(self, ports, at):
        return Supply(ports.p_supply * at["filling"], ports.p_ext * at["emptying"])


def test_inlet_flow_scales_with_the_supply_and_exhaust_flow_with_the_back_pressure(made):
    axis, flow = made.true_axis(Ports()), made.true_flow()
    axis = axis.with_parameters({"ports.filling": 0.8, "ports.emptying": 1.3})
    x, theta = [3.2e5, 5.2e5, 0, 0], axis.parameters.values
    open_, closed = (axis.valve_flow(x, u, theta).full().ravel() for u in ([1.0, -1.0], [0.0, 0.0]))

    def gain(u, p, ratio):
        return ratio * float(flow(u, p / ratio) - flow(0.0, p / ratio))

    wanted = [gain(1.0, 3.2e5, 0.8), gain(-1.0, 5.2e5, 1.3)]
    np.testing.assert_allclose(open_ - closed, wanted, rtol=1e-12)
    # A port without pressure gives finite numbers.
    none = axis.with_parameters({"ports.filling": 0.0, "ports.emptying": 0.0})
    assert np.isfinite(none.rhs([3e5, 5e5, 0, 0], [1, -1], none.parameters.values).full()).all()


def test_both_chambers_lose_or_gain_pressure_as_their_valve_says(made):
    axis = made.true_axis()
    still = np.array([4e5, 4e5, 0.0, 0.0])
    for u, signs in (([2.0, -2.0], (1, -1)), ([-2.0, 2.0], (-1, 1))):
        rates = axis.rhs(still, u, axis.parameters.values).full().ravel()
        assert tuple(np.sign(rates[:2])) == signs


def test_a_moving_piston_without_flow_compresses_the_chamber_ahead(made):
    axis = scaled_gauge(made.true_axis(), 0.0, chambers=False)
    rates = axis.rhs([4e5, 4e5, 0, 0.5], [0, 0], axis.parameters.values).full().ravel()
    assert rates[0] < 0 < rates[1]
