r"""Opening laws of a metering edge: its conductance C [m³/(s Pa)] over the command.

Both laws begin with the clearance, whose rounding w lets an edge that overlaps leak a little:

.. math:: s = (u - u_0 + \sqrt{(u - u_0)^2 + w^2}) / 2

and both rise with u everywhere, so that the mass flow does.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.parameters import Parameter, Parameters

SOURCE = "ISO 6358-1:2013"
#: Openings at which a curve states its slope, as shares of the largest command of its sign: closer
#: where an edge begins to open, for there an axis works and there ports have their shape.
KNOTS = (0.0, 0.05, 0.15, 0.4, 1.0)


#: Standard deviation of a slope of a curve about that of the hyperbola through the same map, over
#: the larger of this slope and the mean one: notched and round ports differ by a third to a half.
LIKE_HYPERBOLA = 0.5
#: Supply pressure over the one that was stated, and its standard deviation: manometers are of
#: class 1 to 1.6. Near the supply pressure the flow is steep, and half a per cent shows.
SUPPLY_RATIO, MANOMETER = "supply_ratio", 0.01
SIDES = ("supply", "exhaust")


def reach_of(u_range: tuple[float, float]) -> tuple[float, float]:
    """Return the largest command metered of each edge [V]; of both if one edge has none."""
    largest = max(abs(u_range[0]), abs(u_range[1]))
    supply, exhaust = (float(u) if u > 0 else float(largest) for u in (u_range[1], -u_range[0]))
    return supply, exhaust


def known_laws() -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of the parameters of a valve whose edges open by either law."""
    at = {f"{name}_{side}": 0.5 for name in ("k", "u_0", "w", "h", "C_leak", "b") for side in SIDES}
    laws = (
        [item for side in SIDES for item in hyperbola_parameters(side, 1.0, 1.0)],
        [item for side in SIDES for item in curve_parameters(at, side, 1.0)],
    )
    hyperbola, curve = (frozenset({*(item.name for item in law), "m"}) for law in laws)
    return hyperbola, curve | {SUPPLY_RATIO}


def conductance(at: Mapping[str, Any], side: str, command: Any, reach: float) -> Any:
    """Return the conductance of one side's edge [m³/(s Pa)].

    Parameters
    ----------
    at : mapping of str to expression
        Parameters of the valve; ``k_1_<side>`` among them makes its opening a curve.
    side : str
        ``supply`` or ``exhaust``.
    command : expression
        What opens this edge, u or −u [V].
    reach : float
        Largest command metered of its sign [V].
    """
    s = _opened(at, side, command)
    if _slope(1, side) in at:
        slopes = [at[_slope(j, side)] for j in range(1, len(KNOTS) + 1)]
        return at[f"C_leak_{side}"] + _rise(s, slopes, [share * reach for share in KNOTS])
    return at[f"C_leak_{side}"] + at[f"k_{side}"] * s / (1 + at[f"h_{side}"] * s)


def hyperbola_parameters(side: str, k: float, reach: float) -> list[Parameter]:
    """Return the start of the law C_leak + k s/(1 + h s) with the gain k [m³/(s Pa V)]."""
    gain = _parameter(f"k_{side}", k, "m³/(s Pa V)", (0.0, np.inf), k, "conductance gain")
    limits = (0.0, 1e3 / reach)
    saturation = _parameter(f"h_{side}", 0.01 / reach, "1/V", limits, 0.1 / reach, "saturation")
    u_0, w, C_leak, b = _clearance(side, k, reach)
    return [gain, u_0, w, saturation, C_leak, b]


def curve_parameters(hyperbola: Mapping[str, float], side: str, reach: float) -> list[Parameter]:
    """Return the start of the law C_leak + ∫k(s) ds from a hyperbola fitted to the same map.

    k(s) is linear between its values k_1 … k_5 at the openings `KNOTS` and constant beyond.
    """
    k, h = hyperbola[f"k_{side}"], hyperbola[f"h_{side}"]
    mean = k / (1 + h * reach)
    slopes = []
    for j, share in enumerate(KNOTS, 1):
        slope = k / (1 + h * share * reach) ** 2
        what = f"conductance gain at {share:.0%} of the largest opening"
        known = (slope, "m³/(s Pa V)", (0.0, np.inf), max(slope, mean), what)
        slopes.append(_parameter(_slope(j, side), *known))
    clearance = Parameters(_clearance(side, mean, reach))
    begun = clearance.with_values({name: hyperbola[name] for name in clearance.names})
    return [*slopes, *begun]


def known_before(parameters: Parameters) -> dict[str, float]:
    """Return the standard deviations of what is known of a curve's parameters before any map."""
    slopes = {_slope(j, side) for j in range(1, len(KNOTS) + 1) for side in SIDES}
    std = {item.name: LIKE_HYPERBOLA * item.scale for item in parameters if item.name in slopes}
    return std | ({SUPPLY_RATIO: MANOMETER} if SUPPLY_RATIO in parameters else {})


def subsonic_index(m: float) -> Parameter:
    """Return the start of the subsonic index of both edges."""
    return _parameter("m", m, "1", (0.1, 2.0), 0.1, "subsonic index")


def supply_ratio() -> Parameter:
    """Return the start of the ratio of the supply pressure to the one that was stated."""
    return _parameter(SUPPLY_RATIO, 1.0, "1", (0.8, 1.2), MANOMETER, "supply over the stated one")


def _clearance(side: str, k: float, reach: float) -> list[Parameter]:
    """Return what both laws have, and the critical ratio of the edge."""
    C = k * reach
    w = (1e-4 * reach, reach)
    return [
        _parameter(f"u_0_{side}", 0.0, "V", (-reach, reach), 0.02 * reach, "opening point"),
        _parameter(f"w_{side}", 0.02 * reach, "V", w, 0.02 * reach, "rounding"),
        _parameter(f"C_leak_{side}", 0.01 * C, "m³/(s Pa)", (0.0, np.inf), 0.01 * C, "leakage"),
        _parameter(f"b_{side}", 0.3, "1", (0.0, 0.95), 0.1, "critical pressure ratio"),
    ]


def _slope(j: int, side: str) -> str:
    return f"k_{j}_{side}"


def _opened(at: Mapping[str, Any], side: str, command: Any) -> Any:
    x, w = command - at[f"u_0_{side}"], at[f"w_{side}"]
    return (x + ca.sqrt(x * x + w * w)) / 2


def _rise(s: Any, slopes: list[Any], knots: list[float]) -> Any:
    """Return the integral of the slopes from 0 to s."""
    beyond = [ca.fmax(s - knot, 0.0) ** 2 for knot in knots]
    rise = slopes[0] * s
    for j, (low, high) in enumerate(pairwise(knots)):
        step = (beyond[j] - beyond[j + 1]) / (2 * (high - low))
        rise += (slopes[j + 1] - slopes[j]) * step
    return rise


def _parameter(
    name: str, value: float, unit: str, bounds: tuple[float, float], scale: float, what: str
) -> Parameter:
    return Parameter(name, value, unit, *bounds, scale=scale, description=what, source=SOURCE)
