"""Whether a model with more effects is better: by a relevant and significant gain."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    bootstrap_gain,
    gaps,
    residual_rms,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.junctions import Junction
from pneumo_casadi.parameters import FloatArray


def can_matter(origin: FittedModel, before: FittedModel, levels: BalanceLevels) -> bool:
    """Return whether enough of the gap is left for a further effect to be accepted."""
    first, old = (gaps(residual_rms(fit), levels) for fit in (origin, before))
    return bool(np.any(old > levels.criteria.share * first)) or _force_is_open(before, levels)


def _force_is_open(fitted: FittedModel, levels: BalanceLevels) -> bool:
    """Return whether the force balance leaves a visible gap."""
    return bool(levels.exceeded(residual_rms(fitted), levels.criteria.visible)[-1])


def only_corrects_map(
    added: Sequence[Effect], before: FittedModel, levels: BalanceLevels, beside: bool
) -> bool:
    """Return whether added effects only correct the misfit of a coarse flow map.

    The shape of the map gains wherever the map's form misfits near null, effect or not, and so do
    a dead zone, a shift of the null and whatever else is a static map from command to spool: these
    are no causes unless the residuals exceed what any coarse map leaves. Beside another effect only
    the shape is asked.
    """
    beyond = levels.exceeded(residual_rms(before), levels.criteria.coarsest_map)
    return not np.any(beyond[:-1]) and corrects_map(added, beside)  # the force has no map


def corrects_map(added: Sequence[Effect], beside: bool = False) -> bool:
    """Return whether all effects belong to the flow map, or alone look as if they did."""
    return all(effect.metered or (not beside and _is_static_spool(effect)) for effect in added)


def _is_static_spool(effect: Effect) -> bool:
    return set(effect.junctions) == {Junction.SPOOL} and not effect.states


def accepted(
    origin: FittedModel, before: FittedModel, after: FittedModel, levels: BalanceLevels
) -> bool:
    """Return whether a model is better on held-out data by a relevant and significant gain.

    In at least one balance the held-out residuals, noise included, must shrink by a twentieth,
    and the gap above the noise floor by a share of the first gap: the misfit of a large effect is
    no second cause. In the force balance, which has no map, a further effect may close less, if it
    closes three tenths of a visible gap that is left. In a mass flow balance it must gain more, and
    the residuals must exceed what a coarse flow map leaves. The gain must be significant in a
    bootstrap of half-second blocks: of the held-out records, or of all records if a few blocks
    decide.
    """
    criteria = levels.criteria
    first, old, new = (gaps(residual_rms(fit), levels) for fit in (origin, before, after))
    enough = old - new > criteria.share * first
    least: float | FloatArray = criteria.matters
    if before is not origin:
        enough[-1] |= _force_is_open(before, levels) and new[-1] < criteria.closed * old[-1]
        is_force = np.arange(len(enough)) == len(enough) - 1
        least = np.where(is_force, criteria.matters, criteria.further)
        enough[:-1] &= levels.exceeded(residual_rms(before), criteria.coarse_map)[:-1]
    gain, draws = bootstrap_gain(before, after, levels)
    _, pooled = bootstrap_gain(before, after, levels, pooled=True)
    sure = np.maximum(*(_sure_gain(gains, levels) for gains in (draws, pooled)))
    return bool(np.any((gain > least) & (sure > 0) & enough) and gain.sum() > 0)


def surely_gains(before: FittedModel, after: FittedModel, levels: BalanceLevels) -> bool:
    """Return whether a model is better on held-out data by a gain of any size that is significant.

    It is asked of effects too small to be named. In at least one balance the gain must be
    significant in a bootstrap of the held-out half-second blocks, and all balances together must
    gain.
    """
    gain, draws = bootstrap_gain(before, after, levels)
    return bool(np.any(_sure_gain(draws, levels) > 0) and gain.sum() > 0)


def _sure_gain(draws: FloatArray, levels: BalanceLevels) -> FloatArray:
    """Return the gain that a bootstrap is certain of in each balance, (ne,)."""
    return np.asarray(np.quantile(draws, 1 - levels.criteria.certain, axis=0))
