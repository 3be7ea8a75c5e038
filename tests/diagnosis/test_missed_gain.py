"""What a rival misses of the gain of the best model."""

import numpy as np
import pytest

from pneumo_casadi.diagnosis.decide.judgement import missed_gain
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.selection import Selection

LEVELS = BalanceLevels(np.ones(3), np.full(3, 100.0))


def leaving(force, cost=0.0):
    """A fit with this residual of the force, in noise floors."""
    rows = (np.outer((1.0, 1.0, force), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    return FittedModel((), {}, {}, cost, rows, rows, used, used, True)


def test_what_two_models_share_does_not_hide_in_what_they_differ():
    """The pair that both have was never fitted: one of it stands for what they share."""
    best, other = ("drag", "hose", "leak", "lag"), ("drag", "hose", "spring", "play")
    fits = {
        ("drag",): leaving(5.0, -500.0),
        best: leaving(1.1, -900.0),
        other: leaving(4.0, -600.0),
    }
    chosen = Selection(leaving(50.0), fits, (), {}, (best,), LEVELS, {}, {}, {}, None)
    expected = 1 - np.log(5.0 / 4.0) / np.log(5.0 / 1.1)
    assert missed_gain(chosen, best, other) == pytest.approx(expected)


def test_where_simulations_alone_show_the_gap_what_closes_nothing_there_is_no_rival():
    best, other = ("presliding",), ("flow_map_shape",)
    same = leaving(1.0, -10.0)  # the balances show nothing
    fits, trials = {best: same, other: same}, {best: 0.2, other: 0.99}
    chosen = Selection(
        leaving(1.0),
        fits,
        (),
        {},
        (best,),
        LEVELS,
        {best: same},
        {best: 0.2},
        trials,
        None,
        by_simulation=True,
    )
    assert missed_gain(chosen, best, other) == pytest.approx(1 - 0.01 / 0.8)
    assert missed_gain(chosen, best, ("stribeck",)) == 1.0  # it was not worth a refinement
