"""The bench: geometry, constants, controller, sensors and data sheet of an axis."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, ClassVar

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC, AxisKind
from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    ProportionalController,
)
from pneumo_casadi.errors import CaseError

DATASHEET_UNITS = (
    *("kg_per_s", "N_s_per_m", "N_per_m", "m3_per_s", "m_per_s", "per_s"),
    *("kg", "m3", "m2", "m", "Pa", "N", "K", "s", "Hz", "V", "1"),
)


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Standard deviations of the sensors' noise.

    Parameters
    ----------
    p : float
        Of the pressures [Pa]; 0 where there is no pressure sensor.
    x : float
        Of the position [m].

    Raises
    ------
    CaseError
        If a value is negative, not finite or looks like another unit.

    Examples
    --------
    >>> SensorNoise(p=150.0, x=1.5e-5)
    SensorNoise(p=150.0, x=1.5e-05)
    """

    p: float
    x: float

    def __post_init__(self) -> None:
        _check(self, {"p": quantities.PRESSURE_NOISE, "x": quantities.POSITION_NOISE}, "noise.")
        if self.x == 0.0:
            raise CaseError("`noise.x`: 0 m; no sensor is exact: give its standard deviation in m")


@dataclass(frozen=True, slots=True)
class Bench:
    """A pneumatic servo axis: two valves, a single-rod cylinder and a mass (eq. 1-4).

    Parameters
    ----------
    sampling_frequency : float
        [Hz].
    S_P, S_N : float
        Piston areas of the chambers P and N [m²].
    stroke : float
        Length l [m]; x = 0 is the middle, so −l/2 ≤ x ≤ l/2 (eq. 3).
    p_ext, p_supply : float
        Ambient and supply pressure, absolute [Pa].
    T : float
        Temperature of the gas [K].
    r : float
        Gas constant related to unit mass [J/(kg K)].
    controller : ProportionalController or NestedController
        The law that closed the loop during the recordings.
    datasheet : mapping of str to float, optional
        What the manufacturer states, by symbol and SI unit, for example ``{"M_kg": 17.0}``.
    noise : SensorNoise, optional
        Noise of the sensors; None where it is unknown.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit; the message names the unit it may be in.

    Examples
    --------
    >>> bench = Bench(5000.0, 8.75e-4, 6.03e-4, 0.5, 1e5, 7e5, 293.15, 287.0,
    ...               ProportionalController(2.4, 5.0), {"M_kg": 17.0})
    >>> bench.stroke_limits
    (-0.25, 0.25)
    >>> from dataclasses import replace
    >>> replace(bench, p_supply=7.0)
    Traceback (most recent call last):
    ...
    pneumo_casadi.errors.CaseError: `p_supply`: expected absolute Pa between 120000 and 5e+06, got
    7; is it in bar?
    """

    sampling_frequency: float
    S_P: float
    S_N: float
    stroke: float
    p_ext: float
    p_supply: float
    T: float
    r: float
    controller: Controller
    datasheet: Mapping[str, float] = field(default_factory=dict)
    noise: SensorNoise | None = None

    kind: ClassVar[AxisKind] = PNEUMATIC

    def __post_init__(self) -> None:
        _check(
            self,
            {
                "sampling_frequency": quantities.FREQUENCY,
                "S_P": quantities.AREA,
                "S_N": quantities.AREA,
                "stroke": quantities.STROKE,
                "p_ext": quantities.AMBIENT_PRESSURE,
                "p_supply": quantities.SUPPLY_PRESSURE,
                "T": quantities.TEMPERATURE,
                "r": quantities.GAS_CONSTANT,
            },
        )
        if self.p_supply <= self.p_ext:
            raise CaseError(
                f"`p_supply`: {self.p_supply:g} Pa is not above p_ext = {self.p_ext:g} Pa; "
                "give absolute pressures"
            )
        _check_parts(self, ProportionalController)
        if self.noise is not None and self.noise.p == 0.0:
            raise CaseError("`noise.p`: 0 Pa; no sensor is exact: give its standard deviation")

    @property
    def stroke_limits(self) -> tuple[float, float]:
        """Ends of the stroke (−l/2, l/2) [m], as x = 0 is the middle (eq. 3)."""
        return -self.stroke / 2, self.stroke / 2

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt(self)


@dataclass(frozen=True, slots=True)
class ForceBench:
    """A force-driven axis: the motion balance alone, with the force as its input.

    Parameters
    ----------
    sampling_frequency : float
        [Hz].
    stroke : float, optional
        Length of travel [m]; x may count from anywhere. None where it is unknown.
    controller : NestedController
        The law that closed the loop during the recordings.
    datasheet : mapping of str to float, optional
        What the manufacturer states, by symbol and SI unit.
    noise : SensorNoise, optional
        Noise of the sensors; None where it is unknown.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit; the message names the unit it may be in.

    Examples
    --------
    >>> ForceBench(1000.0, None, NestedController(160.18, 243.45, 35.15, 10.0)).kind.inputs
    ('F',)
    """

    sampling_frequency: float
    stroke: float | None
    controller: Controller
    datasheet: Mapping[str, float] = field(default_factory=dict)
    noise: SensorNoise | None = None

    kind: ClassVar[AxisKind] = FORCE_DRIVEN

    def __post_init__(self) -> None:
        _check(self, {"sampling_frequency": quantities.FREQUENCY})
        if self.stroke is not None:
            _check(self, {"stroke": quantities.STROKE})
        _check_parts(self, NestedController)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt(self)


AnyBench = Bench | ForceBench


def _check(owner: Any, quantities: Mapping[str, quantities.Quantity], prefix: str = "") -> None:
    for name, quantity in quantities.items():
        value = quantity.check(prefix + name, getattr(owner, name))
        object.__setattr__(owner, name, value)


def _check_parts(bench: Any, kind: type) -> None:
    if not isinstance(bench.controller, kind):
        raise CaseError(
            f"`controller`: expected a {kind.__name__} for a {type(bench).__name__}, "
            f"got {bench.controller!r}"
        )
    if not (bench.noise is None or isinstance(bench.noise, SensorNoise)):
        raise CaseError(f"`noise`: expected SensorNoise or None, got {bench.noise!r}")
    datasheet = {name: _entry(name, value) for name, value in bench.datasheet.items()}
    object.__setattr__(bench, "datasheet", MappingProxyType(datasheet))


def _entry(name: str, value: object) -> float:
    unit = next((unit for unit in DATASHEET_UNITS if name.endswith(f"_{unit}")), None)
    if unit is None:
        raise CaseError(
            f"`datasheet.{name}`: the name must end in its SI unit, as M_kg does; known are "
            f"{', '.join(DATASHEET_UNITS)}"
        )
    return quantities.as_number(f"datasheet.{name}", value, unit)


def _rebuilt(bench: Any) -> tuple[Any, ...]:
    """Return what pickle and copy need; a mapping proxy itself cannot be pickled."""
    values = {item.name: getattr(bench, item.name) for item in fields(bench)}
    values["datasheet"] = dict(bench.datasheet)
    return type(bench), tuple(values.values())
