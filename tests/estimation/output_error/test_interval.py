"""Intervals simulate, differentiate and add up what blocks of samples say."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.effects import Stribeck, ValveDynamics, ValveNullShift, ValveStiction
from pneumo_casadi.estimation.output_error.shooting.interval import (
    IntervalFunctions,
    triangle_index,
)
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import Stepping

N, BLOCKS = 2, 7  # blocks enough for two levels of calls
DT = 1e-3


def lagging(made):
    axis = made.true_axis(ValveDynamics(), Stribeck())
    values = {"stribeck.delta_F": 6.0, "valve_dynamics.tau": 8e-3, "valve_dynamics.slew": 1e-3}
    return axis.with_parameters(values)


def sticking(made):
    axis = made.true_axis(ValveNullShift(), ValveStiction())
    return axis.with_parameters({"valve_stiction.h": 0.005, "valve_null_shift.u_0P": 0.01})


KINDS = {
    "states of effects under linear hold": lambda made: SampledAxis(
        lagging(made), Stepping(DT, InputHold.LINEAR, substeps=4)
    ),
    "sampled states": lambda made: SampledAxis(sticking(made), Stepping(DT, substeps=2)),
    "closed loop around a spline": lambda made: SampledAxis(
        made.spline_axis(), Stepping(DT, substeps=2), made.BENCH.controller
    ),
    "nested loop": lambda made: SampledAxis(
        made.true_force_axis(), Stepping(DT), made.FORCE_BENCH.controller
    ),
}


def free_names(axis):
    """Some of each kind, so that an interval stays small."""
    wanted = {"X_s1", "X_s6", "M", "F_c_minus", "f_v", "psi_plus_1", "flow_gain"}
    return [n for n in axis.parameters.names if n in wanted or "." in n]


@pytest.fixture(scope="module", params=KINDS)
def interval(request, made):
    """A model, its functions and what one interval is given."""
    model = KINDS[request.param](made)
    axis = model.axis
    functions = IntervalFunctions(model, N, BLOCKS, tuple(free_names(axis)))
    rng = np.random.default_rng(3)
    x, u = made.states(axis, rng)
    motion = len(axis.motion_states)
    x = axis.rest(x[:motion], u, axis.parameters.values).full()
    x = model.with_controller_memory(x, None)[:, 0]  # these laws need no record
    if model.controller is None:
        path = u + 0.02 * rng.standard_normal((N * BLOCKS + 1, u.size)) * np.abs(u)
        linear = model.stepping.hold is InputHold.LINEAR
        w = np.vstack([path[:-1].T, path[1:].T]) if linear else path[:-1].T
    else:
        reference = x[axis.states.index("x")] + 1e-3 * rng.standard_normal(N * BLOCKS)
        w = np.vstack([reference, 0.1 * rng.standard_normal((u.size, N * BLOCKS))])
    plain = step_function(axis, model.stepping), axis.output, None
    if model.controller is not None:
        plain = (*plain[:2], model.feedback)
    return model, plain, functions, x, w, np.full((1, BLOCKS), DT)


def flat(a):
    return np.asarray(a, dtype=float).ravel(order="F")


def stepped(model, plain, theta, x, w):
    """States at the samples and outputs, sample by sample, with the plain step function."""
    step, output, feedback = plain
    nx, nu = len(model.axis.states), len(model.axis.inputs)
    states, outputs = [x], []
    for given in w.T:
        u = given
        kept = np.zeros(0)
        if model.controller is not None:
            found = flat(feedback(x, given, theta))
            u, kept = found[:nu], found[nu:]
        outputs.append(flat(output(x[:nx], u[:nu], theta)))
        x = np.concatenate([flat(step(x[:nx], u, theta)), kept])
        states.append(x)
    return np.array(states), np.array(outputs)


@pytest.mark.slow
def test_an_interval_is_as_many_steps_and_means_are_of_its_own_samples(interval):
    model, plain, functions, x, w, h = interval
    theta = model.axis.parameters.values
    end, mean = functions.value(x, w, theta, h)
    states, outputs = stepped(model, plain, theta, x, w)
    np.testing.assert_allclose(flat(end), states[-1], rtol=1e-11, atol=1e-14)
    wanted = outputs.reshape(BLOCKS, N, -1).mean(axis=1)
    np.testing.assert_allclose(mean.full().T, wanted, rtol=1e-11, atol=1e-14)


@pytest.mark.slow
def test_sensitivities_and_normal_equations_are_those_of_finite_differences(interval):
    model, plain, functions, x, w, h = interval
    axis, free = model.axis, free_names(model.axis)
    theta, ny = axis.parameters.values, len(axis.outputs)
    rng = np.random.default_rng(5)
    _, mean = functions.value(x, w, theta, h)
    size = np.array([100.0, 100.0, 1e-5])[-ny:]
    y = mean.full() + size[:, None] * rng.standard_normal((ny, BLOCKS))
    weight = 1 / size**2
    _, means, S, H, g, scores = (
        np.asarray(a) for a in functions.sensitivity(x, w, theta, h, y, weight)
    )
    z = np.concatenate([x, axis.parameters.select(free).values])
    scale = np.concatenate([model.state_scales, axis.parameters.select(free).scales])
    columns = []
    for i, size_i in enumerate(scale):
        pair = []
        for sign in (1, -1):
            at = z.copy()
            at[i] += sign * 1e-5 * size_i
            moved = axis.parameters.with_values(dict(zip(free, at[x.size :], strict=True)))
            states, outputs = stepped(model, plain, moved.values, at[: x.size], w)
            pair.append((states[-1], outputs.reshape(BLOCKS, N, ny).mean(axis=1)))
        columns.append([(a - b) / 2e-5 for a, b in zip(*pair, strict=True)])
    S_wanted = np.array([end for end, _ in columns]).T / model.state_scales[:, None]
    found = S * scale / model.state_scales[:, None]
    assert np.abs(found - S_wanted).max() < 1e-6 * np.abs(S_wanted).max()
    J = np.array([means for _, means in columns]).transpose(1, 2, 0)  # block, output, unknown
    e = (y - means).T
    for i in range(ny):
        block = H[triangle_index(z.size), i] * np.outer(scale, scale)
        wanted = J[:, i].T @ J[:, i]
        np.testing.assert_allclose(block, wanted, atol=2e-6 * np.abs(wanted).max())
        wanted = J[:, i].T @ e[:, i]
        np.testing.assert_allclose(g[:, i] * scale, wanted, atol=2e-6 * np.abs(wanted).max())
    wanted = np.einsum("byn,by->bn", J, e * weight)
    np.testing.assert_allclose(scores.T * scale, wanted, atol=2e-6 * np.abs(wanted).max())
    np.testing.assert_allclose(scores.sum(axis=1), g @ weight, rtol=1e-9, atol=1e-12)


def test_blocks_without_time_change_nothing(interval):
    model, plain, functions, x, w, h = interval
    theta, ny = model.axis.parameters.values, len(model.axis.outputs)
    padded = h.copy()
    padded[0, 4:] = 0.0
    states, _ = stepped(model, plain, theta, x, w[:, : 4 * N])
    y = np.ones((ny, BLOCKS))
    end, means, _, H, g, scores = (
        a.full() for a in functions.sensitivity(x, w, theta, padded, y, np.ones(ny))
    )
    own = len(model.axis.states)
    np.testing.assert_allclose(end.ravel()[:own], states[-1][:own], rtol=1e-11, atol=1e-14)
    assert not scores[:, 4:].any() and scores[:, :4].any()
    whole = functions.sensitivity(x, w, theta, h, y, np.ones(ny))
    squares = np.diag(triangle_index(len(g)))
    assert H[squares].sum() < whole[3].full()[squares].sum()
    np.testing.assert_allclose(means[:, :4], whole[1].full()[:, :4], rtol=1e-12)
    np.testing.assert_allclose(scores.sum(axis=1), g.sum(axis=1), rtol=1e-9)


def test_outputs_of_one_sample_do_not_hang_on_the_next_input(made):
    model = SampledAxis(lagging(made), Stepping(DT, InputHold.LINEAR, substeps=4))
    functions = IntervalFunctions(model, 1, 1, ("M",))
    axis = model.axis
    x = flat(axis.rest([3e5, 4e5, 0.0, 0.1], [1.0, -1.0], axis.parameters.values))
    one, two = (functions.value(x, [1, -1, a, -a], axis.parameters.values, DT) for a in (0.5, 2))
    assert np.array_equal(one[1].full(), two[1].full())
    assert not np.array_equal(one[0].full(), two[0].full())
