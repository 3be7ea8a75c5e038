"""Checks that every kind of bench makes when it is constructed."""

from collections.abc import Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Any

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.data.bench.controllers import Controller
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.recording.clock import Clock
from pneumo_casadi.errors import CaseError

#: Relative standard uncertainty of a piston area that is taken from a data sheet: bore and rod
#: are made to some tenths of a millimetre.
AREA_ACCURACY = 0.01
#: By which share a sampling period of a law may miss a whole number of rows: jitter moves the step
#: of a record by half a per cent.
WHOLE = 1e-2
DATASHEET_UNITS = (
    *("kg_per_s", "N_s_per_m", "N_per_m", "m3_per_s", "m_per_s", "per_s"),
    *("kg", "m3", "m2", "m", "Pa", "N", "K", "s", "Hz", "V", "1"),
)


def check_values(owner: Any, known: Mapping[str, quantities.Quantity]) -> None:
    """Check attributes against their plausible ranges and store them as floats."""
    for name, quantity in known.items():
        value = quantity.check(name, getattr(owner, name))
        object.__setattr__(owner, name, value)


def check_parts(bench: Any) -> None:
    """Check controller, signals, clock, noise and data sheet of a bench, and store them."""
    kind, controller = bench.kind, bench.controller
    if not isinstance(controller, Controller):
        raise CaseError(f"`controller`: got {controller!r}; give a controller, or NoController()")
    if controller.inputs and controller.inputs != kind.commands:
        raise CaseError(
            f"`controller`: a {type(controller).__name__} sets {', '.join(controller.inputs)}, but "
            f"the inputs of a {kind.title} are {', '.join(kind.commands)}"
        )
    if controller.sample_time is not None:
        rows_per_sample(controller.sample_time, 1 / bench.sampling_frequency)
    strange = sorted(set(bench.signals) - set(kind.further))
    if strange:
        raise CaseError(
            f"`signals`: {', '.join(strange)} is no further signal of a {kind.title}; there are "
            f"{', '.join(kind.further)}"
        )
    object.__setattr__(bench, "clock", Clock(bench.clock))
    object.__setattr__(bench, "signals", frozenset(bench.signals))
    if not (bench.noise is None or isinstance(bench.noise, SensorNoise)):
        raise CaseError(f"`noise`: expected SensorNoise or None, got {bench.noise!r}")
    datasheet = {name: _entry(name, value) for name, value in bench.datasheet.items()}
    object.__setattr__(bench, "datasheet", MappingProxyType(datasheet))


def rows_per_sample(sample_time: float, dt: float) -> int:
    """Return of how many rows of a record the sampling period of a law consists.

    Raises
    ------
    CaseError
        If it is no whole multiple of the record's step.
    """
    rows = round(sample_time / dt)
    if rows < 1 or abs(sample_time / dt / rows - 1) > WHOLE:
        raise CaseError(
            f"`controller.sample_time`: {sample_time:g} s is no whole multiple of the record's "
            f"step of {dt:g} s; record at a multiple of the law's rate"
        )
    return rows


def _entry(name: str, value: object) -> float:
    unit = next((unit for unit in DATASHEET_UNITS if name.endswith(f"_{unit}")), None)
    if unit is None:
        raise CaseError(
            f"`datasheet.{name}`: the name must end in its SI unit, as M_kg does; known are "
            f"{', '.join(DATASHEET_UNITS)}"
        )
    if unit == "kg":  # of a mass that moves
        return quantities.MASS.check(f"datasheet.{name}", value)
    return quantities.as_number(f"datasheet.{name}", value, unit)


def rebuilt(bench: Any) -> tuple[Any, ...]:
    """Return what pickle and copy need; a mapping proxy itself cannot be pickled."""
    values = {item.name: getattr(bench, item.name) for item in fields(bench)}
    values["datasheet"] = dict(bench.datasheet)
    return type(bench), tuple(values.values())
