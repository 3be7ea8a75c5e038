"""From the selection to a verdict: probabilities, and models that fit the data equally well."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.decide.result import Verdict
from pneumo_casadi.diagnosis.decide.unknown import is_unknown
from pneumo_casadi.diagnosis.metrics.residual_size import (
    residual_rms,
    share_left,
    squares,
)
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import Names
from pneumo_casadi.diagnosis.select.forward_selection import Selection
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
    excess : (ne,) array
        Held-out residuals of the nominal model over the noise floor.
    criteria : Criteria
        What the verdict was decided by.
    undecided : tuple of str
        Effects of the final model that the data cannot tell from others, while the rest is sure.
        Where they close next to nothing, they are no reason to doubt the verdict on the rest.
    """

    verdict: Verdict
    alike: tuple[Names, ...]
    probability: Mapping[Names, float]
    unexplained: float
    excess: FloatArray
    criteria: Criteria = CRITERIA
    undecided: Names = ()


def judge(selection: Selection, effects: Sequence[Effect]) -> Judgement:
    """Return the verdict of a selection, given the effects of its final model."""
    criteria = selection.levels.criteria
    excess = residual_rms(selection.nominal) / selection.levels.noise
    left = unexplained(selection)
    if is_unknown(
        left, bool(selection.path), _one_form_residual(selection, effects), False, criteria
    ):
        visible = bool(np.any(excess > criteria.coarse_map))
        verdict = Verdict.UNKNOWN if visible else Verdict.NONE
        weights = _weights(selection, selection.chosen, UNKNOWN_CAUSE_PROBABILITY)
        return Judgement(verdict, (), weights, left, excess, criteria)
    trust = _trust(left, selection)
    weights = _weights(selection, selection.chosen, trust)
    order = sorted(weights, key=lambda key: -weights[key])
    alike = tuple(key for key in order if weights[key] >= criteria.alike)
    unsure = _unsure(selection, weights, trust)
    if len(unsure) == len(selection.chosen):  # one of several stands for the verdict
        return Judgement(Verdict.AMBIGUOUS, alike, weights, left, excess, criteria)
    matters, shares = criteria.matters, selection.contributions
    weak = {name for name in unsure if shares.get(name, 1.0) < matters}
    sure = probability_of(weights, set(selection.chosen) - weak) >= criteria.alone * trust
    verdict = Verdict.EFFECT if sure else Verdict.AMBIGUOUS
    return Judgement(verdict, alike, weights, left, excess, criteria, unsure)


def _unsure(selection: Selection, weights: Mapping[Names, float], trust: float) -> Names:
    """Return effects of the final model that the data cannot tell from others.

    More is asked of further effects than of the one that closes most.
    """
    criteria = selection.levels.criteria
    first = next(iter(selection.contributions), selection.chosen[0])
    return tuple(
        name
        for name in selection.chosen
        if probability_of(weights, {name})
        < trust * (criteria.alone if name == first else criteria.further_alone)
    )


def probability_of(weights: Mapping[Names, float], names: Collection[str]) -> float:
    """Return the probability of all models that hold some effects."""
    return sum(weight for key, weight in weights.items() if set(key) >= set(names))


def _one_form_residual(selection: Selection, effects: Sequence[Effect]) -> bool:
    """Return whether effects with one form only leave residuals clearly above the noise."""
    floor = selection.levels.criteria.clear * selection.levels.noise
    clear = np.any(residual_rms(selection.final) > floor)
    return bool(clear) and all(effect.one_form for effect in effects)


def unexplained(selection: Selection) -> float:
    """Return the share of the held-out gap that the final model leaves, in the worst balance.

    See `share_left`. The gap of a sensor effect is visible in simulations only: if simulations
    have decided the selection, the share of the simulated gap is returned.
    """
    simulated = selection.gap_left.get(selection.chosen, 1.0)
    if simulated < selection.levels.criteria.simulated or (
        len(selection.chosen) > 1 and selection.chosen in selection.output_error_fits
    ):
        return simulated
    return share_left(selection.nominal, selection.final, selection.levels)


def _trust(left: float, selection: Selection) -> float:
    """Return the probability that the cause is in the catalogue, from the share left.

    Of 134 causes named on the virtual bench, 98 % were right if no balance kept more than filters
    and noise leave, 95 % if less than a twentieth of the gap was left, 72 % if more was left.
    """
    floor = selection.levels.criteria.clean * selection.levels.noise
    clean = bool(np.all(residual_rms(selection.final) < floor))
    return float(np.clip(0.97 - (0.0 if clean else 1.5 * left), 0.75, 0.97))


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
    levels = selection.levels
    return (
        selection.chosen in selection.output_error_fits
        or share_left(selection.nominal, fitted, levels) <= levels.criteria.unexplained
    )


def missed_gain(selection: Selection, best: Names, other: Names) -> float:
    """Return the share of the best model's gain that another model of the same size misses.

    Only the gain of those effects counts in which the two models differ, so that a strong effect
    of both does not hide the difference between two weak ones. It counts balance by balance: a
    gain in another balance does not replace the missing one.
    """
    if other == best:
        return 0.0
    if len(best) > 1 and best in selection.output_error_fits:
        return _missed_simulated_gain(selection, best, other)
    common = tuple(name for name in best if name in other)
    base = selection.fits.get(common, selection.nominal) if common else selection.nominal
    own, others = (log_likelihood_gain(base, selection.fits[key]) for key in (best, other))
    total = float(np.sum(np.maximum(own, 0.0)))
    return float(np.sum(np.maximum(own - np.maximum(others, 0.0), 0.0))) / max(total, 1e-9)


def _missed_simulated_gain(selection: Selection, best: Names, other: Names) -> float:
    """Return the missed share of the gain in simulations; a model not simulated has no gain."""
    common = tuple(name for name in best if name in other)
    before = selection.trials.get(common, 1.0)
    gain = max(before - selection.trials[best], 1e-9)
    return float(np.clip(1.0 - (before - selection.trials.get(other, before)) / gain, 0.0, 1.0))


def log_likelihood_gain(base: FittedModel, fitted: FittedModel) -> FloatArray:
    """Return the log-likelihood that a fit gains in each balance of the records fitted."""
    _, used = squares(base, held_out=False)
    before, after = residual_rms(base, held_out=False), residual_rms(fitted, held_out=False)
    return np.asarray(used.sum(axis=1) * np.log(before / after))
