"""The regressor is eq. 7, derived; effects that are linear in their parameters join it."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.effects import AsymmetricViscousFriction, Stribeck
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.parameters import Parameter

NOMINAL = (*(f"X_s{i}" for i in range(1, 7)), "M", "f_v", "F_c_plus", "F_c_minus")


def eq_7(bench, flow, x, dx, u):
    """Equations 5 to 8 of the paper, typed out."""
    p_P, p_N, q, v = x
    f, g = (1 + np.sign(v)) / 2, (1 - np.sign(v)) / 2
    D = np.zeros((3, 10))
    D[0, :3] = dx[0], q * dx[0], v * p_P
    D[1, 3:6] = dx[1], -q * dx[1], -v * p_N
    D[2, 6:] = dx[3], v, f, -g
    effort = bench.S_P * p_P - bench.S_N * p_N - (bench.S_P - bench.S_N) * bench.p_ext
    return np.array([flow(u[0], p_P), flow(u[1], p_N), effort]), D


def random_rates(rng, x):
    return np.array([*rng.normal(0, 1e6, 2), x[3], rng.normal(0, 5)])


@pytest.mark.parametrize("kind", ["true_axis", "spline_axis"])
def test_the_regressor_is_eq_7_typed_out_on_both_kinds_of_flow_map(made, kind):
    axis = getattr(made, kind)()
    assert axis.regressor_names == NOMINAL
    derived, rng = axis.regressor(), np.random.default_rng(0)
    for _ in range(50):
        x, u = made.states(axis, rng)
        dx = random_rates(rng, x)
        Y, W = eq_7(axis.bench, axis.flow, x, dx, u)
        found_Y, found_W = (a.full() for a in derived(x, dx, u))
        np.testing.assert_allclose(found_W, W, rtol=1e-14)
        np.testing.assert_allclose(found_Y.ravel(), Y, rtol=1e-11, atol=1e-16)


def test_the_force_axis_is_the_last_row_of_eq_7(made):
    axis, rng = made.true_force_axis(), np.random.default_rng(1)
    assert axis.regressor_names == NOMINAL[6:]
    for _ in range(50):
        x, u = made.states(axis, rng)
        Y, W = axis.regressor()(x, [x[1], 3.0], u)
        assert float(Y) == u[0]
        typed = [3.0, x[1], (1 + np.sign(x[1])) / 2, -(1 - np.sign(x[1])) / 2]
        np.testing.assert_allclose(W.full()[0], typed, rtol=1e-14)


def test_at_standstill_friction_leaves_half_the_difference_of_both_coulomb_forces(made):
    # Eq. 8 with sign(0) = 0: the smoothed model agrees, eq. 4 itself would say 0.
    _, W = made.true_axis().regressor()([4e5, 5e5, 0, 0], [0, 0, 0, 0], [0, 0])
    assert W.full()[2, 6:].tolist() == [0, 0, 0.5, -0.5]


def test_true_parameters_close_the_balances_of_the_model_itself(made):
    axis, rng = made.true_axis(), np.random.default_rng(2)
    theta = np.array([made.TRUE[name] for name in NOMINAL])
    derived = axis.regressor()
    for _ in range(20):
        x, u = made.states(axis, rng)
        x[3] = np.copysign(max(abs(x[3]), 0.2), x[3])  # where tanh is the sign
        dx = axis.rhs(x, u, axis.parameters.values)
        Y, W = derived(x, dx, u)
        np.testing.assert_allclose(W.full() @ theta, Y.full().ravel(), rtol=1e-9, atol=1e-12)


def test_linear_effects_join_the_regressor_with_their_own_column(made):
    axis = made.true_axis(AsymmetricViscousFriction(), Stribeck(), made.ValveLag())
    extra = ("asymmetric_viscous_friction.delta_f_v", "stribeck.delta_F")
    assert axis.regressor_names == (*NOMINAL, *extra)
    v = 0.03
    _, W = axis.regressor()([4e5, 5e5, 0.1, v], [0, 0, v, 0], [1, -1])
    held = axis.parameters["stribeck.v_stribeck"].value
    np.testing.assert_allclose(W.full()[2, 10:], [v, np.exp(-((v / held) ** 2))], rtol=1e-14)
    assert not W.full()[:2, 10:].any()


def test_a_held_shape_parameter_counts_with_its_value(made):
    axis = made.true_axis(Stribeck()).with_parameters({"stribeck.v_stribeck": 0.05})
    _, W = axis.regressor(["stribeck.delta_F"])([4e5, 5e5, 0, 0.05], [0, 0, 0.05, 0], [1, -1])
    assert float(W[2]) == pytest.approx(np.exp(-1), rel=1e-14)


def test_fixed_parameters_stay_out_of_the_regressor_and_move_to_the_left_side(made):
    axis = made.true_axis()
    axis = axis.with_parameters(axis.parameters.fix("M"))
    assert "M" not in axis.regressor_names
    Y, _ = axis.regressor()([4e5, 5e5, 0, 0.1], [0, 0, 0.1, 2.0], [0, 0])
    full, _ = made.true_axis().regressor()([4e5, 5e5, 0, 0.1], [0, 0, 0.1, 2.0], [0, 0])
    assert float(Y[2]) == pytest.approx(float(full[2]) - 2.0 * made.TRUE["M"], rel=1e-12)


def test_a_parameter_that_enters_nonlinearly_is_refused_by_name(made):
    axis = made.true_axis(Stribeck()).with_parameters({"stribeck.delta_F": 5.0})
    with pytest.raises(ModelError, match=r"not linear in stribeck\.delta_F, stribeck\.v_stribeck"):
        axis.regressor(["M", "stribeck.delta_F", "stribeck.v_stribeck"])
    with pytest.raises(ModelError, match=r"not linear in stribeck\.v_stribeck: leave"):
        axis.regressor(["stribeck.v_stribeck"])


class Product(Effect):
    """Two parameters that multiply each other: linear in either one, not in both."""

    name = "product"
    parameters = (
        Parameter("a", 1.0, "N", scale=1.0, null=0.0),
        Parameter("b", 1.0, "1", scale=1.0, null=1.0),
    )

    def force(self, F, at):
        return F - at["a"] * at["b"] * at.x


class Lossy(Effect):
    """A share of the nominal friction: bilinear with f_v and F_c."""

    name = "lossy"
    parameters = (Parameter("share", 0.0, "1", null=0.0),)

    def force(self, F, at):
        return F - at["share"] * at.friction


def test_of_two_parameters_that_multiply_each_other_one_is_held(made):
    axis = made.true_axis(Product())
    assert axis.regressor_names == (*NOMINAL, "product.a")
    axis.regressor()


def test_an_effect_bilinear_with_the_nominal_friction_stays_out(made):
    axis = made.true_axis(Lossy())
    assert axis.regressor_names == NOMINAL
    axis.regressor()


class Slow(Effect):
    """A filtered command whose rest hangs on what arrives."""

    name = "slow"
    parameters = (Parameter("tau", 0.01, "s", lower=0.0, upper=1.0, null=0.0),)
    states = (State("u_P", "V"), State("u_N", "V"))

    def rest(self, entering, at):
        u = entering["command"]
        return {"u_P": u.P, "u_N": u.N}

    def rates(self, entering, at):
        u = entering["command"]
        total = 1e-3 + at["tau"]
        return {"u_P": (u.P - at["u_P"]) / total, "u_N": (u.N - at["u_N"]) / total}

    def command(self, u, at):
        return type(u)(at["u_P"], at["u_N"])


@pytest.mark.slow
def test_states_of_effects_rest_in_the_regressor_even_behind_each_other(made):
    nominal, rng = made.true_axis(), np.random.default_rng(3)
    for effects in ((made.ValveLag(), Slow()), (Slow(), made.ValveLag())):
        axis = made.true_axis(*effects).with_parameters({"valve_lag.tau": 0.02})
        assert axis.regressor_names == NOMINAL
        for _ in range(5):
            x, u = made.states(nominal, rng)
            dx = random_rates(rng, x)
            for one, other in zip(
                axis.regressor()(x, dx, u), nominal.regressor()(x, dx, u), strict=True
            ):
                np.testing.assert_allclose(one.full(), other.full(), rtol=1e-13)
            full = axis.rest(x, u, axis.parameters.values).full().ravel()
            np.testing.assert_allclose(full, [*x, *u, *u], rtol=1e-14)
            rate = axis.rhs(full, u, axis.parameters.values).full().ravel()[4:]
            np.testing.assert_allclose(rate, 0.0, atol=1e-12)


def test_a_bench_of_equal_areas_feels_no_ambient_pressure(made):
    axis = made.true_axis()
    equal = replace(axis, bench=replace(axis.bench, S_N=axis.bench.S_P))
    Y, _ = equal.regressor()([3e5, 3e5, 0, 0.1], [0, 0, 0.1, 0], [0, 0])
    assert float(Y[2]) == pytest.approx(0.0, abs=1e-10)
