"""Whether a verdict is to be believed, by the parameters that come with it."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.checks.absorbed import absorbed_candidates
from pneumo_casadi.diagnosis.decide.result import Verdict
from pneumo_casadi.diagnosis.decide.verdict import Judgement
from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.model.effect import EffectFactory

#: Areas of the pistons among the checks.
AREAS = ("S_P", "S_N", "S_N/S_P")
#: Residuals over the noise floor up to which a gap is faint: a valve with 4/3 the gain left 5.3.
FAINT = 6.0
#: Share of the gap left from which an effect is not believed that comes with a wrong mass, or with
#: areas off by so many tolerances: what its form misses moves them by two.
DOUBTFUL, FAR = 0.1, 3.0


def near_noise(judgement: Judgement) -> bool:
    """Tell whether the gap is near the noise in all balances."""
    return float(np.max(judgement.excess)) < FAINT


def review_verdict(
    judgement: Judgement, checks: Sequence[Check], catalogue: Mapping[str, EffectFactory]
) -> tuple[Verdict, tuple[str, ...]]:
    """Hold the verdict against the parameters; return it with what may hide in them.

    An effect that leaves a part of the gap and needs pistons or a mass that the bench has not
    stands for another one. Where the gap is near the noise, a wrong piston tells more than what
    closes it. And where the piston of chamber N is far from its size, the flow map being that of
    valve P, and nothing else that an axis is known by is wrong, valve N is another one.

    Parameters
    ----------
    judgement : Judgement
        From `judge`.
    checks : sequence of Check
        From `check_fit`, of the final model.
    catalogue : mapping of str to effect class
        Effects that may hide in the parameters.

    Returns
    -------
    tuple
        The verdict, and the effects that may hide in the parameters, the most likely first.
    """
    verdict = judgement.verdict
    hidden = absorbed_candidates(checks, catalogue)
    wrong = {check.name for check in checks if not check.agrees}
    wrong_area = bool(wrong & set(AREAS))
    # A cause in no list may spoil both areas alike; one beside the other is a matter of the valves.
    hides = "S_N/S_P" in wrong if verdict is Verdict.UNKNOWN else wrong_area
    if verdict is Verdict.NONE or (near_noise(judgement) and hides):
        return (Verdict.ABSORBED, hidden) if hidden else (verdict, ())
    areas = [check for check in checks if check.name in AREAS]
    far = {
        check.name for check in areas if abs(check.value - check.expected) > FAR * check.tolerance
    }
    doubtful = bool(far or "M" in wrong) and judgement.unexplained > DOUBTFUL
    if doubtful and verdict in (Verdict.EFFECT, Verdict.AMBIGUOUS):
        verdict = Verdict.UNKNOWN
    # Friction is left out: an offset of a sensor that shares the gap of another valve acts on it.
    if verdict is Verdict.UNKNOWN and wrong - {"F_c"} == far == {"S_N", "S_N/S_P"}:
        return Verdict.ABSORBED, hidden
    return verdict, ()
