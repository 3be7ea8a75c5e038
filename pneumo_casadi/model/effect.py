"""The base class of effects: physics that the nominal axis leaves out.

An effect overrides the junctions (see `junctions`) that it changes, and declares its parameters and
extra states. Effects do not import the model, and the model does not name any effect.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, ClassVar

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.absorption import PARAMETER_CHECKS, Absorption
from pneumo_casadi.model.junctions import Expression, Junction, Pair, Supply
from pneumo_casadi.model.scope import Scope as Scope
from pneumo_casadi.model.scope import State as State
from pneumo_casadi.parameters import Parameter

#: What an effect can be confused with on the nominal axis: parameters, and the flow map.
NOMINAL: tuple[str, ...] = (
    *(f"X_s{i}" for i in range(1, 7)),
    "M",
    "f_v",
    "F_c_plus",
    "F_c_minus",
    "v_s",
    "flow coefficients",
)

#: Attributes that name parameters of the effect.
_NAMING_PARAMETERS = (
    "credible",
    "scanned",
    "staircase",
    "command_delays",
    "flow_delays",
    "sensor_delays",
    "sensor_offsets",
)


class Effect:
    """Base of all effects: it changes nothing.

    Subclass it, give `name`, `parameters` and, where needed, `states`, and override the
    junctions at which the effect acts. Each junction method takes the value of a quantity without
    the effect and returns its value with the effect. At the null values of the parameters the two
    must be equal.

    Attributes
    ----------
    name : str
        Name in the catalogue, in results and in parameter names (``"stribeck.delta_F"``).
    parameters : tuple of Parameter
        With unit, bounds, null value, starting value, description and source; short names.
    states : tuple of State
        Extra states; their rates come from `rates`, their start from `rest`.
    cause : str
        Name of the family that the effect is a form of, by default its own name. Forms of one
        cause are rivals: a diagnosis keeps the one that fits best, and names the cause.
    equation : str
        What is added to the nominal axis, as plain text.
    source : str
        Where the form comes from.
    shows : str
        Where the effect shows: which balance or sensor, in which regime.
    confused_with : tuple of str
        Effects of the catalogue and nominal parameters (`NOMINAL`) with a similar response.
    separated_by : str
        The experiment that distinguishes it from these.
    generalises : str
        Name of the form of the same cause that this one contains as a special case, such as both
        valves alike where each has a size of its own here. A diagnosis tries this form where it
        promises more than the one it contains, or where its cause leads.
    passive : bool
        Whether it only takes energy from the motion, or gives back what it has stored.
    credible : mapping of str to (float, float)
        Plausible ranges by short name of a parameter. An estimate outside its range means that
        another cause is fitted by this effect.
    command_delays : tuple of str
        Parameters that delay the command [s], by short name. If all are less than a sampling
        interval, that is when samples were taken and the command was updated, and no property of
        the axis.
    flow_delays : tuple of str
        Parameters by which all flow arrives late [s], by short name: a command that acts late looks
        nearly the same.
    sensor_delays : tuple of str
        Parameters by which what `sensors` show is late [s], by short name.
    sensor_offsets : tuple of str
        Parameters by which what `sensors` show is too much, by short name.
    one_form : bool
        Whether the effect can hardly follow another law, as an offset, a leak or a shifted null. If
        such an effect is the cause, the model with it closes the gap almost entirely. Friction and
        hysteresis, in contrast, may follow other laws than those of the catalogue.
    sensors : tuple of str
        Outputs (``"p_P"``, ``"p_N"``, ``"x"``) that `output` changes, for a sensor effect; empty
        for an effect of the axis itself.
    hides_motion : bool
        Whether the motion cannot be computed back from what the sensors show: while a play is
        crossed they stand still, and undoing a long delay amplifies noise. Such an effect is
        judged by simulation. Other sensor effects, such as a lag, are inverted along the measured
        motion. See `hides`.
    absorbed_by : Absorption or None
        Which checks of the parameters fail if a refit of the nominal axis absorbs the effect, so
        that trajectories show no gap; None for an effect that no parameter can take up.
    masses : tuple of str
        Short names of parameters that are masses [kg] moved with the load. They are added to M
        before it is compared with the moving mass of the data sheet.
    metered : bool
        Whether the effect is present while the flow map of the valve is metered, because it
        belongs to the shape of the valve. Its action at the spool must then agree with the
        metered points.
    measured_by : str
        Signal that, if it is recorded, already contains the effect, such as ``"p_supply"`` for a
        supply that droops; empty if there is none.
    through_states : bool
        Whether force or flow reach the axis by way of the states alone, as through a spring. A fit
        to the balances then needs derivatives of these states to the nominal parameters too.
    scanned : mapping of str to tuple of float
        Values of parameters; a fit to the balances starts from the best of their combinations.
        The cost of a resonance has a narrow valley, which no step finds from afar.
    staircase : tuple of str
        Parameters over which the cost is a staircase, declared with ``free=False``. The scans of a
        diagnosis find them, in this order, see `stairs`; elsewhere they are held. Such a form is
        tried only where the other forms of its cause leave too much.
    needs_chambers : bool
        Whether the effect reads chamber pressures; it then cannot be added to a force-driven
        axis. Set it also if the effect reads pressures but overrides only junctions that every axis
        has, for example a friction force that depends on the pressures.
    needs_constants : tuple of str
        Constants of the bench that the effect reads, such as ``"stroke"``; it cannot be added to an
        axis whose bench does not state them.

    Notes
    -----
    `equation`, `source`, `shows`, `separated_by` and `passive` are for reports and documentation;
    an effect of your own does not need them. Beside an effect that hides the motion, a diagnosis
    also tries those of its `confused_with`.

    Examples
    --------
    >>> class Drag(Effect):
    ...     '''Quadratic drag, F = c v |v|.'''
    ...
    ...     name = "drag"
    ...     parameters = (Parameter("c", 0.0, "N s2/m2", lower=0.0, scale=50.0, null=0.0),)
    ...
    ...     def force(self, F, at):
    ...         return F - at["c"] * at.v * abs(at.v)
    >>> Drag().junctions
    ('force',)
    """

    name: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    states: ClassVar[tuple[State, ...]] = ()
    equation: ClassVar[str] = ""
    source: ClassVar[str] = ""
    shows: ClassVar[str] = ""
    confused_with: ClassVar[tuple[str, ...]] = ()
    separated_by: ClassVar[str] = ""
    cause: ClassVar[str] = ""
    generalises: ClassVar[str] = ""
    passive: ClassVar[bool] = False
    credible: ClassVar[Mapping[str, tuple[float, float]]] = MappingProxyType({})
    command_delays: ClassVar[tuple[str, ...]] = ()
    flow_delays: ClassVar[tuple[str, ...]] = ()
    sensor_delays: ClassVar[tuple[str, ...]] = ()
    sensor_offsets: ClassVar[tuple[str, ...]] = ()
    one_form: ClassVar[bool] = False
    sensors: ClassVar[tuple[str, ...]] = ()
    hides_motion: ClassVar[bool] = False
    absorbed_by: ClassVar[Absorption | None] = None
    masses: ClassVar[tuple[str, ...]] = ()
    metered: ClassVar[bool] = False
    measured_by: ClassVar[str] = ""
    through_states: ClassVar[bool] = False
    scanned: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType({})
    staircase: ClassVar[tuple[str, ...]] = ()
    needs_chambers: ClassVar[bool] = False
    needs_constants: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if not cls.name.isidentifier():
            raise ModelError(f"effect {cls.__name__}: name {cls.name!r} must be an identifier")
        names = [item.name for item in cls.parameters] + [item.name for item in cls.states]
        if len(set(names)) < len(names):
            raise ModelError(f"effect {cls.name}: parameters and states need different names")
        without = [item.name for item in cls.parameters if item.null is None]
        if without:
            raise ModelError(f"effect {cls.name}: no null value for {', '.join(without)}")
        for attribute in _NAMING_PARAMETERS:
            strange = sorted(set(getattr(cls, attribute)) - {item.name for item in cls.parameters})
            if strange:
                raise ModelError(
                    f"effect {cls.name}: {attribute} names no parameter: {', '.join(strange)}"
                )
        _check_jumps(cls)
        cls.cause = cls.__dict__.get("cause", "") or cls.name
        known = () if cls.absorbed_by is None else cls.absorbed_by.names
        strange = sorted(set(known) - set(PARAMETER_CHECKS))
        if strange:
            raise ModelError(
                f"effect {cls.name}: absorbed_by names no check: {', '.join(strange)}; there are "
                f"{', '.join(PARAMETER_CHECKS)}"
            )

    @property
    def junctions(self) -> tuple[str, ...]:
        """Junctions that this effect overrides, in the order of the physics."""
        own = type(self)
        return tuple(str(j) for j in Junction if getattr(own, j) is not getattr(Effect, j))

    @classmethod
    def on_metered(cls, low: float, high: float) -> "EffectFactory":
        """Return the factory of the effect for a valve metered from `low` to `high` [V]."""
        return cls

    @classmethod
    def prior_rows(cls) -> Iterable[Mapping[str, float]]:
        """Return what is known of the parameters before any record: weights by short name.

        Each row, the sum of weight times value, is a standard normal variable. For a curve,
        the rows are its differences divided by the expected roughness.
        """
        return ()

    @classmethod
    def credible_at(cls, values: Mapping[str, float]) -> Mapping[str, tuple[float, float]]:
        """Return the plausible ranges at these values of the parameters, by short name.

        Those of `credible`, unless the range of one depends on another.
        """
        del values
        return cls.credible

    def hides(self, values: Mapping[str, float], bandwidth: float) -> bool:
        """Return whether the motion is hidden at these values of the parameters, by short name.

        `bandwidth` is the highest frequency of the motion that is taken from the measurements
        [rad/s].
        """
        del values, bandwidth
        return self.hides_motion

    def swings(self, values: Mapping[str, float]) -> tuple[complex, ...]:
        """Return the poles [rad/s] with which the effect's force swings on by itself.

        At these values of the parameters, by short name. How such a motion was going when a record
        begins is unknown: a fit to the balances leaves it out.
        """
        del values
        return ()

    def stairs(self, values: Mapping[str, float]) -> dict[str, tuple[float, ...]]:
        """Return the values to try of each parameter in `staircase`, by short name.

        `values` are the present ones, first those of the start or the best scanned ones. One
        parameter after another goes to the middle of the stair that costs least.
        """
        raise ModelError(f"effect {self.name}: override `stairs` for {', '.join(self.staircase)}")

    def rest(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Return the states at which the effect is at rest, by short name; zeros by default."""
        del entering, at
        return {state.name: 0.0 for state in self.states}

    def rates(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Return the time derivative of each state, by short name; sampled ones have none.

        `entering` holds, per overridden junction, the value that arrived at this effect.
        """
        if all(state.sampled for state in self.states):
            return {}
        raise ModelError(f"effect {self.name} has states but no rates: override `rates`")

    def renewed(self, entering: Mapping[str, Any], at: Scope) -> dict[str, Expression]:
        """Return the sampled states after a sample, by short name; see `State.sampled`."""
        raise ModelError(f"effect {self.name} has sampled states: override `renewed`")

    def chamber_pressure(self, p: Pair, at: Scope) -> Pair:
        """Return the pressure in each chamber, of that at its sensor [Pa]."""
        return p

    def command(self, u: Pair, at: Scope) -> Pair:
        """Return the voltage sent to each valve [V]."""
        return u

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Return the opening of each valve, as the voltage that holds it there [V]."""
        return u

    def supply(self, ports: Supply, at: Scope) -> Supply:
        """Return supply and exhaust pressure at the valves [Pa]."""
        return ports

    def outlet(self, p: Pair, at: Scope) -> Pair:
        """Return the pressure that each valve works against [Pa]."""
        return p

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Return the mass flow through each valve, into the axis [kg/s]."""
        return q_m

    def line(self, q_m: Pair, at: Scope) -> Pair:
        """Return the mass flow that arrives at each chamber [kg/s]."""
        return q_m

    def chamber_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Return the net mass flow into each chamber, leaks included [kg/s]."""
        return q_m

    def chamber_energy(self, q_m: Pair, at: Scope) -> Pair:
        """Return the mass flow that alone raises the pressure equally, heat included [kg/s]."""
        return q_m

    def capacity(self, C: Pair, at: Scope) -> Pair:
        """Return the mass of air per pressure where each sensor sits [kg/Pa]."""
        return C

    def drive(self, F: Expression, at: Scope) -> Expression:
        """Return the force that drives the mass, on axes without valves [N]."""
        return F

    def force(self, F: Expression, at: Scope) -> Expression:
        """Return the sum of the forces on the moving mass, inertia excepted [N]."""
        return F

    def output(self, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        """Return what the sensors show, by channel [Pa, m]."""
        return y


#: A callable that returns an effect, usually its class.
EffectFactory = Callable[[], Effect]


def _check_jumps(effect: type[Effect]) -> None:
    """Refuse staircases that a fit would take for slopes, and sampled states without a law."""
    free = [item.name for item in effect.parameters if item.free and item.name in effect.staircase]
    if free:
        raise ModelError(f"effect {effect.name}: {', '.join(free)} in staircase, needs free=False")
    if effect.staircase and effect.stairs is Effect.stairs:
        raise ModelError(f"effect {effect.name}: override `stairs` for its staircase")
    sampled = [state for state in effect.states if state.sampled]
    if sampled and effect.renewed is Effect.renewed:
        raise ModelError(f"effect {effect.name} has sampled states: override `renewed`")
    if any(state.clock for state in sampled):
        raise ModelError(f"effect {effect.name}: a clock is no sampled state")
