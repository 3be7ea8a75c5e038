"""From the selection to a verdict: probabilities, and models that fit the data equally well."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.diagnosis.decide.unknown import is_unknown
from pneumo_casadi.diagnosis.decide.what_is_left import (
    decided_by_simulation,
    explains,
    left_by_one_form,
    left_is_visible,
    left_open,
    open_balances,
    shows_a_gap,
    unexplained,
)
from pneumo_casadi.diagnosis.metrics.residual_size import (
    gaps,
    log_likelihood_gain,
    residual_rms,
    share_left,
)
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import Names
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Probability of the best model if no effect of the catalogue explains the gap. Of 38 such cases on
#: the virtual bench, most of them with the cause taken out of the catalogue, one was right.
UNKNOWN_CAUSE_PROBABILITY = 0.08


@dataclass(frozen=True, slots=True)
class Judgement:
    """A verdict with its probabilities.

    Parameters
    ----------
    verdict : Verdict
        Without the parameter checks; see `review_verdict`.
    alike : tuple of tuple of str
        Models that explain the data about equally well, the best first.
    probability : mapping of tuple of str to float
        Of every model fitted.
    unexplained : float
        Share of the gap that the best model leaves in its worst balance.
    left_open : float
        The same in the worst of the balances that may keep a small gap; see `open_balances`.
    excess : (ne,) array
        Held-out residuals of the nominal model over the noise floor.
    gap : (ne,) array
        Held-out gap of the nominal model, as a share of what each balance explains.
    criteria : Criteria
        What the verdict was decided by.
    undecided : tuple of str
        Effects of the final model that the data cannot tell from others, while the rest is sure.
        Where they close next to nothing, they are no reason to doubt the verdict on the rest.
    explains_flows : bool
        Whether the final model leaves nothing in the mass flows that calls for a cause.
    """

    verdict: Verdict
    alike: tuple[Names, ...]
    probability: Mapping[Names, float]
    unexplained: float
    excess: FloatArray
    gap: FloatArray
    criteria: Criteria = CRITERIA
    undecided: Names = ()
    explains_flows: bool = False
    left_open: float = 0.0


def judge(
    selection: Selection,
    named: Sequence[Effect],
    surpassed: bool = False,
    corrections: Collection[str] = (),
) -> Judgement:
    """Return the verdict of a selection, given the effects that its final model names.

    With `surpassed` something outside the catalogue explains the gap better than these; see
    `find_rival_term` and `rather_one_cause`. `corrections` are the effects that may only correct
    the metered map.
    """
    levels, criteria = selection.levels, selection.levels.criteria
    rms = residual_rms(selection.nominal)
    excess, gap = rms / levels.noise, gaps(rms, levels)
    left = unexplained(selection)
    if surpassed or is_unknown(
        left,
        bool(selection.path),
        decided_by_simulation(selection) or left_is_visible(selection),
        left_by_one_form(selection, named),
        criteria=criteria,
    ):
        shown = shows_a_gap(selection, () if surpassed else corrections)
        verdict = Verdict.UNKNOWN if shown else Verdict.NONE
        weights = _weights(selection, selection.chosen, UNKNOWN_CAUSE_PROBABILITY)
        return Judgement(verdict, (), weights, left, excess, gap, criteria)
    trust = _trust(left, selection)
    weights = _weights(selection, selection.chosen, trust)
    order = sorted(weights, key=lambda key: -weights[key])
    alike = _alternatives(selection, [key for key in order if weights[key] >= criteria.alike])
    unsure = _unsure(selection, weights, trust)
    matters, shares = criteria.matters, selection.contributions
    weak = {name for name in unsure if shares.get(name, 1.0) < matters}
    sure = probability_of(weights, set(selection.named) - weak) >= criteria.alone * trust
    if len(unsure) == len(selection.named):  # one of several stands for the verdict
        unsure, sure = (), False
    return Judgement(
        Verdict.EFFECT if sure else Verdict.AMBIGUOUS,
        alike,
        weights,
        left,
        excess,
        gap,
        criteria,
        unsure,
        _explains_flows(selection),
        left_open(selection),
    )


def _explains_flows(selection: Selection) -> bool:
    """Return whether a final model leaves nothing in the mass flows that calls for a cause."""
    levels = selection.levels
    unclean = levels.exceeded(residual_rms(selection.final), levels.criteria.clean)
    return not np.any(unclean[:-1])


def doubted(judgement: Judgement) -> Judgement:
    """Return a judgement with what remains of its probabilities if the cause is unknown.

    The parameter checks may find effects not credible that the balances accept.
    """
    scale = UNKNOWN_CAUSE_PROBABILITY / max(
        UNKNOWN_CAUSE_PROBABILITY, sum(judgement.probability.values())
    )
    probability = {names: scale * value for names, value in judgement.probability.items()}
    return replace(judgement, probability=probability)


def _alternatives(selection: Selection, models: Sequence[Names]) -> tuple[Names, ...]:
    """Return the model chosen, and those in which another effect stands for one that is named.

    Weak effects besides are none of the cause: they are left out, and so is what may stand for
    them.
    """
    besides, named = set(selection.besides), set(selection.named)
    stripped = (
        tuple(name for name in key if name not in besides)
        for key in models
        if key == selection.chosen or not named <= set(key)
    )
    return tuple(dict.fromkeys(stripped))


def _unsure(selection: Selection, weights: Mapping[Names, float], trust: float) -> Names:
    """Return effects named that the data cannot tell from others.

    More is asked of further effects than of the one that is missed most.
    """
    criteria = selection.levels.criteria
    first = next(iter(selection.contributions), selection.named[0])
    return tuple(
        name
        for name in selection.named
        if probability_of(weights, {name})
        < trust * (criteria.alone if name == first else criteria.further_alone)
    )


def probability_of(weights: Mapping[Names, float], names: Collection[str]) -> float:
    """Return the probability of all models that hold some effects."""
    return sum(weight for key, weight in weights.items() if set(key) >= set(names))


def _trust(left: float, selection: Selection) -> float:
    """Return the probability that the cause is in the catalogue, from the share left.

    Of 134 causes named on the virtual bench, 98 % were right if no balance kept more than filters
    and noise leave, 95 % if less than a twentieth of the gap was left, 72 % if more was left.
    Of an effect found by simulation alone, the balances say nothing. What is left in a balance that
    may keep a gap is doubt as well.
    """
    levels = selection.levels
    if open_balances(selection):
        left = share_left(selection.nominal, selection.final, levels, clear=True)
    unclean = np.any(levels.exceeded(residual_rms(selection.final), levels.criteria.clean))
    doubt = 1.5 * left if unclean or selection.by_simulation else 0.0
    return float(np.clip(0.97 - doubt, 0.75, 0.97))


def _weights(selection: Selection, best: Names, trust: float) -> dict[Names, float]:
    """Distribute a probability among the models with as many effects as the best one.

    A model that leaves so much of the gap that its verdict would be unknown is no alternative.
    """
    if not best:
        fits = {key: fit for key, fit in selection.fits.items() if len(key) == 1}
        gain = {k: max(selection.nominal.cost - f.cost, 0.0) for k, f in fits.items()}
        total = sum(gain.values()) or 1.0
        return {key: 0.1 * value / total for key, value in gain.items()}
    sharpness = selection.levels.criteria.sharpness
    weights = {
        key: float(np.exp(-sharpness * missed_gain(selection, best, key)))
        for key, fitted in selection.fits.items()
        if len(key) == len(best) and (key == best or _explains(selection, fitted))
    }
    total = sum(weights.values())
    shares = {key: trust * value / total for key, value in weights.items()}
    return dict.fromkeys(selection.fits, 0.0) | shares


def _explains(selection: Selection, fitted: FittedModel) -> bool:
    """Return whether a model explains the gap; where simulations have decided, they tell."""
    decided = selection.chosen in selection.output_error_fits
    return decided or explains(selection, fitted)


def missed_gain(selection: Selection, best: Names, other: Names) -> float:
    """Return the share of the best model's gain that another model of the same size misses.

    Only the gain of those effects counts in which the two models differ, so that a strong effect
    of both does not hide the difference between two weak ones. It counts balance by balance: a
    gain in another balance does not replace the missing one.
    """
    if other == best:
        return 0.0
    if selection.by_simulation or (len(best) > 1 and best in selection.output_error_fits):
        return _missed_simulated_gain(selection, best, other)
    common = tuple(name for name in best if name in other)
    base = _fit_of_common(selection, common)
    own, others = (log_likelihood_gain(base, selection.fits[key]) for key in (best, other))
    total = float(np.sum(np.maximum(own, 0.0)))
    return float(np.sum(np.maximum(own - np.maximum(others, 0.0), 0.0))) / max(total, 1e-9)


def _fit_of_common(selection: Selection, common: Names) -> FittedModel:
    """Return the fit of the effects that two models share, or of most that was fitted of them.

    With the nominal model in its place the gain of what they share would hide the difference.
    """
    if common in selection.fits:
        return selection.fits[common]
    within = [fit for key, fit in selection.fits.items() if set(key) <= set(common)]
    return min((selection.nominal, *within), key=lambda fit: fit.cost)


def _missed_simulated_gain(selection: Selection, best: Names, other: Names) -> float:
    """Return the missed share of the gain in simulations; a model not simulated has no gain."""
    common = tuple(name for name in best if name in other)
    before = selection.trials.get(common, 1.0)
    gain = max(before - selection.trials[best], 1e-9)
    return float(np.clip(1.0 - (before - selection.trials.get(other, before)) / gain, 0.0, 1.0))
