"""Few Runge-Kutta steps where friction is flat: as accurate, and only there."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.model.integration import held_inputs, step_function
from pneumo_casadi.model.simulation import simulate_windows
from pneumo_casadi.model.stepping import (
    Stepping,
    keeps_moving,
    moving_substeps_for,
    stepping_for,
    substeps_for,
)

FS = 1000.0


@pytest.fixture(scope="module")
def strokes(made):
    """Half a second that sticks, starts and turns, and the axis with narrow friction."""
    axis = made.true_axis().with_parameters({"v_s": 1e-4})
    t = np.arange(501) / FS
    u = 1.2 * np.sin(2 * np.pi * 3.0 * t)
    return (
        axis,
        held_inputs(axis, np.column_stack([u, -u]), InputHold.ZERO),
        [3.8e5, 4.4e5, 0.0, 0.0],
    )


def run(axis, w, x_0, stepping):
    return simulate_windows(axis, stepping, w[None], np.array(x_0)[:, None])[0]


@pytest.mark.slow
def test_few_steps_while_moving_are_as_accurate_as_many(strokes):
    axis, w, x_0 = strokes
    chosen = stepping_for(axis, 1 / FS)
    assert chosen.moving == 1 and chosen.substeps >= 8
    exact = run(axis, w, x_0, Stepping(1 / FS, substeps=8 * chosen.substeps))
    quick = run(axis, w, x_0, chosen)
    many = run(axis, w, x_0, Stepping(1 / FS, substeps=chosen.substeps))
    v = exact[3]
    assert np.mean(np.abs(v) > 0.02) > 0.5 and np.any(np.abs(v) < 1e-4)  # it slides, and turns
    # Noise of 200 Pa and 10 µm: what few steps add is less than what the turns leave.
    noise = np.array([200.0, 200.0, 1e-5])
    added = np.abs(quick - many)[:3].max(axis=1) / noise
    left = np.abs(many - exact)[:3].max(axis=1) / noise
    assert np.all(added < 1e-3) and np.all(added <= left + 1e-6)


def test_steps_are_few_only_in_samples_that_keep_moving(strokes):
    axis, w, _ = strokes
    theta, u = axis.parameters.values, w[:, 100]
    branching, careful, single = (
        step_function(axis, Stepping(1 / FS, substeps=count, moving=moving))
        for count, moving in ((12, 1), (12, None), (1, None))
    )
    sticking, sliding = [3.8e5, 4.4e5, 0.0, 1e-5], [3.8e5, 4.4e5, 0.0, 0.5]
    np.testing.assert_array_equal(branching(sticking, u, theta), careful(sticking, u, theta))
    np.testing.assert_array_equal(branching(sliding, u, theta), single(sliding, u, theta))


def test_an_axis_keeps_moving_unless_it_may_come_to_rest_within_the_sample(made):
    axis = made.true_force_axis().with_parameters({"v_s": 1e-4})
    theta = axis.parameters.values
    hold = axis.parameters["F_c_plus"].value

    def moves(v, F=hold):
        return bool(keeps_moving(axis, [0.0, v], [F], theta, 1e-3))

    assert moves(0.1) and moves(-0.1, -hold)
    assert not moves(5e-4) and not moves(0.0)
    assert not moves(0.02, hold - 1e3)  # braked by 1 kN it turns within the sample


def test_what_else_is_fast_keeps_its_steps(made):
    """A lag of the valve is as fast while the axis moves; so is what an effect's state does."""
    axis = made.true_axis(made.ValveLag()).with_parameters({"v_s": 1e-4})
    assert moving_substeps_for(made.true_axis().with_parameters({"v_s": 1e-4}), 8e-3) == 1
    assert moving_substeps_for(axis, 8e-3) == 8


@pytest.mark.parametrize("v_s", [1e-2, 1.0])
def test_wide_friction_takes_the_same_steps_everywhere(made, v_s):
    axis = made.true_axis().with_parameters({"v_s": v_s})
    assert moving_substeps_for(axis, 1e-3) <= substeps_for(axis, 1e-3)


def test_steps_suit_the_fastest_of_all_axes(made):
    axis, slow = (made.true_axis().with_parameters({"v_s": v_s}) for v_s in (1e-4, 1.0))
    assert stepping_for(slow, 1e-3, also=(axis,)).substeps == substeps_for(axis, 1e-3)
    lengths = np.array([1.0, 3.0])
    timed = stepping_for(axis, 1e-3, lengths=lengths)
    assert timed.timed and timed.substeps == substeps_for(axis, 3e-3)
