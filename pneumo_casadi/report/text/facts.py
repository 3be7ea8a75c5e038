"""The main figures of a diagnosis, as they stand at the head of its report."""

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.identification.warnings import Usable
from pneumo_casadi.report.tables.quantities import between, chance, percent, whole
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.text.causes import discovered_fact, either, joined
from pneumo_casadi.report.text.diagnosis import location_text
from pneumo_casadi.report.text.final_model import FinalModel, final_facts
from pneumo_casadi.report.text.next_step import next_step
from pneumo_casadi.report.text.parameter_checks import check_summary

#: The gap, as the head of a report calls it.
_ERROR = "Error on held-out data, beyond sensor noise"


def facts(diagnosis: Diagnosis, final: FinalModel | None) -> list[tuple[str, str]]:
    """Return names and values of the main figures: where, which, how far, what is usable, next."""
    gap, closure = diagnosis.gap, diagnosis.gap.closure
    error = f"{_ERROR}, windows of 0.5 s" if gap.views.get("windows") else _ERROR
    shown = [("Where", location_text(diagnosis))]
    shown += _causes(diagnosis)
    shown += [("One of", either(effect)) for effect in diagnosis.undecided]
    if diagnosis.besides:
        besides = joined([either(effect) for effect in diagnosis.besides])
        shown.append(("Probably also there", besides))
    if diagnosis.corrections:
        names = joined([plain(effect.name) for effect in diagnosis.corrections])
        shown.append(("Corrects the flow map", names))
    if diagnosis.absorbed:
        names = joined([plain(name) for name in diagnosis.absorbed])
        shown.append(("Absorbed by the parameters", names))
    if diagnosis.discovered is not None:
        shown.append(("Discovered term", discovered_fact(diagnosis.discovered)))
    if diagnosis.effects:
        shown += [
            (error, f"{percent(gap.before)} → {percent(gap.after)}"),
            ("Reduction of this error", f"{whole(closure.value)} ({between(closure)})"),
        ]
    else:
        term = gap.with_term
        with_term = "" if term is None else f" → {percent(term)} with the discovered term"
        shown.append((error, percent(gap.before) + with_term))
    shown += _in_closed_loop(diagnosis)
    checks = check_summary(diagnosis)
    wrong = any(not check.agrees for check in diagnosis.final_checks)
    if checks and (wrong or diagnosis.verdict is not Verdict.UNKNOWN):
        shown.append(("Parameter checks", checks))
    shown += final_facts(diagnosis, final)
    usable = Usable.NO if final is None else final.usability.usable
    least = "" if final is None else final.least
    ready, careful = usable is not Usable.NO, usable is Usable.WITH_CARE
    return [*shown, ("Next", next_step(diagnosis, ready, least, careful))]


def _causes(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return the effects named, with the probability of each, or of all where it is the same."""
    effects = diagnosis.effects
    if not effects:
        return []
    names = [plain(effect.name) for effect in effects]
    odds = [chance(effect.probability) for effect in effects]
    if len(effects) == 1:
        return [("Cause", f"{names[0]}, probability {odds[0]}")]
    if len(set(odds)) == 1:
        return [("Causes", f"{joined(names)}, all together with probability {odds[0]}")]
    each = [f"{name} ({share})" for name, share in zip(names, odds, strict=True)]
    return [("Causes, probability of each", joined(each))]


def _in_closed_loop(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return the error of the position over a whole record under its controller."""
    error = diagnosis.gap.views.get("closed_loop", {}).get("x")
    if error is None:
        return []
    after = "with_term" if "with_term" in error else "after"
    changed = f" → {percent(error[after])}" if diagnosis.effects or after != "after" else ""
    return [("The same of x, whole record in closed loop", percent(error["before"]) + changed)]
