"""Sentences of a verdict: an experiment that separates causes, a hint at an unknown one."""

from collections.abc import Sequence

from pneumo_casadi.diagnosis.decide.verdict import Judgement
from pneumo_casadi.diagnosis.metrics.findings import (
    Where,
    joined_names,
)
from pneumo_casadi.diagnosis.metrics.residual_size import balance_closure
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, Names
from pneumo_casadi.diagnosis.select.forward_selection import Selection


def separating_experiment(alike: Sequence[Names], catalogue: Catalogue) -> str:
    """Return what would tell the members of a set apart."""
    if len(alike) < 2:
        return ""
    names = set().union(*alike)
    common = set(alike[0]).intersection(*alike[1:])
    told = [
        f"{name}: {catalogue[name]().separated_by}"
        for name in sorted(names - common)
        if name in catalogue and catalogue[name]().separated_by
    ]
    return "; ".join(told)


def unknown_hint(where: Where, selection: Selection, judgement: Judgement) -> str:
    """Return balance, regime and nearest effects of a cause that the catalogue lacks."""
    parts = [f"what is missing acts in {where.balance.replace('_', ' ')}"]
    if where.regimes:
        parts.append("most " + ", ".join(regime.name for regime in where.regimes[:2]))
    if selection.path:
        label = joined_names(selection.chosen)
        closure = balance_closure(selection.nominal, selection.final, selection.levels)
        parts.append(
            f"{label} closes {100 * closure.value:.0f} % of it ({100 * closure.lower:.0f} to "
            f"{100 * closure.upper:.0f} %) and may be part of the cause; "
            f"{100 * judgement.unexplained:.0f} % of the gap is left, which nothing in the "
            "catalogue explains"
        )
    return "; ".join(parts)
