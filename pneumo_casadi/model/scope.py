"""What an effect has and sees: its extra states, and the quantities of the axis."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pneumo_casadi.model.junctions import Expression, Pair


@dataclass(frozen=True, slots=True)
class State:
    """An extra state of an effect.

    Parameters
    ----------
    name : str
        Unique within the effect.
    unit : str
        SI unit.
    scale : float
        Size by which an optimiser divides it.
    clock : bool
        Whether it is the time: along a record it begins at the time of the first sample.
    sampled : bool
        Whether it stays as it is over a sample, and then jumps to what `Effect.renewed` gives.
    """

    name: str
    unit: str
    scale: float = 1.0
    clock: bool = False
    sampled: bool = False


@dataclass(frozen=True, slots=True)
class Scope:
    """The quantities of the axis that an effect can use in its equations.

    Parameters
    ----------
    x, v : Expression
        Position from mid-stroke [m] and velocity [m/s].
    p : Pair
        Chamber pressures, absolute [Pa]; zeros on the force-driven axis.
    direction : Expression
        The smoothed sign of the velocity, between -1 and 1.
    friction : Expression
        Nominal friction force of eq. 4 [N], positive against motion in +x.
    axis : mapping of str to Expression
        The nominal parameters (``"X_s1"``, ``"M"``, ...) and, where the axis has chambers,
        ``"S_P"``, ``"S_N"``, ``"p_ext"``, ``"p_supply"``, ``"T"``, ``"r"``, ``"stroke"``.
    own : mapping of str to Expression
        The effect's parameters and states, by their short names.
    inputs : mapping of str to Expression
        Inputs of the axis by name: ``"u_P"``, ``"u_N"`` [V], ``"F"`` [N] ...
    entering : mapping of str to value
        What has arrived at the effect so far, by overridden junction.

    Examples
    --------
    Inside an effect, ``at["tau"]`` is its own parameter or state `tau`.
    """

    x: Expression
    v: Expression
    p: Pair
    direction: Expression
    friction: Expression
    axis: Mapping[str, Expression]
    own: Mapping[str, Expression] = field(default_factory=dict)
    inputs: Mapping[str, Expression] = field(default_factory=dict)
    entering: Mapping[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Expression:
        return self.own[name]
