"""Effects of the virtual bench: parameters, three severities, and what may absorb them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.kernels.gas import RHO_0

#: Least time constant that the bench follows [s]: a hundredth of the sampling period at 1 kHz.
SHORTEST = 1e-5


class Severity(Enum):
    """How much of an effect."""

    SMALL = "small"
    MEDIUM = "medium"
    LARGE = "large"


@dataclass(frozen=True, slots=True)
class Size:
    """One physical quantity of an effect.

    Parameters
    ----------
    name : str
        Symbol.
    unit : str
        SI unit.
    values : tuple of float
        Small, medium and large, in multiples of `scale`.
    scale : str
        Key of `scales`: what of the axis it goes with; ``"1"`` for absolute values.
    off : float
        Value at which the effect is not there.
    signed : bool
        Whether nature may choose the sign.
    fixed : bool
        Whether it is the same on every axis, as an exponent that makes the form what it is.
    description : str
        What it is.
    """

    name: str
    unit: str
    values: tuple[float, float, float]
    scale: str = "1"
    off: float = 0.0
    signed: bool = False
    fixed: bool = False
    description: str = ""


@dataclass(frozen=True, slots=True)
class EffectForm:
    """One effect as the virtual bench simulates it.

    Parameters
    ----------
    name : str
        As in the catalogue of effects, where it is listed there.
    equation : str
        Equation of the virtual bench; it differs from that of the catalogue.
    sizes : tuple of Size
        Its quantities.
    absorbed_by : tuple of str
        Parameters of the nominal model that may absorb the effect in a fit; empty if none can.
    note : str
        What measurements reveal about the effect.
    listed : bool
        Whether the effect is in the catalogue of effects. If it is not, the correct verdict of a
        diagnosis is ``unknown``.
    metered : bool
        Whether it belongs to the shape of the valve, so that the flow map shows it.
    step : float
        Longest time step with which it is integrated [s].
    time_constant : str
        Quantity than which the time step must not be longer; empty if there is none.
    cause : str
        Name of the cause that it is a form of; by default its own.
    kernel : str
        Prefix under which the kernels read its quantities; by default its cause.
    constants : mapping of str to float
        Numbers that make the form, by the names under which the kernels read them.
    strength : tuple of str
        Quantities in proportion to which it acts; empty if it cannot be made weak by a factor.
    driver : str
        For an effect of no catalogue, what it depends on: ``"x"``, ``"v"``, ``"t"``, ``"p"``.
    """

    name: str
    equation: str
    sizes: tuple[Size, ...]
    absorbed_by: tuple[str, ...] = ()
    note: str = ""
    listed: bool = True
    metered: bool = False
    step: float = 1e-4
    time_constant: str = ""
    cause: str = ""
    kernel: str = ""
    constants: Mapping[str, float] = field(default_factory=dict)
    strength: tuple[str, ...] = ()
    driver: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "cause", self.cause or self.name)
        object.__setattr__(self, "kernel", self.kernel or self.cause)


@dataclass(frozen=True, slots=True)
class VirtualEffect:
    """An effect of a certain size: the label of a recording.

    Parameters
    ----------
    form : EffectForm
        Its form.
    parameters : mapping of str to float
        Its quantities [SI].
    severity : Severity or None
        None where the quantities were given by hand.
    """

    form: EffectForm
    parameters: Mapping[str, float]
    severity: Severity | None = None

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.form.name

    def as_dict(self) -> dict[str, object]:
        """Return the label as plain data."""
        units = {size.name: size.unit for size in self.form.sizes}
        return {
            "name": self.name,
            "cause": self.form.cause,
            "severity": None if self.severity is None else self.severity.value,
            "parameters": {
                name: {"value": value, "unit": units[name]}
                for name, value in self.parameters.items()
            },
            "equation": self.form.equation,
            "listed": self.form.listed,
            "absorbed_by": list(self.form.absorbed_by),
            "note": self.form.note,
        }


def scales(axis: VirtualAxis) -> Mapping[str, float]:
    """Return the quantities of an axis with which effects are sized [SI].

    ``F_c`` mean Coulomb friction, ``M`` mass, ``l`` stroke, ``C`` conductance of a supply edge
    opened by 1 V, ``q`` its choked flow, and quotients of these.
    """
    F_c = (axis.F_c_plus + axis.F_c_minus) / 2
    C = axis.valve.k_supply
    q = C * axis.p_supply * RHO_0
    return {
        "1": 1.0,
        "F_c": F_c,
        "M": axis.M,
        "l": axis.stroke,
        "F_c/l": F_c / axis.stroke,
        "C": C,
        "q": q,
        "q/p": q / axis.p_supply,
    }


def effect_at_severity(
    form: EffectForm, severity: Severity, axis: VirtualAxis, seed: int | None = None
) -> VirtualEffect:
    """Return an effect at a severity.

    Parameters
    ----------
    form : EffectForm
        Which.
    severity : Severity
        How much.
    axis : VirtualAxis
        Whose scales count.
    seed : int, optional
        Where given, sizes are scattered by up to 20 % and signs are drawn.
    """
    # Named in the seed, so that an effect is the same whatever else there is.
    rng = None if seed is None else np.random.default_rng([seed, 2, *form.name.encode()])
    column = list(Severity).index(severity)
    known = scales(axis)
    parameters = {}
    for size in form.sizes:
        value = size.values[column] * known[size.scale]
        if rng is not None and not size.fixed:
            value *= float(np.exp(rng.uniform(-0.18, 0.18)))
            if size.signed and rng.random() < 0.5:
                value = -value
        parameters[size.name] = value
    return VirtualEffect(form, MappingProxyType(parameters), severity)


def effect_from_quantities(
    form: EffectForm, parameters: Mapping[str, float], axis: VirtualAxis
) -> VirtualEffect:
    """Return an effect with given quantities [SI], those not named at their medium values.

    Raises
    ------
    ModelError
        If a quantity is unknown.
    """
    medium = effect_at_severity(form, Severity.MEDIUM, axis)
    unknown = sorted(parameters.keys() - medium.parameters.keys())
    if unknown:
        raise ModelError(
            f"{form.name}: no quantity {', '.join(unknown)}; there are "
            f"{', '.join(medium.parameters)}"
        )
    return VirtualEffect(form, MappingProxyType({**medium.parameters, **parameters}))


def longest_step(effects: Sequence[VirtualEffect]) -> float:
    """Return the longest time step that all effects bear [s].

    Raises
    ------
    ModelError
        If a time constant is positive, but so short that a recording would take hours.
    """
    limits = [1e-4, *(effect.form.step for effect in effects)]
    for effect in effects:
        name = effect.form.time_constant
        value = effect.parameters[name] if name else 0.0
        value *= min(1.0, effect.form.constants.get("at_N", 1.0))
        if 0 < value < SHORTEST:
            raise ModelError(
                f"{effect.name}: {name} = {value:g} s is too short for the bench, {SHORTEST:g} s "
                "is the least; leave the effect out"
            )
        limits += [value] if value > 0 else []
    return min(limits)
