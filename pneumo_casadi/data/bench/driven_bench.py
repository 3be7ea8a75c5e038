"""Benches of the moving mass alone, driven by a known force or by measured pressures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.data.bench.axis_kind import (
    FORCE_DRIVEN,
    PRESSURE_DRIVEN,
    SINGLE_ACTING,
    AxisKind,
)
from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.bench_checks import (
    AREA_ACCURACY,
    check_parts,
    check_values,
    rebuilt,
)
from pneumo_casadi.data.bench.controllers import Controller, NoController
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.recording.clock import Clock


@dataclass(frozen=True, slots=True)
class ForceBench:
    """A force-driven axis: the motion balance alone, with the force as its input.

    Parameters
    ----------
    sampling_frequency : float
        [Hz].
    stroke : float, optional
        Length of travel [m]; x may count from anywhere. None where it is unknown.
    controller : Controller
        The law that closed the loop during the recordings.
    datasheet : mapping of str to float, optional
        What the manufacturer states, by symbol and SI unit.
    noise : SensorNoise, optional
        Noise of the sensors; None where it is unknown.
    load, clock, signals : optional
        As in `Bench`.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit; the message names the unit it may be in.

    Examples
    --------
    >>> from pneumo_casadi.data import NestedController
    >>> ForceBench(1000.0, None, NestedController(160.18, 243.45, 35.15, 10.0)).kind.inputs
    ('F',)
    """

    sampling_frequency: float
    stroke: float | None
    controller: Controller
    datasheet: Mapping[str, float] = field(default_factory=dict)
    noise: SensorNoise | None = None
    load: Load = field(default_factory=Load)
    clock: Clock = Clock.UNIFORM
    signals: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        check_values(self, {"sampling_frequency": quantities.FREQUENCY})
        if self.stroke is not None:
            check_values(self, {"stroke": quantities.STROKE})
        check_parts(self)

    @property
    def kind(self) -> AxisKind:
        """States, inputs, outputs and balances of the axis, with the further signals recorded."""
        return FORCE_DRIVEN.with_signals(self.signals)

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)


@dataclass(frozen=True, slots=True)
class PressureBench:
    """The moving mass alone, driven by the measured pressures of its chambers.

    For those who know nothing of their valve: friction and, where a force on the rod is measured,
    the piston areas follow from the force balance (eq. 1, third line).

    Parameters
    ----------
    sampling_frequency : float
        [Hz].
    S_P, S_N : float
        Piston areas of the chambers P and N [m²]; `S_N` is 0 for a single-acting cylinder.
    stroke : float, optional
        Length of travel [m]; x may count from anywhere. None where it is unknown.
    p_ext : float
        Ambient pressure, absolute [Pa].
    controller : Controller, optional
        The law that closed the loop; by default none is known.
    datasheet, noise, load, area_accuracy, clock, signals : optional
        As in `Bench`.

    Raises
    ------
    CaseError
        If a value is not plausible in its unit; the message names the unit it may be in.

    Examples
    --------
    >>> PressureBench(1000.0, 5.2e-4, 0.0, None, 1e5).kind.inputs
    ('p_P',)
    """

    sampling_frequency: float
    S_P: float
    S_N: float
    stroke: float | None
    p_ext: float
    controller: Controller = field(default_factory=NoController)
    datasheet: Mapping[str, float] = field(default_factory=dict)
    noise: SensorNoise | None = None
    load: Load = field(default_factory=Load)
    area_accuracy: float = AREA_ACCURACY
    clock: Clock = Clock.UNIFORM
    signals: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        check_values(
            self,
            {
                "sampling_frequency": quantities.FREQUENCY,
                "S_P": quantities.AREA,
                "p_ext": quantities.AMBIENT_PRESSURE,
                "area_accuracy": quantities.SHARE,
            },
        )
        if self.S_N != 0.0:
            check_values(self, {"S_N": quantities.AREA})
        if self.stroke is not None:
            check_values(self, {"stroke": quantities.STROKE})
        check_parts(self)

    @property
    def kind(self) -> AxisKind:
        """States, inputs, outputs and balances of the axis, with the further signals recorded."""
        kind = PRESSURE_DRIVEN if self.S_N else SINGLE_ACTING
        return kind.with_signals(self.signals)

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt(self)


#: A bench with valves, a known force, or measured pressures.
AnyBench = Bench | ForceBench | PressureBench


def is_metered(bench: AnyBench) -> bool:
    """Return whether the flow of a bench comes from a measured map; not without valves."""
    return isinstance(bench, Bench) and bench.valves.metered
