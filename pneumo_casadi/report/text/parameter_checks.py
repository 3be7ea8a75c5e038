"""Checks of the parameters in sentences: those of the parameters to use."""

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.report.tables.verdict.parameter_checks import check_result


def check_sentences(diagnosis: Diagnosis) -> tuple[tuple[str, str], ...]:
    """Return each check of the parameters to use, what came of it and its text; failures first."""
    checks = sorted(diagnosis.final_checks, key=lambda check: (check.agrees, not check.decisive))
    return tuple((check_result(check), check.text) for check in checks)


def check_summary(diagnosis: Diagnosis) -> str:
    """Return how many checks agree, of those that can tell, and how many cannot."""
    checks = diagnosis.final_checks
    counted = [check for check in checks if check.decisive or not check.agrees]
    if not counted:
        return ""
    rest = len(checks) - len(counted)
    agreeing = sum(check.agrees for check in counted)
    return f"{agreeing} of {len(counted)} agree" + (f"; {rest} cannot tell" if rest else "")


def checks_of_what(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return of which model the parameters are that are checked."""
    sentences: list[str] = []
    if diagnosis.refined_checks:
        sentences.append("Checked are the parameters to use, those refined by output error.")
        known = {check.name for check in diagnosis.refined_checks if not check.agrees}
        earlier = [
            check.text for check in diagnosis.checks if not (check.agrees or check.name in known)
        ]
        sentences += [
            f"The fits behind the verdict contradict, the refined model does not: {text}"
            for text in earlier
        ]
    if diagnosis.verdict is Verdict.UNKNOWN:
        sentences.append(
            "The cause is not in this model. That a parameter agrees does not make it right: its "
            "error may lie within the range."
        )
    return tuple(sentences)
