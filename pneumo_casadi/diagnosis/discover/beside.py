"""A discovered term beside effects of the catalogue.

Beside weak effects a term may close less than half of the gap by itself, and yet be its cause: with
it in the model, the catalogue explains what is left. A curve over a signal that merely follows the
cause leaves a rest that nothing explains.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pneumo_casadi.diagnosis.discover.curves import curve_of
from pneumo_casadi.diagnosis.discover.discover import NAME, explains, propose_term
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm, causes_in
from pneumo_casadi.diagnosis.discover.formula_fits import refit_shape
from pneumo_casadi.diagnosis.discover.linear.linearised import linearise
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.discover.term_in_model import Model, fit_with_term, told_as_fitted
from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    residual_rms,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FAULTS, FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import StudyJobs
from pneumo_casadi.diagnosis.select.complete import complete
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, FitLedger, Names
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.effects.term import Term, term_effect
from pneumo_casadi.model.effect import Effect

#: Share of what a term must close beside others that it must reach while effects may still be in
#: the model which are not needed: they do part of what it does.
NEEDLESS_THERE = 0.7


@dataclass(frozen=True, eq=False)
class Discovery:
    """A term that is told, and the model with it.

    Parameters
    ----------
    term : DiscoveredTerm
        The term.
    model : (FittedModel, sequence of Effect) or None
        Fitted with it and with the effects that act beside it; None where that fit fails, and
        where a vibration has another phase in each record, of which a model has one.
    """

    term: DiscoveredTerm
    model: Model | None


def discover_beside(
    study: Study,
    selection: Selection,
    effects: Sequence[Effect],
    catalogue: Catalogue,
    executor: Executor | None = None,
) -> Discovery | None:
    """Find a term beside the nominal model, or where that fails beside the final one.

    Parameters
    ----------
    study : Study
        The case.
    selection : Selection
        Its nominal and its final model.
    effects : sequence of Effect
        Of the final model.
    catalogue : mapping of str to effect class
        What may act beside the term.
    executor : Executor, optional
        Where terms are looked for, beside both models at once, and where fits run.
    """
    models: dict[FittedModel, Sequence[Effect]] = {selection.nominal: (), selection.final: effects}
    given = [(*model, selection.levels) for model in models.items()]
    terms = (propose_term(study, *each) for each in given)
    if executor is not None:
        work = StudyJobs(study, executor)
        jobs = [work.run(propose_term, *each) for each in given]
        terms = (job.result() for job in jobs)
    refused: list[Term] = []
    for term, model in zip(terms, models.items(), strict=True):
        if term is None or any(_same_form(term.term, other) for other in refused):
            continue
        discovery = complete_term(study, selection, term, model, catalogue, executor)
        if discovery is None:
            refused.append(term.term)
        elif _says_more(selection, discovery, model[0]):
            return discovery
    return None


def _same_form(first: Term, second: Term) -> bool:
    """Return whether two terms differ in their size alone.

    Where no model with the first one explains the gap, none with the second one does: a model
    beside either is completed by all that acts, and the size is fitted anew.
    """
    forms = [(each.balances, each.factor, each.driver, each.formula) for each in (first, second)]
    return forms[0] == forms[1] and not first.law.shape


def _says_more(selection: Selection, discovery: Discovery, base: FittedModel) -> bool:
    """Return whether a term over a base model closes what the effects of the final one do not.

    A line over x does no more than a spring of the catalogue does. A vibration without a model,
    because each record has a phase of its own, must close more than all effects.
    """
    if selection.final is selection.nominal:
        return True
    if discovery.model is None:
        named = balance_closure(selection.nominal, selection.final, selection.levels)
        more = discovery.term.closes.value - named.value
        return base is selection.final or more >= selection.levels.criteria.matters
    whole, _ = discovery.model
    closes = balance_closure(selection.final, whole, selection.levels)
    return closes.lower > 0 and closes.value >= selection.levels.criteria.matters


def complete_term(
    study: Study,
    selection: Selection,
    term: DiscoveredTerm,
    base: Model,
    catalogue: Catalogue,
    executor: Executor | None = None,
) -> Discovery | None:
    """Return a term with what acts beside it, or by itself, where either explains the gap.

    Beside others it must close half of what they leave, and all together surely half of the gap of
    the nominal model.

    Parameters
    ----------
    study, selection, catalogue, executor
        As of `discover_beside`.
    term : DiscoveredTerm
        Proposed.
    base : (FittedModel, sequence of Effect)
        The model beside which it was found.
    """
    nominal, levels = selection.nominal, selection.levels
    criteria, enough = levels.criteria, 1 - levels.criteria.unexplained
    model = fit_with_term(study, term, base)
    if model is not None and _is_out_of_phase(term, base[0], model[0], levels):
        model = None
    alone = Discovery(term, model) if explains(term, criteria) else None
    if model is None:
        return alone
    explained = not np.any(levels.exceeded(residual_rms(model[0]), criteria.clean))
    if explained and not base[0].effects:  # neither is anything missing nor needless
        return alone
    ledger, begin = _ledger_with(study, selection, term, model[0], catalogue, executor)

    @cache
    def useful(names: Names) -> bool:
        """Whether the term is in a model, and by itself or with the others may explain the gap."""
        if NAME not in names or alone is not None:
            return NAME in names
        whole = ledger.fits[names]
        if balance_closure(nominal, whole, levels).upper < enough:
            return False
        without = ledger.fit_without(names, (NAME,))[NAME]
        least = NEEDLESS_THERE * enough
        return without is None or balance_closure(without, whole, levels).upper >= least

    try:
        done = complete(ledger, nominal, begin, levels, useful)
    except FAULTS:  # a model with a term may have no usable derivatives
        return alone
    finally:
        ledger.begun_fits.cancel_all()
    if NAME not in done.named:  # where it does not act at all, effects of the catalogue do as well
        return alone if NAME in done.acting else None
    without = ledger.fit_without(done.acting, (NAME,))[NAME] if done.acting != begin else None
    if without is None:
        return alone
    whole = ledger.fits[done.acting]
    others = ledger.effects(without.effects)
    beside = _tell_beside(study, term.term, without, whole, others, levels)
    closes = balance_closure(nominal, whole, levels).lower
    if alone is None and not (closes >= enough and explains(beside, criteria)):
        return None
    return Discovery(beside, (whole, ledger.effects(done.acting)))


def _is_out_of_phase(
    term: DiscoveredTerm, base: FittedModel, fitted: FittedModel, levels: BalanceLevels
) -> bool:
    """Return whether a vibration has another phase in the records held out: a model has one."""
    if not (term.term.law.periodic and term.term.driver == "t"):
        return False
    return balance_closure(base, fitted, levels).upper < term.closes.lower


def _ledger_with(
    study: Study,
    selection: Selection,
    term: DiscoveredTerm,
    fitted: FittedModel,
    catalogue: Catalogue,
    executor: Executor | None,
) -> tuple[FitLedger, Names]:
    """Return a ledger to which a term was added as an effect, and its model with the term."""
    ledger = FitLedger(
        study,
        {**catalogue, NAME: term_effect(term.term)},
        executor,
        directions={k: each for k, each in selection.directions.items() if k != NAME},
    )
    names = ledger.key(fitted.effects)
    ledger.fits[names] = replace(fitted, effects=names)
    return ledger, names


def _tell_beside(
    study: Study,
    term: Term,
    without: FittedModel,
    whole: FittedModel,
    effects: Sequence[Effect],
    levels: BalanceLevels,
) -> DiscoveredTerm:
    """Return a term as a model has it, and what it closes of the gap of the same model without it.

    Parameters
    ----------
    without, whole : FittedModel
        The model without and with the term.
    effects : sequence of Effect
        Of the model without it.
    """
    values = {name: whole.values[name] for name in without.values}
    linear = linearise(study, replace(without, values=values), effects)
    site = Site(term.balances, term.factor, term.driver)
    shape = {name: whole.values[f"{term.name}.{name}"] for name in term.law.shape}
    curve = curve_of(linear, refit_shape(linear, site, term.law, shape))
    closes = balance_closure(without, whole, levels)
    return told_as_fitted(DiscoveredTerm(term, {}, closes, causes_in(effects), curve), whole)
