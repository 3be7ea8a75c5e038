"""Initial states of windows, each a problem of its own."""

import numpy as np

from pneumo_casadi.estimation.output_error import initial_states
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import COARSE, stepping_for


def test_a_trial_that_runs_away_costs_infinity_and_disturbs_no_other(made, monkeypatch):
    """No warning leaves it either: with this project's settings one would be an error."""
    axis = made.true_axis()
    record = made.recorded(axis, *made.controlled(axis, 400), 0)
    model = SampledAxis(axis, stepping_for(axis, record.dt, record.hold, None, COARSE))
    problem = initial_states._problem(model, record, 0.15)
    sigma = np.array([150.0, 150.0, 1.5e-5])
    x_0 = np.stack([segment.x[:, 0] for segment in problem.segments], axis=1)
    expected = initial_states._expanded(problem, x_0, sigma)
    shoot = initial_states.shoot_and_linearise

    def runs_away(*given):
        at = shoot(*given)
        intervals = slice(problem.firsts[1], None)
        at.S[intervals], at.H[intervals] = 1e305, 1e305
        at.m[:, problem.segments[0].K :] = 1e200
        return at

    monkeypatch.setattr(initial_states, "shoot_and_linearise", runs_away)
    cost, H, g = initial_states._expanded(problem, x_0, sigma)
    assert np.isinf(cost[1]) and not np.isfinite(H[1]).all()
    for part, usual in zip((cost, H, g), expected, strict=True):
        np.testing.assert_array_equal(part[0], usual[0])
