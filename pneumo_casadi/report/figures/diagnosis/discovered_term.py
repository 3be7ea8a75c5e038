"""A discovered term over its driver: the curve that assumes no formula, its band, the formula."""

from matplotlib.figure import Figure

from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.effects.term.term import DRIVERS
from pneumo_casadi.report.figures.style import (
    BLACK,
    BLUE,
    HEAD,
    ORANGE,
    SKY,
    dress,
    legend_above,
    new_figure,
)

#: Unit on an axis by SI unit, and the factor from SI.
_SHOWN = {
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "Pa": ("kPa", 1e-3),
    "kg/s": ("g/s", 1e3),
    "1": ("%", 1e2),
}
_SYMBOLS = {
    "v": r"$\dot x$",
    "p_mean": "mean pressure",
    "p_difference": r"$p_P - p_N$",
    "t_reversal": "time since the last reversal",
    "s_reversal": "travel since the last reversal",
}


def discovered_term_figure(discovered: DiscoveredTerm) -> Figure:
    """Draw a discovered term over its driver.

    Parameters
    ----------
    discovered : DiscoveredTerm
        With its curve. A term that repeats is drawn over one period.
    """
    term, curve = discovered.term, discovered.curve
    unit, factor = _SHOWN.get(DRIVERS[term.driver], (DRIVERS[term.driver], 1.0))
    term_unit, scale = _SHOWN.get(term.unit, (term.unit, 1.0))
    figure = new_figure(48.0, head=HEAD)
    axes = figure.subplots()
    d = curve.driver * factor
    low, high = ((curve.value + side * curve.band) * scale for side in (-1, 1))
    axes.fill_between(d, low, high, color=SKY, alpha=0.6, linewidth=0, label="95 % band")
    axes.plot(d, curve.value * scale, color=BLUE, linewidth=0.8, label="curve without a formula")
    axes.plot(
        d, curve.formula * scale, color=ORANGE, linewidth=1.0, linestyle="--", label="formula"
    )
    axes.axhline(0, color=BLACK, linewidth=0.5, zorder=1)
    symbol = _SYMBOLS.get(term.driver, f"${term.driver}$")
    symbol += " within one period" if term.law.periodic else ""
    kind = "relative change" if term.unit == "1" else "term"
    dress(axes, f"{symbol} [{unit}]", f"{kind} [{term_unit}]")
    axes.set_xlim(float(d[0]), float(d[-1]))
    legend_above(axes, 3)
    return figure
