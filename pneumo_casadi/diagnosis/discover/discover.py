"""Discover the term that a model lacks, outside the catalogue."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.diagnosis.discover.curves import curve_of
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm, causes_in
from pneumo_casadi.diagnosis.discover.joint_fit import fit_jointly, in_longest_record
from pneumo_casadi.diagnosis.discover.linear.linearised import linearise
from pneumo_casadi.diagnosis.discover.search import search
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, balance_closure
from pneumo_casadi.diagnosis.prepare.criteria import Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS, FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects.term import Term
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.runtime.threads import one_thread

#: Name of a discovered effect until its reader gives it a better one.
NAME = "discovered"


def discover_term(
    study: Study,
    base: FittedModel,
    effects: Sequence[Effect],
    levels: BalanceLevels,
    foreign: bool = False,
) -> DiscoveredTerm | None:
    """Find the term that closes most of the held-out gap of a model, told as a formula.

    Parameters
    ----------
    study : Study
        The case.
    base : FittedModel
        The model whose gap is to be closed.
    effects : sequence of Effect
        Its effects.
    levels : BalanceLevels
        Noise and signal of the held-out records.
    foreign : bool, optional
        Whether only terms are looked for that no form of the catalogue can be; see `search`.

    Returns
    -------
    DiscoveredTerm or None
        None where no term closes as much of the gap as explains it.
    """
    term = propose_term(study, base, effects, levels, foreign)
    return term if term is not None and explains(term, levels.criteria) else None


def explains(term: DiscoveredTerm, criteria: Criteria) -> bool:
    """Return whether a term closes so much of a gap that it explains it by itself."""
    return term.closes.value >= 1 - criteria.unexplained


@one_thread
def propose_term(
    study: Study,
    base: FittedModel,
    effects: Sequence[Effect],
    levels: BalanceLevels,
    foreign: bool = False,
) -> DiscoveredTerm | None:
    """Find the term that closes most of a gap, be it only the share that each effect must close.

    See `discover_term`. Beside weak effects it may not explain the gap by itself.
    """
    ranked = search(linearise(study, base, effects), levels, foreign)
    least = levels.criteria.share
    if not ranked or ranked[0].closure < least:
        return None
    best = ranked[0].fit
    site, formula = best.site, best.formula
    fitted_to = in_longest_record(study, base) if best.phase_free else (study, base)
    try:
        joint = fit_jointly(*fitted_to, effects, best)
    except FAULTS:  # its steps may lead to where the model has no finite residuals
        return None
    closes = balance_closure(base, joint.model, levels)
    values = {name: joint.fit.parameters[name] for name in formula.parameters}
    if closes.value < least or closes.lower <= 0 or not np.all(np.isfinite(list(values.values()))):
        return None
    term = Term(NAME, site.balances, site.factor, site.driver, formula.name, values)
    curve = curve_of(joint.linear, joint.fit)
    return DiscoveredTerm(term, joint.std, closes, causes_in(effects), curve)
