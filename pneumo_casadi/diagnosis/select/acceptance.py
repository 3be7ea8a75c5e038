"""Whether a model with more effects is better: by a relevant and significant gain."""

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    COARSE_MAP,
    BalanceLevels,
    block_gain,
    bootstrap_gain,
    gaps,
    residual_rms,
)
from pneumo_casadi.diagnosis.prepare.study import FittedModel

#: A gain of log σ in one balance that matters, on held-out data; see `accepted`.
MATTERS = 0.05
#: The same of a further effect in a mass flow balance, which must be off by more than a coarse map.
FURTHER = 0.1
#: Share of the first gap that each effect must close by itself: less is what the form of another
#: one misses. Large effects of another form than the catalogue's leave up to 0.15.
SHARE = 0.1
#: Share of bootstrap replicates in which the gain must be there.
CERTAIN = 0.95


def can_matter(origin: FittedModel, before: FittedModel, levels: BalanceLevels) -> bool:
    """Return whether enough of the gap is left for a further effect to be accepted."""
    first, old = (gaps(residual_rms(fit), levels) for fit in (origin, before))
    return bool(np.any(old > SHARE * first))


def accepted(
    origin: FittedModel, before: FittedModel, after: FittedModel, levels: BalanceLevels
) -> bool:
    """Return whether a model is better on held-out data by a relevant and significant gain.

    In at least one balance the held-out residuals, noise included, must shrink by a twentieth,
    and the gap above the noise floor by a share of the first gap: the misfit of a large effect is
    no second cause. In a mass flow balance a further effect must gain more, and the residuals must
    exceed what a coarse flow map leaves. The gain must be significant in a bootstrap of half-second
    blocks: of the held-out records, or of all records if a few blocks decide; of the root mean
    square, or of the blocks' mean logarithms if a few large residuals decide.
    """
    first, old, new = (gaps(residual_rms(fit), levels) for fit in (origin, before, after))
    enough = old - new > SHARE * first
    least = np.full(len(enough), MATTERS)
    if before is not origin:
        least[:-1] = FURTHER  # all but the force
        enough[:-1] &= (residual_rms(before) > COARSE_MAP * levels.noise)[:-1]
    for kind in (bootstrap_gain, block_gain):
        gain, draws = kind(before, after, levels)
        _, pooled = kind(before, after, levels, pooled=True)
        sure = np.maximum(*(np.quantile(gains, 1 - CERTAIN, axis=0) for gains in (draws, pooled)))
        if np.any((gain > least) & (sure > 0) & enough) and gain.sum() > 0:
            return True
    return False
