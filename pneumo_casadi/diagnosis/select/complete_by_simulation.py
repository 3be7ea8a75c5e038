"""Weak effects beside one that hides the motion, added together and judged by simulation."""

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.complete import Completed, find_acting
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names
from pneumo_casadi.diagnosis.select.hidden_motion import beside
from pneumo_casadi.diagnosis.select.refined_trials import refine_all


def complete_by_simulation(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> Completed:
    """Return a final model that hides the motion with weak effects, if these close the gap.

    Where several weak effects act, none alone closes enough of the gap to be told from chance. What
    the balances ask for all together is refined by output error: it is taken if simulations then
    are explained. The balances are no judge of each of them, so none is named.
    """
    criteria, left = levels.criteria, ledger.gap_left[final]
    if left < criteria.simulated:
        return Completed(final, final)
    acting = find_acting(ledger, nominal, final, levels, set(final).issubset)
    if not set(final) < set(acting):
        return Completed(final, final)
    added = tuple(name for name in acting if name not in final)
    refine_all(ledger, nominal, {acting: beside(ledger, nominal, final, added)})
    if ledger.trials[acting][1] > min(criteria.simulated, criteria.closed * left):
        return Completed(final, final)
    ledger.take(acting)
    return Completed(acting, final)
