"""The bench: geometry, constants, controller, sensors and data sheet of a servo axis."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.data.bench.axis_kind import PNEUMATIC, AxisKind
from pneumo_casadi.data.bench.bench_checks import (
    AREA_ACCURACY,
    check_parts,
    check_values,
    rebuilt,
)
from pneumo_casadi.data.bench.controllers import Controller
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.bench.valve_source import Arrangement, Valves
from pneumo_casadi.data.recording.clock import Clock
from pneumo_casadi.errors import CaseError


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
    controller : Controller
        The law that closed the loop during the recordings.
    datasheet : mapping of str to float, optional
        What the manufacturer states, by symbol and SI unit, for example ``{"M_kg": 17.0}``.
    noise : SensorNoise, optional
        Noise of the sensors; None where it is unknown.
    load : Load, optional
        Inclination of the axis and a constant force on the rod.
    valves : Valves, optional
        Where the static flow of each valve comes from; by default both are metered.
    arrangement : Arrangement, optional
        Two three-way valves, or one five-way valve.
    area_accuracy : float, optional
        Relative standard uncertainty of the piston areas [1]. They give the flow its scale where
        no valve was metered.
    clock : Clock, optional
        Whether time stamps are those of a uniform clock, or are taken as they were recorded.
    signals : frozenset of str, optional
        Further signals that all records have; see `AxisKind.with_signals`.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit; the message names the unit it may be in.

    Examples
    --------
    >>> from pneumo_casadi.data import ProportionalController
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
    load: Load = field(default_factory=Load)
    valves: Valves = field(default_factory=Valves)
    arrangement: Arrangement = Arrangement.TWO_3_2
    area_accuracy: float = AREA_ACCURACY
    clock: Clock = Clock.UNIFORM
    signals: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        check_values(
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
                "area_accuracy": quantities.SHARE,
            },
        )
        if self.p_supply <= self.p_ext:
            raise CaseError(
                f"`p_supply`: {self.p_supply:g} Pa is not above p_ext = {self.p_ext:g} Pa; "
                "give absolute pressures"
            )
        check_parts(self)
        self._check_load()
        if self.noise is not None and self.noise.p == 0.0:
            raise CaseError("`noise.p`: 0 Pa; no sensor is exact: give its standard deviation")

    @property
    def kind(self) -> AxisKind:
        """States, inputs, outputs and balances of the axis, with the further signals recorded."""
        return PNEUMATIC.with_signals(self.signals)

    @property
    def stroke_limits(self) -> tuple[float, float]:
        """Ends of the stroke (−l/2, l/2) [m], as x = 0 is the middle (eq. 3)."""
        return -self.stroke / 2, self.stroke / 2

    def _check_load(self) -> None:
        """Refuse a load that no pressure up to the supply moves.

        A force may balance a weight: both count together, and not where the mass is unknown.
        """
        M = self.datasheet.get("M_kg")
        if M is None and self.load.acceleration:
            return
        weight = (M or 0.0) * self.load.acceleration
        largest = max(self.S_P, self.S_N) * self.p_supply
        if abs(weight + self.load.force) > largest:
            raise CaseError(
                f"`load`: a weight of {weight:g} N along +x and a force of {self.load.force:g} N "
                f"exceed the largest piston force, area times supply pressure = {largest:g} N: the "
                "axis cannot move; give `force_N` in N, `datasheet.M_kg` in kg, the areas in m²"
            )

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)
