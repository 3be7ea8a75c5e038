"""Junctions: the places in the physics where an effect can act.

The model computes its values in the order of the physics::

    chamber_pressure -> command -> spool -> supply, outlet -> valve_flow -> line -> chamber_flow
            -> chamber_energy -> capacity -> force -> output

For the force-driven axis it is ``drive -> force -> output``. At each junction the value passes
through all effects, one after the other; each may change it.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NamedTuple

#: A CasADi scalar expression (``casadi.SX`` or ``casadi.MX``), or a number.
Expression = Any


class Pair(NamedTuple):
    """One value for each chamber."""

    P: Expression
    N: Expression


class Supply(NamedTuple):
    """Absolute pressures at the valves' ports [Pa]."""

    p_supply: Expression
    p_ext: Expression


class Junction(StrEnum):
    """Where an effect can act, in the order of the physics."""

    CHAMBER_PRESSURE = "chamber_pressure"
    COMMAND = "command"
    SPOOL = "spool"
    SUPPLY = "supply"
    OUTLET = "outlet"
    VALVE_FLOW = "valve_flow"
    LINE = "line"
    CHAMBER_FLOW = "chamber_flow"
    CHAMBER_ENERGY = "chamber_energy"
    CAPACITY = "capacity"
    DRIVE = "drive"
    FORCE = "force"
    OUTPUT = "output"


#: What acts on the moving mass, whatever volumes or readings change with its motion.
MECHANICAL = frozenset({Junction.DRIVE, Junction.FORCE})

#: What passes through each junction.
JUNCTIONS: Mapping[str, str] = {
    Junction.CHAMBER_PRESSURE: "pressure in each chamber, of that at its sensor [Pa] (Pair)",
    Junction.COMMAND: "voltage sent to each valve [V] (Pair)",
    Junction.SPOOL: "opening of each valve, as the voltage that holds it there [V] (Pair)",
    Junction.SUPPLY: "supply and exhaust pressure at the valves [Pa] (Supply)",
    Junction.OUTLET: "pressure that each valve works against [Pa] (Pair)",
    Junction.VALVE_FLOW: "mass flow through each valve, into the axis [kg/s] (Pair)",
    Junction.LINE: "mass flow that arrives at each chamber [kg/s] (Pair)",
    Junction.CHAMBER_FLOW: "net mass flow into each chamber, leaks included [kg/s] (Pair)",
    Junction.CHAMBER_ENERGY: (
        "mass flow that would raise the pressure equally, heat included [kg/s] (Pair)"
    ),
    Junction.CAPACITY: "mass of air per pressure where each sensor sits [kg/Pa] (Pair)",
    Junction.DRIVE: "force of the drive on the force-driven axis [N]",
    Junction.FORCE: "sum of the forces on the moving mass, inertia excepted [N]",
    Junction.OUTPUT: "what the sensors show: {'p_P': Pa, 'p_N': Pa, 'x': m}",
}
