"""A play between two parts: how far they have pressed into each other, beyond the gap."""

from typing import Any

import casadi as ca

#: Distance over which a contact sets in [m].
EDGE = 3e-6
#: Plays that a fit tells from a joint that gives [m].
CREDIBLE_PLAY = {"gap": (1e-4, 2e-2)}


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
