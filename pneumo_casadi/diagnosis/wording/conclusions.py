"""Sentences of a verdict: an experiment that separates causes, a hint at an unknown one."""

from collections.abc import Mapping, Sequence

from pneumo_casadi.diagnosis.metrics.findings import Closure, Where, joined_names
from pneumo_casadi.model.effect import EffectFactory


def separating_experiment(
    alternatives: Sequence[Sequence[str]], catalogue: Mapping[str, EffectFactory]
) -> str:
    """Return the experiments that separate models, by the effects in which they differ.

    Empty if there are fewer than two models.
    """
    if len(alternatives) < 2:
        return ""
    names = set().union(*alternatives)
    common = set(alternatives[0]).intersection(*alternatives[1:])
    experiments = [
        f"{name}: {catalogue[name]().separated_by}"
        for name in sorted(names - common)
        if name in catalogue and catalogue[name]().separated_by
    ]
    return "; ".join(experiments)


def unknown_hint(
    where: Where, nearest: Sequence[str], closure: Closure | None, share_left: float
) -> str:
    """Return balance, regimes and nearest effects of a cause that the catalogue lacks.

    Parameters
    ----------
    where : Where
        Location of the gap.
    nearest : sequence of str
        Effects of the best model; empty if none was accepted.
    closure : Closure or None
        Of the gap of the balances, with that model; None if no effect was accepted.
    share_left : float
        Share of the gap that it leaves in its worst balance.

    Examples
    --------
    >>> from pneumo_casadi.diagnosis.metrics.location import Location
    >>> where = Where(Location.FORCE, None, (), {"force": 1.0}, ())
    >>> unknown_hint(where, (), None, 1.0)
    'what is missing acts in force'
    """
    parts = [f"what is missing acts in {where.balance.replace('_', ' ')}"]
    if where.regimes:
        names = dict.fromkeys(regime.name for regime in where.regimes)  # of two balances alike
        parts.append("most " + ", ".join(list(names)[:2]))
    if closure is not None:
        left = 100 * min(share_left, 1.0)  # a balance may have become worse
        parts.append(
            f"{joined_names(nearest)} closes {100 * closure.value:.0f} % of it "
            f"({100 * closure.lower:.0f} to {100 * closure.upper:.0f} %) and may be part of the "
            f"cause; {left:.0f} % of the gap is left, which nothing in the catalogue "
            "explains"
        )
    return "; ".join(parts)
