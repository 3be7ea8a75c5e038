"""From the search to a verdict: probabilities, sets that cannot be told apart, what is unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.decide.result import Verdict
from pneumo_casadi.diagnosis.metrics.residual_size import (
    COARSE_MAP,
    NEAR_NULL,
    gaps,
    residual_rms,
    squares,
)
from pneumo_casadi.diagnosis.prepare.study import FittedModel
from pneumo_casadi.diagnosis.select.fit_ledger import Names
from pneumo_casadi.diagnosis.select.forward_selection import Selection
from pneumo_casadi.diagnosis.select.sensor_effects import CLOSED_SHARE_LEFT
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Held-out residuals over the noise floor from which a balance has a gap that calls for a cause.
VISIBLE = COARSE_MAP
#: Gaps below this share of the largest, in units of their noise floors, are a rest.
MAIN = 0.3
#: A gap of which more than this share is left after the best effects has another cause.
LEFT = 0.5
#: The same where no effect found could have another form, and residuals over the noise floor from
#: which that counts: true offsets and leaks leave a twentieth, what is taken for them a tenth.
LEFT_BY_ONE_FORM, CLEAR = 0.08, 2.5
#: Probability of the best guess where nothing in the catalogue explains the gap: of 38 such on
#: the virtual bench, most of them with the cause taken out of the catalogue, one was right.
GUESS = 0.08
#: Residuals over the noise floor up to which a model leaves nothing to be explained.
CLEAN = 1.3
#: How fast an alternative loses credit with the share of the gain that it misses.
SHARPNESS = 25.0
#: An alternative is in the set that cannot be told apart from this probability on ...
IN_SET = 0.10
#: ... and the first one is the verdict from this share of all that the catalogue gets.
SURE = 0.6


@dataclass(frozen=True, slots=True)
class Judgement:
    """A verdict with its probabilities.

    Parameters
    ----------
    verdict : Verdict
        In one word; ``absorbed`` is decided by the parameters, not here.
    alike : tuple of tuple of str
        Models that explain the data about as well, the best first.
    probability : mapping of tuple of str to float
        Of every model fitted.
    unexplained : float
        Share of the gap that the best model leaves in its worst balance.
    excess : (ne,) array
        Held-out residuals of the nominal model over the noise floor.
    """

    verdict: Verdict
    alike: tuple[Names, ...]
    probability: Mapping[Names, float]
    unexplained: float
    excess: FloatArray


def judge(selection: Selection, effects: Sequence[Effect]) -> Judgement:
    """Weigh what the search found, given the effects of its final model."""
    excess = residual_rms(selection.nominal) / selection.levels.noise
    left = unexplained(selection)
    if not selection.path or left > LEFT or _another(selection, effects, left):
        verdict = Verdict.UNKNOWN if np.any(excess > VISIBLE) else Verdict.NONE
        weights = _weights(selection, selection.chosen, GUESS)
        return Judgement(verdict, (), weights, left, excess)
    trust = _trust(left, selection)
    weights = _weights(selection, selection.chosen, trust)
    order = sorted(weights, key=lambda key: -weights[key])
    alike = tuple(key for key in order if weights[key] >= IN_SET)
    sure = weights[selection.chosen] >= SURE * trust
    return Judgement(Verdict.EFFECT if sure else Verdict.AMBIGUOUS, alike, weights, left, excess)


def _another(selection: Selection, effects: Sequence[Effect], left: float) -> bool:
    """Tell whether effects that have one form only leave what no other form could explain."""
    clear = bool(np.any(residual_rms(selection.final) > CLEAR * selection.levels.noise))
    return clear and left > LEFT_BY_ONE_FORM and all(effect.one_form for effect in effects)


def unexplained(selection: Selection) -> float:
    """Return the share of the held-out gap that is left, in the balance with the largest rest.

    Balances with a gap that is small beside the largest do not count, nor mass flows near what a
    coarse map leaves beside a balance with more: what is left there is told as a rest, not as a
    reason to doubt. Nor do residuals of effects of sensors, whose gap shows only in simulations:
    where these have settled it, or have found what acts beside a sensor, it is their share.
    """
    simulated = selection.gap_left.get(selection.chosen, 1.0)
    if simulated < CLOSED_SHARE_LEFT or (
        len(selection.chosen) > 1 and selection.chosen in selection.output_error_fits
    ):
        return simulated
    before, after = (
        _above(residual_rms(fit), selection) for fit in (selection.nominal, selection.final)
    )
    main = before > max(MAIN * float(before.max(initial=0.0)), 1e-12)
    coarse = residual_rms(selection.nominal) < NEAR_NULL * selection.levels.noise
    coarse[-1] = False  # the force has no map
    if np.any(main & ~coarse):
        main &= ~coarse
    if not main.any():
        return 0.0
    return float(np.max(after[main] / before[main]))


def _above(rms: FloatArray, selection: Selection) -> FloatArray:
    """Return the gaps of all balances in units of their noise floors."""
    levels = selection.levels
    return np.asarray(gaps(rms, levels) * levels.signal / levels.noise)


def _trust(left: float, selection: Selection) -> float:
    """Return the probability that the cause is in the catalogue, from what stays unexplained.

    Of 134 causes named on the virtual bench, 98 % were right where no balance kept more than what
    filters and noise leave, 95 % where under a twentieth was left, 72 % where more was.
    """
    clean = bool(np.all(residual_rms(selection.final) < CLEAN * selection.levels.noise))
    return float(np.clip(0.97 - (0.0 if clean else 1.5 * left), 0.75, 0.97))


def _weights(selection: Selection, best: Names, trust: float) -> dict[Names, float]:
    """Share out the trust among models of the size of the best one."""
    if not best:
        fits = {key: fit for key, fit in selection.fits.items() if len(key) == 1}
        gain = {k: max(selection.nominal.cost - f.cost, 0.0) for k, f in fits.items()}
        total = sum(gain.values()) or 1.0
        return {key: 0.1 * value / total for key, value in gain.items()}
    weights = {
        key: float(np.exp(-SHARPNESS * missed_gain(selection, best, key)))
        for key in selection.fits
        if len(key) == len(best)
    }
    total = sum(weights.values())
    shares = {key: trust * value / total for key, value in weights.items()}
    smaller = {key: 0.0 for key in selection.fits if len(key) != len(best)}
    return shares | smaller


def missed_gain(selection: Selection, best: Names, other: Names) -> float:
    """Return the share of the gain that a model of the same size misses.

    Of the gain of those effects in which the two differ, balance by balance: a weak effect beside
    a strong one must not be lost in the strong one's gain, and what helps another balance is no
    rival but may come beside.
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
    """Return the same where simulations have decided; a model not refined has gained nothing."""
    common = tuple(name for name in best if name in other)
    before = selection.trials.get(common, 1.0)
    gain = max(before - selection.trials[best], 1e-9)
    return float(np.clip(1.0 - (before - selection.trials.get(other, before)) / gain, 0.0, 1.0))


def log_likelihood_gain(base: FittedModel, fitted: FittedModel) -> FloatArray:
    """Return the log-likelihood that a fit gains in each balance of the records fitted."""
    _, used = squares(base, held_out=False)
    before, after = residual_rms(base, held_out=False), residual_rms(fitted, held_out=False)
    return np.asarray(used.sum(axis=1) * np.log(before / after))
