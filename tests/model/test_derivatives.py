"""Derivatives of right-hand side, outputs and steps agree with finite differences."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.effects import Stribeck
from pneumo_casadi.model.integration import held_inputs, step_function
from pneumo_casadi.model.stepping import Stepping

AXES = {
    "polynomials": lambda made: made.true_axis(),
    "spline": lambda made: made.spline_axis(),
    "states of an effect": lambda made: made.true_axis(made.ValveLag(), Stribeck()).with_parameters(
        {"valve_lag.tau": 8e-3, "stribeck.delta_F": 6.0}
    ),
    "spline and states": lambda made: made.spline_axis(made.ValveLag()).with_parameters(
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
    return x, held_inputs(axis, path, hold)


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


def test_functions_are_written_once_for_all_values_of_the_parameters(axis):
    other = axis.with_parameters({"M": 2 * axis.parameters["M"].value})
    assert all(getattr(other, n) is getattr(axis, n) for n in ("rhs", "output", "rest"))
    alone = type(axis)(axis.bench, axis.flow, axis.effects, other.parameters)
    assert alone.rhs is not axis.rhs
    x = axis.rest([*axis.state_scales[: len(axis.motion_states)]], 0.5, axis.parameters.values)
    assert np.array_equal(
        other.rhs(x, 0.5, other.parameters.values).full(),
        alone.rhs(x, 0.5, alone.parameters.values).full(),
    )
