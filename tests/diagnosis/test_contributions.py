"""What each effect contributes where simulations do not tell it."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.contributions import _gap_back

LEVELS = BalanceLevels(np.ones(3), np.full(3, 100.0))


def leaving(share):
    """A fit that leaves this share of a gap of ten floors in the force."""
    rows = (np.outer((1.0, 1.0, np.hypot(1.0, 10.0 * share)), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    return FittedModel((), {}, {}, 0.0, rows, rows, used, used, True)


@pytest.mark.parametrize(
    ("runs", "expected"),
    [
        (True, {"hose": 0.3, "stribeck": 0.2}),
        # The whole left all of the gap in simulations: each effect took away what it had closed.
        (False, {"hose": 0.6, "stribeck": 0.3}),
    ],
)
def test_where_the_whole_cannot_be_simulated_the_balances_tell_what_an_effect_adds(runs, expected):
    pair, hose, stribeck = ("hose", "stribeck"), ("hose",), ("stribeck",)
    left = {pair: 0.4 if runs else 1.0, stribeck: 0.7, hose: 0.6}
    windows = SimpleNamespace(
        share=lambda nominal, fit, effects, window: left[effects],
        tells=lambda nominal, fit, effects, window: runs or effects != pair,
    )
    ledger = SimpleNamespace(simulations=windows, effects=lambda key: key)
    models = {
        "": (pair, leaving(0.1)),
        "hose": (stribeck, leaving(0.7)),
        "stribeck": (hose, leaving(0.4)),
    }
    back = _gap_back(ledger, leaving(1.0), models, 0.5, LEVELS)
    assert back == pytest.approx(expected)
