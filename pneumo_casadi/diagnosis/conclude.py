"""The conclusion of a selection: its verdict, and what is told where the cause is unknown."""

from concurrent.futures import Executor
from dataclasses import dataclass, replace

from pneumo_casadi.diagnosis.checks.parameter_checks import check_fit
from pneumo_casadi.diagnosis.decide.decision import NAMING, Decision, decide_verdict
from pneumo_casadi.diagnosis.decide.shared_cause import rather_one_cause
from pneumo_casadi.diagnosis.decide.what_is_left import open_balances
from pneumo_casadi.diagnosis.discover.beside import Discovery, discover_beside
from pneumo_casadi.diagnosis.discover.rival_term import find_rival_term
from pneumo_casadi.diagnosis.metrics.findings import Check, joined_names
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue
from pneumo_casadi.diagnosis.select.forms import causes_of
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.model.effect import Effect

#: Note on an effect that only simulations have found.
SHOWN_BY_SIMULATION = (
    "the balances, of the motion that was measured, show no gap: simulations alone have found the "
    "effect, and its sizes are those of output error"
)
#: The same on one beside effects that explain what the balances show.
SHOWN_BESIDE = (
    "beside {} the balances, of the motion that was measured, show no gap: simulations alone have "
    "found {}, and all sizes are those of output error"
)


@dataclass(frozen=True, eq=False)
class Conclusion:
    """A verdict on a selection.

    Parameters
    ----------
    effects : tuple of Effect
        Of the final model.
    checks : tuple of Check
        Of its parameters.
    decision : Decision
        The verdict.
    discovery : Discovery, optional
        A term outside the catalogue, where the cause is unknown.
    notes : tuple of str
        On the verdict.
    """

    effects: tuple[Effect, ...]
    checks: tuple[Check, ...]
    decision: Decision
    discovery: Discovery | None = None
    notes: tuple[str, ...] = ()


def conclude(
    study: Study, selection: Selection, catalogue: Catalogue, executor: Executor | None
) -> Conclusion:
    """Return the verdict, and where the cause is unknown a term outside the catalogue."""
    known: Catalogue = {**EFFECTS, **catalogue}
    effects = tuple(catalogue[name]() for name in selection.chosen)
    checks = tuple(check_fit(study, selection.final, effects))
    doubt = rather_one_cause(
        effects, selection.final, study.axis.outputs, catalogue, study.criteria
    )
    decision = decide_verdict(selection, checks, known, surpassed=bool(doubt))
    found_by = _shown_by_simulation(selection, known)
    first = Conclusion(effects, checks, decision, notes=tuple(filter(None, (doubt, found_by))))
    given = study, selection, effects, catalogue, executor
    if decision.judgement.verdict in NAMING:
        rival = find_rival_term(*given)
        if rival is not None:
            decision = decide_verdict(selection, checks, known, surpassed=True)
            shown = rival if decision.verdict is Verdict.UNKNOWN else None
            return replace(first, decision=decision, discovery=shown)
    if decision.names_effects:
        return replace(first, notes=(*first.notes, *_left_open(study, selection)))
    if decision.verdict is not Verdict.UNKNOWN:
        return first
    return replace(first, discovery=discover_beside(*given))


def _shown_by_simulation(selection: Selection, catalogue: Catalogue) -> str:
    """Return the note on an effect that simulations alone have found; empty where none was."""
    if not selection.by_simulation:
        return ""
    if selection.balances_show_nothing:
        return SHOWN_BY_SIMULATION
    before, after = selection.path[-2:]
    added = [name for name in after if name not in before]
    return SHOWN_BESIDE.format(*(joined_names(causes_of(n, catalogue)) for n in (before, added)))


def _left_open(study: Study, selection: Selection) -> tuple[str, ...]:
    """Return the note on balances that keep a gap beside the effects named; none without any."""
    names = [study.axis.equations[row].replace("_", " ") for row in open_balances(selection)]
    if not names:
        return ()
    return (
        f"a gap is left in {' and '.join(names)}, small beside the one that is explained: a coarse "
        "flow map, or something that acts there besides",
    )
