"""What `bench.json` may say that cannot be, or that the records contradict."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

from damage.kind import Damage, Due, Kind

NAME = "bench.json"
NEEDED = (
    *("sampling_frequency_Hz", "S_P_m2", "S_N_m2", "stroke_m", "p_ext_Pa", "p_supply_Pa", "T_K"),
    *("r_J_per_kg_K", "controller"),
)


def changed(change: Callable[[dict[str, Any], Random], Any]) -> Damage:
    """Return the damage that changes the content of the bench."""

    def damage(folder: Path, rng: Random) -> None:
        content = json.loads((folder / NAME).read_text("utf-8"))
        change(content, rng)
        (folder / NAME).write_text(json.dumps(content, indent=1))

    return damage


def scaled(key: str, *factors: float) -> Damage:
    """Return the damage that multiplies a value."""
    return changed(lambda c, r: c.update({key: c[key] * r.choice(factors)}))


def set_to(key: str, *values: Any) -> Damage:
    """Return the damage that replaces a value; ``a.b`` is a key within a section."""

    def change(content: dict[str, Any], rng: Random) -> None:
        *sections, last = key.split(".")
        for section in sections:
            content = content.setdefault(section, {})
        content[last] = rng.choice(values)

    return changed(change)


def kinds() -> Iterator[Kind]:
    """Yield the kinds of damage to `bench.json`."""
    refused = {
        "a missing key": changed(lambda c, r: c.pop(r.choice(NEEDED))),
        "an unknown key": changed(lambda c, r: c.update({f"k{r.random()}": 1})),
        "another unit": changed(
            lambda c, r: c.update({(k := r.choice(NEEDED[1:7])): c[k] * r.choice((1e-5, 1e5))})
        ),
        "areas in cm²": changed(lambda c, r: c.update(S_P_m2=8.75, S_N_m2=6.03)),
        "areas a tenth": changed(lambda c, r: [c.update({k: c[k] / 10}) for k in NEEDED[1:3]]),
        "one area a tenth": changed(
            lambda c, r: c.update({(k := r.choice(NEEDED[1:3])): c[k] / 10})
        ),
        "areas ten times": changed(lambda c, r: [c.update({k: c[k] * 10}) for k in NEEDED[1:3]]),
        "T in °C": set_to("T_K", 20.0, 20),
        "supply below ambient": set_to("p_supply_Pa", 9e4, 0, -7e5),
        "no section": set_to("controller", 3, "P", [], None),
        "unknown controller": set_to("controller.type", "fuzzy", "", "PID"),
        "u_max far too large": set_to("controller.u_max_V", 1e308, 1e6, 1e4),
        "u_max negative": set_to("controller.u_max_V", -5.0, 0),
        "gain far too small": set_to("controller.gain_V_per_m", 1e-300, 1e-9),
        "gain far too large": set_to("controller.gain_V_per_m", 1e300, 1e15),
        "mass that cannot be": set_to("datasheet.M_kg", -5, 0, 1e30, 1e-12),
        "noise negative": set_to("sensor_noise.p_Pa", -150, 0),
        "noise of a kilometre": set_to("sensor_noise.x_m", 1e3, 1.0),
        "load that cannot be": set_to("load.force_N", 1e9, "up"),
        "angle that cannot be": set_to("load.angle_deg", 400, -1000),
        "clock": set_to("clock", "fast", 3),
        "axis": set_to("axis", "hydraulic", 3, None),
        "frequency of another rate": scaled("sampling_frequency_Hz", 0.5, 2.0, 1.02),
        "area accuracy": set_to("area_accuracy_percent", -1, 0, 1e5, "1 %"),
        "a valve without C": set_to("valve", {"source": "data sheet", "b": 0.3}),
    }
    for what, damage in refused.items():
        yield Kind(f"{NAME}: {what}", Due.REFUSE, damage, NAME)
    noticed = {
        "supply 5e6": set_to("p_supply_Pa", 5e6, 3e6),
        "supply above the chambers": scaled("p_supply_Pa", 1.5, 2.0),
        "supply below the chambers": scaled("p_supply_Pa", 0.7, 0.5),
        "areas equal": changed(lambda c, r: c.update(S_P_m2=c["S_N_m2"])),
        "areas swapped": changed(lambda c, r: c.update(S_P_m2=c["S_N_m2"], S_N_m2=c["S_P_m2"])),
        "noise far too large": changed(lambda c, r: _scale_noise(c, 100)),
        "noise far too small": changed(lambda c, r: _scale_noise(c, 0.01)),
    }
    for what, damage in noticed.items():
        yield Kind(f"{NAME}: {what}", Due.FINDING, damage, NAME)
    unclear = {
        "stroke longer": scaled("stroke_m", 5.0, 10.0),
        "ambient on a mountain": scaled("p_ext_Pa", 0.6),
        "another gas": set_to("r_J_per_kg_K", 2077.0, 188.9),
    }
    for what, damage in unclear.items():
        yield Kind(f"{NAME}: {what}", Due.ANY, damage, NAME)
    valid = {
        "no data sheet": changed(lambda c, r: c.pop("datasheet", None)),
        "no noise": changed(lambda c, r: c.pop("sensor_noise", None)),
        "noise null": set_to("sensor_noise", None),
        "a comment": set_to("comment", "Prüfstand 2, 20 °C", ["a", "b"]),
        "stated load": set_to("load", {"angle_deg": 0, "force_N": 0}),
        "stated arrangement": set_to("arrangement", "two 3/2"),
        "stated axis": set_to("axis", "pneumatic"),
        "whole numbers": changed(lambda c, r: c.update(p_supply_Pa=int(c["p_supply_Pa"]))),
        "area accuracy stated": set_to("area_accuracy_percent", 2),
        "metered valve stated": set_to("valve", {"source": "metered", "accuracy_percent": 2}),
        "no controller": set_to("controller", {"type": "none"}),
    }
    for what, damage in valid.items():
        yield Kind(f"{NAME}: {what}", Due.ACCEPT, damage, NAME)


def _scale_noise(content: dict[str, Any], factor: float) -> None:
    for key in content["sensor_noise"]:
        content["sensor_noise"][key] *= factor
