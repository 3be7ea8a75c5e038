"""The effects found and the ranking of all models fitted, with their parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.decide.judgement import Judgement
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    EffectFound,
    Value,
)
from pneumo_casadi.diagnosis.metrics.residual_size import balance_closure
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, Names
from pneumo_casadi.diagnosis.select.forms import cause_of, causes_of
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect

#: Probability that an absorbed effect is among `hidden`: 14 of 16 cases on the virtual bench.
ABSORBED_PROBABILITY = 0.8


def parameter_values(axis: Axis, fitted: FittedModel) -> dict[str, Value]:
    """Return all parameters of a fit with standard deviation and unit."""
    values = {}
    for item in axis.parameters:
        value, std = fitted.values[item.name], fitted.std.get(item.name, 0.0)
        at_bound = std > 0 and value in (item.lower, item.upper)
        values[item.name] = Value(value, std, item.unit, at_bound)
    return values


def _own(study: Study, fitted: FittedModel, names: Names, catalogue: Catalogue) -> dict[str, Value]:
    """Return the parameters of a model's effects by their full names."""
    axis = study.axis.with_effects(*(catalogue[name]() for name in names))
    return {name: value for name, value in parameter_values(axis, fitted).items() if "." in name}


def _short(own: Mapping[str, Value], effect: str) -> dict[str, Value]:
    """Return the parameters of one effect by their short names."""
    prefix = f"{effect}."
    return {n.removeprefix(prefix): value for n, value in own.items() if n.startswith(prefix)}


def _labelled(names: Names, own: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return the parameters as a ranking shows them: short where one effect stands alone."""
    return _short(own, names[0]) if len(names) == 1 else own


def effects_found(
    study: Study, selection: Selection, judgement: Judgement, catalogue: Catalogue
) -> tuple[EffectFound, ...]:
    """Return the effects of the final model: those named, the one missed most first, others.

    Of weak ones besides it is not asked what they close.
    """
    own = _own(study, selection.final, selection.chosen, catalogue)
    return tuple(
        EffectFound(
            cause_of(name, catalogue),
            _probability_of_cause(judgement, cause_of(name, catalogue), catalogue),
            _short(own, name),
            selection.contributions.get(name, 0.0),
            name,
            _closures_of_forms(selection, cause_of(name, catalogue)),
            _rivals(selection, judgement, name, catalogue),
        )
        for name in (*selection.contributions, *selection.besides)
    )


def unnamed_effects(
    effects: Sequence[EffectFound], selection: Selection, catalogue: Catalogue
) -> Mapping[str, tuple[EffectFound, ...]]:
    """Return the effects besides: those probably there, corrections of the map, and the others.

    They are under the names that `Diagnosis` has for them. Of five shapes of the map that stood
    besides on the virtual bench, none was there.
    """
    kinds: dict[str, list[EffectFound]] = {"besides": [], "corrections": [], "unsupported": []}
    for effect in effects:
        if effect.form not in selection.besides:
            continue
        if catalogue[effect.form]().metered:
            kinds["corrections"].append(effect)
        else:
            idle = effect.form in selection.idle
            kinds["unsupported" if idle else "besides"].append(effect)
    return {kind: tuple(members) for kind, members in kinds.items()}


def _probability_of_cause(judgement: Judgement, cause: str, catalogue: Catalogue) -> float:
    """Return the probability of all models that hold a cause, in any of its forms."""
    models = judgement.probability.items()
    return min(1.0, sum(p for names, p in models if cause in causes_of(names, catalogue)))


def _rivals(
    selection: Selection, judgement: Judgement, name: str, catalogue: Catalogue
) -> dict[str, float]:
    """Return the causes that the data cannot tell from one of the final model's."""
    others, least = set(selection.chosen) - {name}, selection.levels.criteria.alike
    rivals: dict[str, float] = {}
    for names, probability in sorted(judgement.probability.items(), key=lambda item: -item[1]):
        if probability >= least and name not in names and others < set(names):
            (rival,) = set(names) - others
            rivals[cause_of(rival, catalogue)] = probability
    return rivals


def _closures_of_forms(selection: Selection, cause: str) -> dict[str, float]:
    """Return the share of the held-out gap that each form of a cause closes alone."""
    return {
        name: balance_closure(selection.nominal, fitted, selection.levels).value
        for name, fitted in selection.forms.get(cause, {}).items()
    }


def most_missed_first(selection: Selection, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return those of some effects that are named, the one that is missed most first."""
    by_name = {effect.name: effect for effect in effects}
    return tuple(by_name[name] for name in selection.contributions)


def _fitted_candidates(
    study: Study, selection: Selection, judgement: Judgement, catalogue: Catalogue
) -> list[Candidate]:
    """Return the models fitted by the causes that they name, each once, the most probable first.

    Models that differ in the forms of these causes, or in weak effects besides, are one candidate:
    the most probable of them is shown, with the probability of all.
    """
    fits = {**selection.fits, selection.chosen: selection.final}
    probability = {names: judgement.probability.get(names, 0.0) for names in fits if names}
    best: dict[frozenset[str], tuple[Names, Names]] = {}
    total: dict[frozenset[str], float] = {}
    for names in sorted(probability, key=lambda key: (-probability[key], selection.fits[key].cost)):
        named = tuple(name for name in names if name not in selection.besides) or names
        causes = frozenset(causes_of(named, catalogue))
        if causes not in best or names == selection.chosen:  # the verdict's form before others
            best[causes] = named, names
        total[causes] = total.get(causes, 0.0) + probability[names]
    return [
        _candidate(study, selection, *best[causes], total[causes], catalogue)
        for causes in sorted(best, key=lambda causes: -total[causes])
    ]


def _candidate(
    study: Study,
    selection: Selection,
    named: Names,
    model: Names,
    probability: float,
    catalogue: Catalogue,
) -> Candidate:
    """Return the candidate of a model with what it names."""
    fitted = selection.final if model == selection.chosen else selection.fits[model]
    screened = [selection.screen[name] for name in named if name in selection.screen]
    own = _own(study, fitted, model, catalogue)
    shown = {n: value for n, value in own.items() if n.partition(".")[0] in named}
    return Candidate(
        named,
        probability,
        balance_closure(selection.nominal, fitted, selection.levels),
        selection.screen[named[0]].explained if named[0] in selection.screen else 0.0,
        min((result.observable for result in screened), default=0.0),
        _labelled(named, shown),
    )


def rank_candidates(
    study: Study,
    selection: Selection,
    judgement: Judgement,
    hidden: Sequence[str],
    catalogue: Catalogue,
) -> tuple[Candidate, ...]:
    """Rank the causes of the models fitted, each set of causes once.

    First comes what parameters may have absorbed (`hidden`); every fit that failed stands with its
    reason.
    """
    ranked = _fitted_candidates(study, selection, judgement, catalogue)
    failed = [
        Candidate(failure.effects, 0.0, None, 0.0, 0.0, {}, failure.reason)
        for failure in selection.failures
    ]
    hidden = causes_of(hidden, catalogue)
    shares = 1.0 / np.arange(1.0, len(hidden) + 1) ** 2  # the most likely first
    absorbed = [
        Candidate((name,), ABSORBED_PROBABILITY * float(share), None, 0.0, 0.0)
        for name, share in zip(hidden, shares / shares.sum(), strict=True)
    ]
    known = {frozenset(causes_of(c.names, catalogue)) for c in (*ranked, *failed, *absorbed)}
    for name, screened in selection.screen.items():
        causes = frozenset(causes_of((name,), catalogue))
        if causes not in known:  # else it is another form of what stands there already
            known.add(causes)
            ranked.append(Candidate((name,), 0.0, None, screened.explained, screened.observable))
    alone = [(cause,) for cause in hidden]
    rest = [c for c in (*ranked, *failed) if causes_of(c.names, catalogue) not in alone]
    left = (
        (1.0 - ABSORBED_PROBABILITY) / max(1.0, sum(candidate.probability for candidate in rest))
        if hidden
        else 1.0
    )
    return tuple(
        replace(candidate, names=causes_of(candidate.names, catalogue))
        for candidate in (
            *absorbed,
            *(replace(candidate, probability=left * candidate.probability) for candidate in rest),
        )
    )
