"""Review of a verdict: effects whose model needs implausible parameters are not credible."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.checks.absorbed import absorbed_candidates
from pneumo_casadi.diagnosis.decide.judgement import Judgement
from pneumo_casadi.diagnosis.decide.unknown import is_unknown
from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import in_floors
from pneumo_casadi.model.effect import EffectFactory

#: Checks of piston areas.
AREAS = ("S_P", "S_N", "S_N/S_P")
#: The mass flow balance of chamber N among those of an axis with valves.
CHAMBER_N = 1


def near_noise(judgement: Judgement) -> bool:
    """Return whether the gap is near the noise in all balances."""
    return float(np.max(judgement.excess)) < in_floors(judgement.criteria.near_noise)


def only_in_chamber_N(judgement: Judgement) -> bool:
    """Return whether no gap is visible but in the mass flow of chamber N.

    Another valve N leaves none elsewhere: of some 60 on the virtual bench, with weak effects
    besides or without, at most 1.4 floors in chamber P and 1.0 in the force balance.
    """
    elsewhere = np.delete(judgement.excess, CHAMBER_N)
    return bool(np.all(elsewhere <= in_floors(judgement.criteria.visible)))


def may_be_valve_N(judgement: Judgement) -> bool:
    """Return whether another valve N may be behind the gap.

    Where effects are named they may act in chamber P and in the force balance besides, but of the
    mass flows that of chamber N has the larger gap.
    """
    if judgement.verdict is Verdict.UNKNOWN:
        return only_in_chamber_N(judgement)
    return int(np.argmax(judgement.excess[:-1])) == CHAMBER_N


def leaves_less_than_absorbed(judgement: Judgement, checks: Sequence[Check]) -> bool:
    """Return whether less of the flow of chamber N is left than its piston area has absorbed.

    A valve N of another size scales the flow, and the area takes that up; what its edges differ by
    is less: on the virtual bench at most a third. A leak of chamber N that the catalogue lacks
    shifts the area too, and leaves four times as much.
    """
    (ratio,) = (check for check in checks if check.name == "S_N/S_P")
    return bool(judgement.gap[CHAMBER_N] < abs(ratio.value / ratio.expected - 1.0))


def review_verdict(
    judgement: Judgement, checks: Sequence[Check], catalogue: Mapping[str, EffectFactory]
) -> tuple[Verdict, tuple[str, ...]]:
    """Review a verdict by the parameter checks; return it with the effects possibly absorbed.

    Four rules: (1) Without a gap the verdict is ``absorbed`` if a failed check points to an effect,
    and with one near the noise if the ratio of the piston areas does: an unlisted cause may shift
    both areas alike, their ratio is shifted by the valves only. (2) An effect that leaves a part of
    the gap and needs an implausible mass or piston area is not credible: the cause is unknown.
    Another area of piston N alone, with the mass flows explained, is none of the effect's.
    (3) If the area of piston N is far off and nothing else is, the cause is valve N: the flow map
    is that of valve P; less of the flow must be left than the area has absorbed. (4) Where effects
    are named and the areas are as in (3), valve N differs besides, whatever is left. With a gap,
    (1) asks that of the mass flows that of chamber N has the larger one; where the cause is
    unknown, (1) and (3) ask that it is visible there only.

    Parameters
    ----------
    judgement : Judgement
        From `judge`.
    checks : sequence of Check
        From `check_fit`, of the final model.
    catalogue : mapping of str to effect class
        Effects that the parameters may have absorbed.

    Returns
    -------
    tuple
        The verdict, and the effects that the parameters may have absorbed, the most likely first.
    """
    verdict = judgement.verdict
    if verdict is Verdict.NONE:
        absorbed = absorbed_candidates(checks, catalogue)
        return (Verdict.ABSORBED, absorbed) if absorbed else (verdict, ())
    failed = {check.name for check in checks if not check.agrees}
    absorbed = absorbed_candidates(checks, catalogue, shown_by=("S_N/S_P",))
    if absorbed and near_noise(judgement) and may_be_valve_N(judgement):
        return Verdict.ABSORBED, absorbed
    far = {
        check.name
        for check in checks
        if check.name in AREAS
        and abs(check.value - check.expected) > judgement.criteria.far * check.tolerance
    }
    # Friction is left out: a sensor offset, present beside another valve, shifts it.
    valve_N = failed - {"F_c"} == far == {"S_N", "S_N/S_P"}
    # Where the flows are explained, a piston N that is off is no misfit of an effect's form.
    implausible = bool(far or "M" in failed) and not (valve_N and judgement.explains_flows)
    if verdict is not Verdict.UNKNOWN and is_unknown(
        max(judgement.unexplained, judgement.left_open),
        visible=False,  # `judge` has asked what is left; here only the parameters count
        implausible=implausible,
        criteria=judgement.criteria,
    ):
        verdict = Verdict.UNKNOWN
    if not valve_N:
        return verdict, ()
    if verdict is Verdict.UNKNOWN:
        is_valve_N = only_in_chamber_N(judgement) and leaves_less_than_absorbed(judgement, checks)
        return (Verdict.ABSORBED, absorbed) if is_valve_N else (verdict, ())
    return verdict, absorbed
