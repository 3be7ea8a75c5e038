"""Derivatives agree with finite differences, and a block is the product of its steps."""

import numpy as np
import pytest

from pneumo_casadi.effects import Stribeck, ValveLag
from pneumo_casadi.integration import Stepping, block_functions, held_inputs, step_function
from pneumo_casadi.recording import InputHold

AXES = {
    "polynomials": lambda made: made.true_axis(),
    "spline": lambda made: made.spline_axis(),
    "states of an effect": lambda made: made.true_axis(ValveLag(), Stribeck()).with_parameters(
        {"valve_lag.tau": 8e-3, "stribeck.delta_F": 6.0}
    ),
    "spline and states": lambda made: made.spline_axis(ValveLag()).with_parameters(
        {"valve_lag.tau": 8e-3}
    ),
    "force": lambda made: made.true_force_axis(Stribeck()),
}
N = 5
#: Of central differences of scaled states of size 4 with steps of 1e-5.
ROUNDING = 1e-10


@pytest.fixture(scope="module", params=AXES)
def axis(request, made):
    return AXES[request.param](made)


def free_names(axis):
    """Some of each kind, so that a block stays small."""
    wanted = {"X_s1", "X_s6", "M", "F_c_minus", "f_v", "psi_plus_1", "flow_gain"}
    return [n for n in axis.parameters.names if n in wanted or "." in n]


@pytest.fixture(scope="module", params=list(InputHold))
def block(request, axis):
    stepping = Stepping(1e-3, request.param, 2)
    return stepping, block_functions(axis, stepping, N, free_names(axis))


def differences(function, at, scales, relative=1e-5):
    """Central differences, shape (n_out, n_in)."""
    columns = []
    for i, scale in enumerate(scales):
        h = np.zeros(len(at))
        h[i] = relative * scale
        columns.append((function(at + h) - function(at - h)) / (2 * h[i]))
    return np.array(columns).T


def assert_same(found, wanted, row_scales, column_scales):
    """Compare scaled derivatives against their row, within the rounding of the differences."""
    found, wanted = (np.asarray(a) * column_scales / row_scales[:, None] for a in (found, wanted))
    size = np.abs(wanted).max(axis=1, keepdims=True)
    assert size.max() > 1e-5
    assert np.max(np.abs(found - wanted) / (2e-7 * size + ROUNDING)) < 1


def flat(a):
    return np.asarray(a, dtype=float).ravel()


def draw(made, axis, seed, hold=InputHold.ZERO):
    rng = np.random.default_rng(seed)
    x, u = made.states(axis, rng)
    path = u + 0.02 * rng.standard_normal((N + 1, u.size)) * np.abs(u)
    return x, held_inputs(path, hold)


@pytest.mark.parametrize("of", ["x", "u", "theta"])
def test_the_right_hand_side_has_the_derivatives_of_finite_differences(made, axis, of):
    f, theta = axis.rhs, axis.parameters.values
    jacobian = f.jacobian()
    rows = axis.state_scales
    for seed in range(3):
        x, w = draw(made, axis, seed)
        at = {"x": x, "u": w[:, 0], "theta": theta}
        scales = {
            "x": axis.state_scales,
            "u": np.ones(len(axis.inputs)),
            "theta": axis.parameters.scales,
        }[of]
        found = dict(zip(at, jacobian(x, w[:, 0], theta, 0), strict=True))[of].full()
        wanted = differences(lambda z, at=at: flat(f(*(at | {of: z}).values())), at[of], scales)
        assert_same(found, wanted, rows, scales)


@pytest.mark.parametrize("hold", list(InputHold))
def test_a_step_has_the_derivatives_of_finite_differences(made, axis, hold):
    step, theta = step_function(axis, Stepping(1e-3, hold, 2)), axis.parameters.values
    jacobian = step.jacobian()
    x, w = draw(made, axis, 7, hold)
    w = w[:, 0]
    sizes = (axis.state_scales, np.ones(w.size), axis.parameters.scales)
    values = [x, w, theta]
    for i, found in enumerate(jacobian(x, w, theta, 0)):

        def moved(z, i=i):
            return flat(step(*(z if j == i else values[j] for j in range(3))))

        wanted = differences(moved, values[i], sizes[i])
        assert_same(found.full(), wanted, axis.state_scales, sizes[i])


def output_scales(axis):
    sizes = dict(zip(axis.states, axis.state_scales, strict=True))
    return np.array([sizes[name] for name in axis.outputs])


def test_a_block_and_its_sensitivities_agree_with_finite_differences(made, axis, block):
    stepping, functions = block
    free = free_names(axis)
    at = [axis.parameters.index(n) for n in free]
    theta = axis.parameters.values
    x, w = draw(made, axis, 11, stepping.hold)

    def value(z):
        full = theta.copy()
        full[at] = z[x.size :]
        return np.concatenate([flat(part) for part in functions.value(z[: x.size], w, full)])

    x_n, y, dx, dy = functions.sensitivity(x, w, theta)
    start = np.concatenate([x, theta[at]])
    np.testing.assert_allclose(np.concatenate([flat(x_n), flat(y)]), value(start), rtol=1e-13)
    columns = np.concatenate([axis.state_scales, axis.parameters.scales[at]])
    rows = np.concatenate([axis.state_scales, output_scales(axis)])
    wanted = differences(value, start, columns)
    assert_same(np.vstack([dx.full(), dy.full()]), wanted, rows, columns)


def test_the_sensitivity_of_a_block_is_the_product_of_its_steps(made, axis, block):
    stepping, functions = block
    free = free_names(axis)
    at = [axis.parameters.index(n) for n in free]
    theta, nx, nu = axis.parameters.values, len(axis.states), len(axis.inputs)
    step, output = step_function(axis, stepping), axis.output
    step_jacobian, output_jacobian = step.jacobian(), output.jacobian()
    x, w = draw(made, axis, 5, stepping.hold)
    S = np.eye(nx, nx + len(free))
    dy, y, here = 0.0, 0.0, x
    for k in range(N):
        C, _, D = (a.full() for a in output_jacobian(here, w[:nu, k], theta, 0))
        dy = dy + (C @ S + np.hstack([np.zeros((len(C), nx)), D[:, at]])) / N
        y = y + flat(output(here, w[:nu, k], theta)) / N
        A, _, B = (a.full() for a in step_jacobian(here, w[:, k], theta, 0))
        S = A @ S + np.hstack([np.zeros((nx, nx)), B[:, at]])
        here = flat(step(here, w[:, k], theta))
    x_n, y_n, dx_n, dy_n = functions.sensitivity(x, w, theta)
    np.testing.assert_allclose(flat(x_n), here, rtol=1e-12)
    np.testing.assert_allclose(flat(y_n), y, rtol=1e-12)
    columns = np.concatenate([axis.state_scales, axis.parameters.scales[at]])
    for found, wanted, rows in (
        (dx_n.full(), S, axis.state_scales),
        (dy_n.full(), dy, output_scales(axis)),
    ):
        found, wanted = (a * columns / rows[:, None] for a in (found, wanted))
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-11 * np.abs(wanted).max())


def test_outputs_of_a_block_are_the_mean_of_its_own_samples_and_not_of_the_next(made):
    axis = made.true_axis()
    stepping = Stepping(1e-3, InputHold.ZERO, 2)
    functions = block_functions(axis, stepping, N, ["M"])
    x, w = draw(made, axis, 2)
    path = made.steps(axis, np.vstack([w.T, w.T[-1:]]), x, substeps=2)
    end, mean = functions.value(x, w, axis.parameters.values)
    np.testing.assert_allclose(flat(end), path[:, N], rtol=1e-13)
    np.testing.assert_allclose(flat(mean), path[:3, :N].mean(axis=1), rtol=1e-13)
    assert abs(flat(mean)[2] - path[2, 1 : N + 1].mean()) > 1e-6
