"""What still and interactive time plots have in common."""

from pneumo_casadi.data.recording.curves import Curves

#: Measured, then the simulations in their order: Okabe and Ito (2008), as in all figures. The first
#: simulation is the thinner line on the wider measured one.
COLOURS = ("#8c8c8c", "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9")

#: Dashes of the first five simulations, of the next five, and so on: names in SVG and bokeh.
DASHES = ("solid", "dashed", "dotted")

#: Share of a record that is enlarged, and the least of it [s]: a stroke of a laboratory axis takes
#: some tenths of a second.
SHARE, LEAST = 0.08, 0.4


def line_look(k: int) -> tuple[str, str]:
    """Return colour and dash of a curve: 0 is the measured one, then the simulations.

    Examples
    --------
    >>> line_look(1), line_look(6)
    (('#0072B2', 'solid'), ('#0072B2', 'dashed'))
    """
    if k == 0:
        return COLOURS[0], DASHES[0]
    repeats, colour = divmod(k - 1, len(COLOURS) - 1)
    return COLOURS[1 + colour], DASHES[repeats % len(DASHES)]


def swatch(k: int) -> str:
    """Return the CSS background that shows the line of a curve in a legend.

    Examples
    --------
    >>> swatch(1), swatch(6)
    ('#0072B2', 'repeating-linear-gradient(90deg, #0072B2 0 4px, transparent 4px 6px)')
    """
    colour, dash = line_look(k)
    if dash == "solid":
        return colour
    drawn = 4 if dash == "dashed" else 2
    return f"repeating-linear-gradient(90deg, {colour} 0 {drawn}px, transparent {drawn}px 6px)"


def detail_seconds(curves: Curves) -> float:
    """Return how long the interval is that is drawn enlarged [s]."""
    return max(SHARE * float(curves.t[-1] - curves.t[0]), LEAST)
