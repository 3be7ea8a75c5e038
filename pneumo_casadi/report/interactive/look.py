"""What still and interactive time plots have in common."""

from pneumo_casadi.data.recording.curves import Curves

#: Measured, then the simulations in their order: Okabe and Ito (2008), as in all figures. The first
#: simulation is the thinner line on the wider measured one.
COLOURS = ("#8c8c8c", "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9")

#: Share of a record that is enlarged, and the least of it [s]: a stroke of a laboratory axis takes
#: some tenths of a second.
SHARE, LEAST = 0.08, 0.4


def detail_seconds(curves: Curves) -> float:
    """Return how long the interval is that is drawn enlarged [s]."""
    return max(SHARE * float(curves.t[-1] - curves.t[0]), LEAST)
