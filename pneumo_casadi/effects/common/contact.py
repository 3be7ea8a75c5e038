"""A play between two parts: how far they have pressed into each other, beyond the gap."""

from typing import Any

import casadi as ca

from pneumo_casadi.parameters import Parameter

#: Distance over which a contact sets in [m].
EDGE = 3e-6
#: Plays that a fit tells from a joint that gives [m].
CREDIBLE_PLAY = {"gap": (1e-4, 2e-2)}
#: What both forms of a play between two masses have.
PLAY = Parameter(
    "gap",
    0.0,
    "m",
    lower=0.0,
    upper=2e-2,
    scale=2e-4,
    null=0.0,
    start=1e-3,
    description="width b of the play, from contact to contact",
    source="0.1-5 mm, engineering judgement for clevis pins and couplings",
)


def within(e: Any, half: Any) -> Any:
    """Return the distance e [m] of two parts, clipped to the play ± half, with rounded edges.

    It is zero at a play of zero, where its derivative to the play is half the sign of e.
    """
    return (ca.sqrt((e + half) ** 2 + EDGE**2) - ca.sqrt((e - half) ** 2 + EDGE**2)) / 2


def touching(e: Any, half: Any) -> Any:
    """Return 1 where the parts touch and 0 within the play: the derivative of e − within(e)."""
    beyond, before = e + half, e - half
    inside = beyond / ca.sqrt(beyond**2 + EDGE**2) - before / ca.sqrt(before**2 + EDGE**2)
    return 1 - inside / 2
