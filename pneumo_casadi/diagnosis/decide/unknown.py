"""The rule for the verdict ``unknown``: how much of a gap the best effects may leave.

`judgement.judge` asks without the parameter checks; where the cause is unknown but no gap is
visible, its verdict is ``none``. `credibility.review_verdict` asks again with the checks, unless
the verdict is ``none`` or may be ``absorbed``; it turns ``unknown`` into ``absorbed`` if the
parameters show that the valve of chamber N differs.
"""

from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria


def is_unknown(
    share_left: float,
    accepted: bool = True,
    visible: bool = True,
    one_form_left: float = 0.0,
    implausible: bool = False,
    criteria: Criteria = CRITERIA,
) -> bool:
    """Decide whether the cause of a gap is unknown.

    It is unknown if no effect was accepted, or if the effects of the final model leave too much of
    the gap. Less may be left in a balance whose effects have one form only, so that no other form
    of them could explain the remainder, and if the fitted parameters are implausible.

    Parameters
    ----------
    share_left : float
        Share of the held-out gap that the final model leaves in its worst balance; see
        `unexplained`.
    accepted : bool, optional
        Whether the selection accepted an effect.
    visible : bool, optional
        Whether what is left is clear of the noise.
    one_form_left : float, optional
        The same share, in the balances in which effects of one form alone act.
    implausible : bool, optional
        Whether mass or piston areas contradict geometry or data sheet.
    criteria : Criteria, optional
        How much may be left.

    Examples
    --------
    >>> is_unknown(0.3), is_unknown(0.6), is_unknown(0.0, accepted=False)
    (False, True, True)
    >>> is_unknown(0.3, one_form_left=0.1), is_unknown(0.3, implausible=True)
    (True, True)
    """
    if not accepted or (visible and share_left > criteria.unexplained):
        return True
    if one_form_left > criteria.one_form:
        return True
    return implausible and share_left > criteria.contradicted
