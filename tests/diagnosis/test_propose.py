"""What a round of the selection fits besides the model that it starts from."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.propose import (
    _for_open_balances,
    _open_balances,
    _promising_in,
)
from pneumo_casadi.effects import EFFECTS

LEVELS = BalanceLevels(np.ones(3), np.ones(3))


def leaving(*rms):
    """Return a fit that leaves residuals of some size in each balance."""
    rows = np.outer(rms, np.ones(8))
    return SimpleNamespace(held_out=(rows,), used_held_out=(np.ones((3, 8), dtype=bool),))


@pytest.fixture
def ledger():
    ledger = FitLedger(SimpleNamespace(criteria=CRITERIA), EFFECTS)
    ledger.fits = {
        ("leakage_P",): leaving(2.0, 9.0, 9.0),
        ("leakage_N",): leaving(9.0, 2.0, 9.0),
        ("stribeck",): leaving(9.0, 9.0, 5.0),
        ("spring_load",): leaving(9.0, 9.0, 6.0),
        ("quadratic_drag",): leaving(9.0, 9.0, 7.0),
        ("backlash",): leaving(9.0, 9.0, 8.9),
    }
    return ledger


@pytest.mark.parametrize(
    ("left", "proposed"),
    [
        ((1.0, 1.0, 4.0), ["stribeck", "spring_load"]),
        ((1.0, 4.0, 1.0), ["leakage_N"]),
        ((4.0, 1.0, 4.0), ["leakage_P", "stribeck", "spring_load"]),
        ((1.4, 1.4, 1.4), []),
    ],
)
def test_each_open_balance_has_its_own_candidates(ledger, left, proposed):
    """What gains most of all may act in balances that are at their floor already."""
    still_open = _open_balances(leaving(*left), LEVELS)
    chosen = _for_open_balances(ledger, leaving(9.0, 9.0, 9.0), still_open, LEVELS)
    assert chosen == proposed


def promising(**by_balance):
    return {
        name: ScreenResult(name, 0.0, sum(parts), np.array(parts), 1.0, True, ({},), {})
        for name, parts in by_balance.items()
    }


def test_what_promises_most_in_an_open_balance_is_tried_however_little_it_promises_of_all():
    screened = promising(hose=(900.0, 800.0, 0.0), spring_load=(0.0, 0.0, 60.0))
    assert _promising_in(screened, [2], 20.0) == ["spring_load"]
    assert _promising_in(screened, [0, 2], 20.0) == ["hose", "spring_load"]
    assert _promising_in(screened, [2], 100.0) == []
    assert _promising_in({}, [0, 1, 2], 20.0) == []
