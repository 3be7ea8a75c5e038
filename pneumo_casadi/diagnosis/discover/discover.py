"""Discover the term that a model lacks, outside the catalogue."""

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from pneumo_casadi.diagnosis.discover.curves import curve_of
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.discover.joint_fit import fit_jointly
from pneumo_casadi.diagnosis.discover.linearised import linearise
from pneumo_casadi.diagnosis.discover.search import search
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, balance_closure
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects.term import Term
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.runtime.threads import one_thread

#: Name of a discovered effect until its reader gives it a better one.
NAME = "discovered"


def discover_beside(
    study: Study,
    models: Sequence[tuple[FittedModel, Sequence[Effect]]],
    levels: BalanceLevels,
    executor: Executor | None = None,
) -> DiscoveredTerm | None:
    """Find a term beside the nominal model, or where that fails beside further ones.

    Parameters
    ----------
    study : Study
        The case.
    models : sequence of (FittedModel, sequence of Effect)
        The nominal model first, then those with effects of the catalogue.
    levels : BalanceLevels
        Noise and signal of the held-out records.
    executor : Executor, optional
        Where terms are looked for, beside all models at once.

    Returns
    -------
    DiscoveredTerm or None
        Beside the first model that has one.
    """
    given = [(study, fitted, effects, levels) for fitted, effects in dict(models).items()]
    if executor is None:
        terms = (discover_term(*each) for each in given)
        return next((term for term in terms if term is not None), None)
    jobs = [executor.submit(discover_term, *each) for each in given]
    return next((term for job in jobs if (term := job.result()) is not None), None)


@one_thread
def discover_term(
    study: Study, base: FittedModel, effects: Sequence[Effect], levels: BalanceLevels
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

    Returns
    -------
    DiscoveredTerm or None
        None where no term closes a share of the gap that matters.
    """
    least = 1 - levels.criteria.unexplained
    ranked = search(linearise(study, base, effects), levels)
    if not ranked or ranked[0].closure < least:
        return None
    joint = fit_jointly(study, base, effects, ranked[0].fit)
    closes = balance_closure(base, joint.model, levels)
    if closes.value < least or closes.lower <= 0:
        return None
    fit = joint.fit
    term = Term(
        NAME,
        fit.site.balances,
        fit.site.factor,
        fit.site.driver,
        fit.formula.name,
        {name: fit.parameters[name] for name in fit.formula.parameters},
    )
    if not all(np.isfinite(list(term.parameters.values()))):
        return None
    curve = curve_of(joint.linear, fit)
    return DiscoveredTerm(term, joint.std, closes, base.effects, curve)
