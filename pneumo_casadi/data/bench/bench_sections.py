"""Sections of `bench.json`: controller, sensor noise, load and valve."""

from typing import Any

from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.file_keys import check_keys, choice, percent, section
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.bench.valve_source import FlowSource, ValveData, Valves

#: ``controller.type`` -> class, needed keys and optional keys, with the attributes they become.
CONTROLLERS: dict[str, tuple[type[Any], dict[str, str], dict[str, str]]] = {
    "proportional": (ProportionalController, {"gain_V_per_m": "gain", "u_max_V": "u_max"}, {}),
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
    "none": (NoController, {}, {}),
}
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
    check_keys("controller.", content, {*needed, "type"}, {*optional, "law"})
    keys = {**needed, **{key: name for key, name in optional.items() if key in content}}
    controller: Controller = make(**{name: content[key] for key, name in keys.items()})
    return controller


def controller_content(controller: Controller) -> dict[str, Any]:
    """Return the section of a controller."""
    for kind, (make, needed, optional) in CONTROLLERS.items():
        if type(controller) is make:
            keys = {**needed, **optional}
            return {"type": kind} | {key: getattr(controller, name) for key, name in keys.items()}
    return dict(NONE)


def read_noise(content: dict[str, Any]) -> SensorNoise:
    """Return the noise that a section describes."""
    check_keys("sensor_noise.", content, {"x_m"}, set(NOISE_KEYS) - {"x_m"})
    values = {name: content[key] for key, name in NOISE_KEYS.items() if key in content}
    return SensorNoise(**({"p": 0.0} | values))


def noise_content(noise: SensorNoise) -> dict[str, float]:
    """Return the section of a noise; sensors beyond pressure and position only where stated."""
    values = {key: float(getattr(noise, name)) for key, name in NOISE_KEYS.items()}
    return {key: value for key, value in values.items() if value or key in ("p_Pa", "x_m")}


def read_load(content: dict[str, Any]) -> Load:
    """Return the load that a section describes."""
    check_keys("load.", content, (), LOAD_KEYS)
    return Load(**{name: content[key] for key, name in LOAD_KEYS.items() if key in content})


def read_valves(content: dict[str, Any]) -> Valves:
    """Return what a section says of both valves, or of each under ``P`` and ``N``."""
    if "P" in content or "N" in content:
        check_keys("valve.", content, {"P", "N"}, ())
        parts = [section(f"valve.{name}", content[name]) for name in "PN"]
        return Valves(*(_valve(f"valve.{name}.", p) for name, p in zip("PN", parts, strict=True)))
    valve = _valve("valve.", content)
    return Valves(valve, valve)


def _valve(where: str, content: dict[str, Any]) -> ValveData:
    check_keys(where, content, {"source"}, {"accuracy_percent", *VALVE_KEYS})
    values = {name: content[key] for key, name in VALVE_KEYS.items() if key in content}
    if "accuracy_percent" in content:
        values["accuracy"] = percent(f"{where}accuracy_percent", content["accuracy_percent"])
    source = choice(f"{where}source", content["source"], list(FlowSource))
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
