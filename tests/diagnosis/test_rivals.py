"""Effects that do nearly as well in the place of one of the final model."""

from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA
from pneumo_casadi.diagnosis.select import rivals
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger
from pneumo_casadi.diagnosis.select.rivals import fit_rivals, near_rivals

CATALOGUE = dict.fromkeys(("large", "shift", "leak", "other"))
FINAL = ("large", "shift")


@pytest.fixture
def ledger(monkeypatch):
    """Beside the large effect a shift gains 100, a leak `leak`, another effect 80."""
    monkeypatch.setattr(FitLedger, "__post_init__", lambda self: None)
    monkeypatch.setattr(rivals, "motion_is_hidden", lambda effects, fitted: False)

    def made(leak):
        kept = FitLedger(SimpleNamespace(criteria=CRITERIA), CATALOGUE)
        costs = {("large",): 500, FINAL: 400, ("large", "leak"): 500 - leak}
        costs |= {("large", "other"): 420, ("shift",): 990, ("other",): 980}
        kept.fits = {
            key: SimpleNamespace(cost=cost, values={"M": 1.0, f"{key[-1]}.size": cost})
            for key, cost in costs.items()
        }
        return kept

    return made


@pytest.mark.parametrize(("leak", "expected"), [(95, {"leak"}), (92, {"leak"}), (89, set())])
def test_what_gains_nearly_as_much_beside_the_same_effects_is_a_rival(ledger, leak, expected):
    nominal = SimpleNamespace(cost=1000)
    assert set(near_rivals(ledger(leak), nominal, FINAL, "shift")) == expected


def test_the_comparison_beside_most_effects_counts(ledger):
    # Alone the other effect gains more than the shift; beside the large one it does not.
    assert "other" not in near_rivals(ledger(0), SimpleNamespace(cost=1000), FINAL, "shift")


def test_the_final_model_is_fitted_with_each_rival_in_its_place(ledger, monkeypatch):
    fitted = {}
    monkeypatch.setattr(FitLedger, "fit_all", lambda self, starts: fitted.update(starts))
    monkeypatch.setattr(FitLedger, "effects", lambda self, names: ())
    fit_rivals(ledger(95), SimpleNamespace(cost=1000), FINAL, FINAL[:1])
    assert not fitted  # what stands for a weak effect besides is not asked
    fit_rivals(ledger(95), SimpleNamespace(cost=1000), FINAL, FINAL)
    start = fitted.pop(("large", "leak"))
    assert not fitted
    assert start.values["leak.size"] == 405
    assert (start.values["M"], start.shapes, start.base) == (1.0, (), None)
