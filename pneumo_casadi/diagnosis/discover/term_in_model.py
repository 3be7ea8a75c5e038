"""The model with a discovered term, fitted to the balances so that it can be simulated."""

from collections.abc import Sequence
from dataclasses import replace

from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects.term import term_effect
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.model.effect import Effect

Model = tuple[FittedModel, Sequence[Effect]]


def fit_with_term(study: Study, discovered: DiscoveredTerm, base: Model) -> Model | None:
    """Return the model to which a term was added, fitted with it.

    Parameters
    ----------
    study : Study
        Records and nominal axis.
    discovered : DiscoveredTerm
        The term.
    base : (FittedModel, sequence of Effect)
        The model beside which it was found.

    Returns
    -------
    (FittedModel, sequence of Effect) or None
        None where the fit with it fails, and where a vibration would need a phase in each of
        several records.
    """
    fitted, effects = base
    law, driver = discovered.term.law, discovered.term.driver
    if law.periodic and driver == "t" and len(study.train) > 1:
        return None
    term = term_effect(discovered.term)()
    begin = {f"{term.name}.{name}": value for name, value in discovered.term.parameters.items()}
    try:
        with_term = fit_model(study, (*effects, term), {**fitted.values, **begin})
    except (FitError, ModelError):  # the formula closes the gap of the linearised balances only
        return None
    return with_term, (*effects, term)


def told_as_fitted(discovered: DiscoveredTerm, fitted: FittedModel) -> DiscoveredTerm:
    """Return a term with its parameters as the model fitted with it has them."""
    term = discovered.term
    values, std = (
        {name: given.get(f"{term.name}.{name}", other[name]) for name in term.parameters}
        for given, other in (
            (fitted.values, term.parameters),
            (fitted.std, {name: discovered.std.get(name, 0.0) for name in term.parameters}),
        )
    )
    return replace(discovered, term=replace(term, parameters=values), std=std)
