"""What a final model leaves of the gap, as verdicts ask for it."""

from collections.abc import Collection, Sequence

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    gaps,
    leaves_too_much,
    residual_rms,
    share_left,
    shares_left,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.junctions import MECHANICAL, Junction


def shows_a_gap(selection: Selection, corrections: Collection[str]) -> bool:
    """Return whether the nominal model leaves a visible gap that is not the misfit of its map.

    A mass flow whose residual is within what a coarse map leaves shows none if one of the
    `corrections` of the metered map alone takes it below what is visible; `only_corrects_map` does
    not let that be named as a cause.
    """
    levels, criteria = selection.levels, selection.levels.criteria
    rms = residual_rms(selection.nominal)
    visible = levels.exceeded(rms, criteria.visible)
    coarse = visible & ~levels.exceeded(rms, criteria.coarsest_map)
    for name in corrections:
        if (name,) in selection.fits:
            left = levels.exceeded(residual_rms(selection.fits[name,]), criteria.visible)
            visible[:-1] &= ~(coarse & ~left)[:-1]  # the force has no map
    return bool(np.any(visible))


def decided_by_simulation(selection: Selection) -> bool:
    """Return whether simulations tell what is left, since balances tell little of the motion.

    Or since the balances have shown no gap.
    """
    simulated = selection.gap_left.get(selection.chosen, 1.0)
    refined = selection.chosen in selection.output_error_fits
    return simulated < selection.levels.criteria.simulated or (
        refined and (len(selection.chosen) > 1 or selection.by_simulation)
    )


def unexplained(selection: Selection) -> float:
    """Return the share of the held-out gap that the final model leaves, in the worst balance.

    See `share_left`; of balances that may keep a small gap it is not asked, see `open_balances`.
    The gap of a sensor effect is visible in simulations only: if simulations have decided the
    selection, the share of the simulated gap is returned.
    """
    if decided_by_simulation(selection):
        return selection.gap_left.get(selection.chosen, 1.0)
    nominal, final, levels = selection.nominal, selection.final, selection.levels
    return share_left(nominal, final, levels, clear=True, kept=open_balances(selection))


def open_balances(selection: Selection) -> tuple[int, ...]:
    """Return the balances that may keep a gap, because simulations are explained without it.

    It was small beside the largest gap, in noise floors or in what the balances explain, the final
    model has not made it larger, and it is clear of the noise: a coarse flow map, or something that
    acts there besides. Where a balance has little noise, many floors may be next to nothing.
    """
    if not selection.simulated or decided_by_simulation(selection):
        return ()
    nominal, final, criteria = selection.nominal, selection.final, selection.levels.criteria
    gap = gaps(residual_rms(nominal), selection.levels)
    small = shares_left(nominal, final, selection.levels) == 0.0
    small |= gap < criteria.main_gap * gap.max()
    grown = np.log(residual_rms(final) / residual_rms(nominal)) >= criteria.matters
    left = shares_left(nominal, final, selection.levels, clear=True) > criteria.unexplained
    return tuple(int(row) for row in np.flatnonzero(small & left & ~grown))


def left_open(selection: Selection) -> float:
    """Return the share of the gap left in the worst of the balances that may keep one."""
    shares = shares_left(selection.nominal, selection.final, selection.levels, clear=True)
    return float(np.max(shares[list(open_balances(selection))], initial=0.0))


def left_is_visible(selection: Selection) -> bool:
    """Return whether what the final model leaves too much of is clear of the noise."""
    if not selection.path:
        return True
    return not explains(selection, selection.final)


def explains(selection: Selection, fitted: FittedModel) -> bool:
    """Return whether a model leaves no visible gap but where it may keep one."""
    nominal, levels, kept = selection.nominal, selection.levels, open_balances(selection)
    return not leaves_too_much(nominal, fitted, levels, clear=True, kept=kept)


def left_by_one_form(selection: Selection, named: Sequence[Effect]) -> float:
    """Return the share of the gap left where effects of one form alone act, clear of the noise.

    Balance by balance: friction of another law leaves nothing in the mass flows.
    """
    levels = selection.levels
    shares = shares_left(selection.nominal, selection.final, levels)
    clear = levels.exceeded(residual_rms(selection.final), levels.criteria.clear)
    is_force = np.arange(len(shares)) == len(shares) - 1
    here = [[effect for effect in named if _acts_in(effect, force)] for force in is_force]
    certain = [bool(acting) and all(effect.one_form for effect in acting) for acting in here]
    return float(np.max(shares * clear * certain))


def _acts_in(effect: Effect, force: bool) -> bool:
    """Return whether an effect acts in the force balance, or in a mass flow; a sensor's in both."""
    junctions = set(effect.junctions)
    at = junctions & MECHANICAL if force else junctions - MECHANICAL
    return bool(at) or Junction.OUTPUT in junctions
