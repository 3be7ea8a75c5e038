"""Sites: where an unknown term may act, and over which quantity.

A site is a balance (or both mass flows alike), a factor that multiplies the unknown function, and
its driver: ``force: sign(v) · f(x)`` is a friction level over position, ``mass flows: q_m · f(t)``
a valve gain that drifts, ``dq_m/du · f(t)`` a null that does. An error of a sensor is a site too.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pneumo_casadi.data import AxisKind

#: A driver that varies by less than this share of its largest magnitude moves nothing.
LEAST_VARIATION = 1e-3


@dataclass(frozen=True, slots=True)
class Site:
    """Where a term may act.

    Parameters
    ----------
    balances : tuple of str
        ``("force",)``, ``("mass_flow_P",)``, ``("mass_flow_N",)`` or both mass flows.
    factor : str
        What multiplies the function of the driver, as in `Term`.
    driver : str
        See `pneumo_casadi.effects.term.term.DRIVERS`.
    """

    balances: tuple[str, ...]
    factor: str
    driver: str


#: Drivers of a force by factor: what can act on the moving mass directly. Pressures and commands
#: follow the motion, so that without a sign they would stand for the force that they balance.
_FORCE: Mapping[str, tuple[str, ...]] = {
    "1": ("x", "v", "t", "F", "t_reversal", "s_reversal"),
    "sign(v)": (
        *("x", "v", "t", "F", "p_P", "p_N", "p_mean", "p_difference"),
        *("t_reversal", "s_reversal"),
    ),
    "v": ("x", "t", "p_mean"),
}
#: The same of the flow of one chamber, and of both alike; `u` and `p` are those of the chamber.
_FLOW: Mapping[str, tuple[str, ...]] = {
    "1": ("p", "p_difference", "x", "t", "u"),
    "p": ("x", "t"),
    "q_m": ("u", "p", "x", "t"),
    "dq_m/du": ("t",),
}
_FLOWS: Mapping[str, tuple[str, ...]] = {
    "q_m": ("u", "p", "t"),
    "p_supply": ("t",),
    "dq_m/du": ("t",),
    "±dq_m/du": ("t",),
}
#: The same of the errors of sensors: of the position, and of both pressures alike, which may show
#: a share of each other.
_POSITION: Mapping[str, tuple[str, ...]] = {"1": ("x", "t")}
_PRESSURES: Mapping[str, tuple[str, ...]] = {"1": ("p_other", "p", "t")}


def all_sites(kind: AxisKind) -> tuple[Site, ...]:
    """Return the sites of an axis, those included whose driver it may lack."""
    flows = tuple(balance.name for balance in kind.balances if balance.chamber)
    known: dict[tuple[str, ...], Mapping[str, tuple[str, ...]]] = {("force",): _FORCE}
    known |= {(flow,): _FLOW for flow in flows}
    if len(flows) > 1:
        known |= {flows: _FLOWS, ("measurement_P", "measurement_N"): _PRESSURES}
    known[("measurement_x",)] = _POSITION
    return tuple(
        Site(balances, factor, driver)
        for balances, factors in known.items()
        for factor, drivers in factors.items()
        for driver in drivers
    )
