"""When the model that forward selection ends with is completed."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.select import forward_selection
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.forward_selection import _completed

FINAL = ("stribeck",)
WHOLE = Completed(("hose", "stribeck"), FINAL)


def fitted(force):
    """A fit that leaves this residual of the force, in noise floors."""
    rows = (np.outer((1.0, 1.0, force), np.ones(64)),)
    used = (np.ones((3, 64), dtype=bool),)
    return SimpleNamespace(held_out=rows, train=rows, used_held_out=used, used_train=used)


@pytest.mark.parametrize(
    ("left", "hides", "tried", "expected"),
    [
        (2.0, False, False, WHOLE),
        # What is left has another cause: effects more would take up parts of it.
        (6.0, False, False, Completed(FINAL, FINAL)),
        # The balances do not tell: sensors hide the motion, or simulations have decided.
        (2.0, True, False, Completed(FINAL, FINAL)),
        (2.0, False, True, Completed(FINAL, FINAL)),
    ],
)
def test_a_model_is_completed_where_the_balances_tell(monkeypatch, left, hides, tried, expected):
    monkeypatch.setattr(forward_selection, "motion_is_hidden", lambda effects, fit: hides)
    monkeypatch.setattr(forward_selection, "complete", lambda *given: WHOLE)
    ledger = SimpleNamespace(
        fits={FINAL: fitted(left)}, output_error_fits={}, effects=lambda names: names,
        trials={FINAL: None} if tried else {},
    )  # fmt: skip
    levels = BalanceLevels(np.ones(3), np.full(3, 100.0))
    assert _completed(ledger, fitted(10.0), FINAL, levels) == expected
