"""A term that takes the place of effects that were named for what it does."""

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from pneumo_casadi.diagnosis.discover.beside import Discovery, complete_term
from pneumo_casadi.diagnosis.discover.discover import discover_term
from pneumo_casadi.diagnosis.discover.term_in_model import Model
from pneumo_casadi.diagnosis.metrics.residual_size import balance_closure, residual_rms
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.model.effect import Effect


def find_rival_term(
    study: Study,
    selection: Selection,
    effects: Sequence[Effect],
    catalogue: Catalogue,
    executor: Executor | None = None,
) -> Discovery | None:
    """Return a term that takes the place of effects named.

    It is looked for only where these leave what calls for a cause. Where they have one form each,
    the true one would leave nothing: a term that alone closes surely more of the gap is the cause.
    Another form of theirs may be the cause else, and where balances tell little of the motion
    nothing is sure but simulations. Then only a term that no form of the catalogue can be stands
    against them, only what is clear of the noise calls for it, and one of them must go once it is
    in the model.

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
        Where fits run.
    """
    levels, hidden = selection.levels, selection.chosen in selection.output_error_fits
    named = [effect for effect in effects if effect.name in selection.named]
    left = residual_rms(selection.final)
    nominal: Model = (selection.nominal, ())
    if (
        named
        and not hidden
        and np.any(levels.exceeded(left, levels.criteria.clean))
        and all(e.one_form for e in named)
    ):
        term = discover_term(study, *nominal, levels)
        closes = balance_closure(selection.nominal, selection.final, levels)
        if term is not None and term.closes.lower > closes.upper:
            return complete_term(study, selection, term, nominal, catalogue, executor)
    if not named or not np.any(levels.exceeded(left, levels.criteria.clear)):
        return None
    final: Model = (selection.final, effects)
    term = discover_term(study, *final, levels, foreign=True)
    if term is None:
        return None
    discovery = complete_term(study, selection, term, final, catalogue, executor)
    if discovery is None or discovery.model is None:
        return None
    kept = {effect.name for effect in discovery.model[1]}
    if kept.issuperset(selection.named):
        return None
    return None if hidden and not _simulates_better(selection, discovery.model) else discovery


def _simulates_better(selection: Selection, model: Model) -> bool:
    """Return whether less of the simulated gap is left by a term with what acts beside it.

    As much less as a further effect must leave.
    """
    left = selection.simulations.share(selection.nominal, *model)
    return left < selection.levels.criteria.closed * selection.gap_left[selection.chosen]
