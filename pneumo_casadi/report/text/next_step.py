"""What a diagnosis asks for next: a command, a check, or a record."""

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.report.tables.table import cause_name, plain
from pneumo_casadi.report.text.causes import joined, suspects

#: Record that shows more of a term over its driver.
_RECORDS = {
    "x": "record slow strokes over the whole travel",
    "v": "record strokes at several constant speeds",
    "t": "record for longer, warm and cold",
    "p_P": "record at several supply pressures",
    "p_N": "record at several supply pressures",
    "p_mean": "record at several supply pressures",
    "p_difference": "record with several loads",
    "t_reversal": "record reversals after rests of several lengths",
    "s_reversal": "record small strokes of several lengths",
}
_ANY = "record motions in which it varies more"


def next_step(
    diagnosis: Diagnosis, ready: bool = False, least: str = "", careful: bool = False
) -> str:
    """Return what should be done or recorded next, in a few words.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ready : bool, optional
        Whether its final model was refined and can be used.
    least : str, optional
        Its least certain parameter, with interval.
    careful : bool, optional
        Whether it is to be used with care.

    Examples
    --------
    With ``diagnosis = pc.diagnose(pc.example_case())``:

    >>> next_step(diagnosis)
    'nothing for motions like these; record others to test the model there'
    """
    verdict = diagnosis.verdict
    wrong = joined([check.name for check in diagnosis.final_checks if not check.agrees])
    if diagnosis.findings:
        return "correct the records: see below"
    if diagnosis.experiment:
        return f"record {plain(diagnosis.experiment)}"
    if verdict is Verdict.NONE:
        if wrong:
            return f"check {wrong} in bench.json and on the axis"
        return "nothing for motions like these; record others to test the model there"
    if verdict is Verdict.ABSORBED:
        return f"check {wrong or 'the bench'} in bench.json and on the axis"
    if verdict is Verdict.AMBIGUOUS and not diagnosis.ambiguous:
        return "record more of what sets the effects below apart from their rivals"
    if verdict is Verdict.UNKNOWN:
        if diagnosis.discovered is None:
            return "record where the residual is large: see the conditions below"
        driver = diagnosis.discovered.term.driver
        seek = suspects(diagnosis.discovered)
        return f"look for what acts over {seek}; {_RECORDS.get(driver, _ANY)}"
    if ready:
        first = "check what calls for care; then " if careful else ""
        return f"{first}use the model in result.json; {_more_certain(diagnosis, least)}"
    forms = [effect.form for effect in diagnosis.final_effects]
    if not all(form in EFFECTS for form in forms):
        return "plan a record for the model with it: `pneumo-casadi design`"
    if any(EFFECTS[form].staircase for form in forms):
        return "refine the model: `diagnose --refine`; `design` plans the next record"
    with_effects = " ".join(f"--with {form}" for form in forms)
    return f"`identify {with_effects}`; `design` plans the next record"


def _more_certain(diagnosis: Diagnosis, least: str) -> str:
    """Return the record that makes the least certain parameter more certain."""
    plan = "`design` plans the next record"
    if not least:
        return plan
    known = {cause_name(effect.form): EFFECTS.get(effect.form) for effect in diagnosis.effects}
    effect = known.get(least.partition(": ")[0])
    shown = f"; it shows in {effect.separated_by}" if effect and effect.separated_by else ""
    return f"{plan}; least certain is {least}{shown}"
