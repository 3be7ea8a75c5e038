"""How many effects a balance may get."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import forward_selection
from pneumo_casadi.diagnosis.select.forward_selection import _acting


@pytest.mark.parametrize(
    ("left", "in_flow", "in_force"),
    [
        ([(8, 8), (4, 8), (4, 4), (4, 2)], 1, 2),
        ([(8, 8), (4, 4), (2, 2), (1, 1)], 3, 3),
        ([(8, 8), (7.9, 4)], 0, 1),
    ],
)
def test_effects_count_in_the_balances_that_they_act_in(monkeypatch, left, in_flow, in_force):
    """Three weak effects of the load are no reason to give up a leak, nor the other way round."""
    monkeypatch.setattr(forward_selection, "residual_rms", lambda fitted: np.array(fitted.residual))
    fits = [
        SimpleNamespace(effects=("a", "b", "c")[:number], residual=residual)
        for number, residual in enumerate(left)
    ]
    found = [_acting(fits, balance, CRITERIA.matters) for balance in (0, 1)]
    assert found == [in_flow, in_force]
