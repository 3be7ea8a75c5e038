"""Sections of `bench.json`: controller, sensor noise, load and valve."""

from dataclasses import fields, is_dataclass
from enum import StrEnum
from typing import Any

from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.file_keys import choice, named_by_keys, percent, section
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.pid_controllers import CascadeController, PidController
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.bench.valve_source import ACCURACY, FlowSource, ValveData, Valves
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.json_input import check_keys

_LIMITS = {
    "u_min_V": "u_min",
    "u_0_V": "u_0",
    "anti_windup": "anti_windup",
    "tracking_time_s": "tracking_time",
    "sample_time_s": "sample_time",
}
#: ``controller.type`` -> class, needed keys and optional keys, with the attributes they become.
CONTROLLERS: dict[str, tuple[type[Any], dict[str, str], dict[str, str]]] = {
    "proportional": (
        ProportionalController,
        {"gain_V_per_m": "gain", "u_max_V": "u_max"},
        {"u_0_V": "u_0", "sample_time_s": "sample_time"},
    ),
    "pid": (
        PidController,
        {"k_p_V_per_m": "k_p", "u_max_V": "u_max"},
        {
            "k_i_V_per_m_s": "k_i",
            "k_d_V_s_per_m": "k_d",
            "derivative_filter_s": "derivative_filter",
            **_LIMITS,
        },
    ),
    "cascade": (
        CascadeController,
        {"k_p_per_s": "k_p", "k_v_V_s_per_m": "k_v", "u_max_V": "u_max"},
        {
            "k_i_V_per_m": "k_i",
            "velocity_filter_s": "velocity_filter",
            "v_max_m_per_s": "v_max",
            **_LIMITS,
        },
    ),
    "nested": (
        NestedController,
        {
            "k_p_per_s": "k_p",
            "k_v_V_s_per_m": "k_v",
            "gain_N_per_V": "gain",
            "u_max_V": "u_max",
        },
        {},
    ),
    "none": (NoController, {}, {"u_max_V": "u_max"}),
}
#: What to write of a law that no section describes.
OTHER_LAW = 'of any other law state `"type": "none"` (with `u_max_V` if known): it is not simulated'
#: What stands for a controller that a file does not name.
NONE = {"type": "none"}
NOISE_KEYS = {"p_Pa": "p", "x_m": "x", "v_m_per_s": "v", "a_m_per_s2": "a"}
LOAD_KEYS = {"angle_deg": "angle_deg", "force_N": "force"}
VALVE_KEYS = {
    "C_fill_m3_per_s_Pa": "C_fill",
    "C_exhaust_m3_per_s_Pa": "C_exhaust",
    "b": "b",
    "m": "m",
    "u_full_V": "u_full",
}


def read_controller(content: dict[str, Any]) -> Controller:
    """Return the controller that a section describes."""
    kind = choice("controller.type", content.get("type"), CONTROLLERS)
    make, needed, optional = CONTROLLERS[kind]
    try:
        check_keys("controller", content, {*needed, "type"}, {*optional, "law"})
    except CaseError as error:
        raise CaseError(f"{error}; {OTHER_LAW}") from None
    keys = {**needed, **{key: name for key, name in optional.items() if key in content}}
    with named_by_keys({**needed, **optional}, "controller.", "controller."):
        controller: Controller = make(**{name: content[key] for key, name in keys.items()})
    return controller


def controller_content(controller: Controller) -> dict[str, Any]:
    """Return the section of a controller; fields at their default are left out.

    One's own law does not go into files: none is named.
    """
    for kind, (make, needed, optional) in CONTROLLERS.items():
        if type(controller) is make:
            assert is_dataclass(controller)
            default = {item.name: item.default for item in fields(controller)}
            stated = {k: n for k, n in optional.items() if getattr(controller, n) != default[n]}
            content = {key: getattr(controller, n) for key, n in (needed | stated).items()}
            return {"type": kind} | {k: _plain(value) for k, value in content.items()}
    return dict(NONE)


def _plain(value: float | StrEnum) -> float | str:
    return str(value) if isinstance(value, StrEnum) else value


def read_noise(content: dict[str, Any]) -> SensorNoise:
    """Return the noise that a section describes."""
    check_keys("sensor_noise", content, {"x_m"}, set(NOISE_KEYS) - {"x_m"})
    values = {name: content[key] for key, name in NOISE_KEYS.items() if key in content}
    with named_by_keys(NOISE_KEYS, "sensor_noise.", "noise."):
        return SensorNoise(**({"p": 0.0} | values))


def noise_content(noise: SensorNoise) -> dict[str, float]:
    """Return the section of a noise; sensors beyond pressure and position only where stated."""
    values = {key: float(getattr(noise, name)) for key, name in NOISE_KEYS.items()}
    return {key: value for key, value in values.items() if value or key in ("p_Pa", "x_m")}


def read_load(content: dict[str, Any]) -> Load:
    """Return the load that a section describes."""
    check_keys("load", content, (), LOAD_KEYS)
    with named_by_keys(LOAD_KEYS, "load.", "load."):
        return Load(**{name: content[key] for key, name in LOAD_KEYS.items() if key in content})


def read_valves(content: dict[str, Any]) -> Valves:
    """Return what a section says of both valves, or of each under ``P`` and ``N``."""
    if "P" in content or "N" in content:
        check_keys("valve", content, {"P", "N"}, ())
        parts = [section(f"valve.{name}", content[name]) for name in "PN"]
        return Valves(*(_valve(f"valve.{name}", p) for name, p in zip("PN", parts, strict=True)))
    valve = _valve("valve", content)
    return Valves(valve, valve)


def _valve(where: str, content: dict[str, Any]) -> ValveData:
    check_keys(where, content, {"source"}, {"accuracy_percent", *VALVE_KEYS})
    values = {name: content[key] for key, name in VALVE_KEYS.items() if key in content}
    if "accuracy_percent" in content:
        name = f"{where}.accuracy_percent"
        values["accuracy"] = percent(name, content["accuracy_percent"], ACCURACY)
    source = choice(f"{where}.source", content["source"], list(FlowSource))
    keys = {**VALVE_KEYS, "accuracy_percent": "accuracy_percent"}
    with named_by_keys(keys, f"{where}.", "valve."):
        return ValveData(FlowSource(source), **values)


def valves_content(valves: Valves) -> dict[str, Any]:
    """Return the section of the valves, one for both where they are equal."""
    P, N = (_valve_content(valve) for valve in valves)
    return P if P == N else {"P": P, "N": N}


def _valve_content(valve: ValveData) -> dict[str, Any]:
    content: dict[str, Any] = {"source": str(valve.source)}
    if valve.accuracy is not None:
        content["accuracy_percent"] = 100 * valve.accuracy
    values = {key: getattr(valve, name) for key, name in VALVE_KEYS.items()}
    return content | {key: value for key, value in values.items() if value is not None}
