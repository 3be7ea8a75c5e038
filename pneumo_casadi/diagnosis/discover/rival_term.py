"""A term outside the catalogue against effects that have one form only."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.diagnosis.discover.discover import discover_term
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    residual_rms,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.model.effect import Effect


def find_rival_term(
    study: Study,
    nominal: FittedModel,
    final: FittedModel,
    named: Sequence[Effect],
    levels: BalanceLevels,
) -> DiscoveredTerm | None:
    """Return a term that alone closes surely more of the gap than the effects named.

    It is looked for only where these have one form each and leave what calls for a cause: the true
    one would leave nothing, so that one which is closer to the data is the cause.

    Parameters
    ----------
    study : Study
        The case.
    nominal, final : FittedModel
        The model without and with effects.
    named : sequence of Effect
        The effects named.
    levels : BalanceLevels
        Noise and signal of the held-out records.
    """
    calls = np.any(residual_rms(final) > levels.criteria.clean * levels.noise)
    if not (named and calls and all(effect.one_form for effect in named)):
        return None
    term = discover_term(study, nominal, (), levels)
    closes = balance_closure(nominal, final, levels)
    return term if term is not None and term.closes.lower > closes.upper else None
