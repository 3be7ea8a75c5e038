"""`bench.json`: names with their SI unit, read into a bench and written from it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.data.bench.bench import AnyBench, Bench, ForceBench, SensorNoise
from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    ProportionalController,
)
from pneumo_casadi.errors import CaseError

BENCH_KEYS = {
    "sampling_frequency_Hz": "sampling_frequency",
    "S_P_m2": "S_P",
    "S_N_m2": "S_N",
    "stroke_m": "stroke",
    "p_ext_Pa": "p_ext",
    "p_supply_Pa": "p_supply",
    "T_K": "T",
    "r_J_per_kg_K": "r",
}
FORCE_BENCH_KEYS = {"sampling_frequency_Hz": "sampling_frequency", "stroke_m": "stroke"}
#: ``"axis"`` of the file -> class of the bench, and its keys with the attributes they become.
BENCH_CLASSES: dict[str, tuple[type[Bench] | type[ForceBench], dict[str, str]]] = {
    Bench.kind.name: (Bench, BENCH_KEYS),
    ForceBench.kind.name: (ForceBench, FORCE_BENCH_KEYS),
}
CONTROLLERS: dict[str, tuple[type[Any], dict[str, str]]] = {
    "proportional": (ProportionalController, {"gain_V_per_m": "gain", "u_max_V": "u_max"}),
    "nested": (
        NestedController,
        {
            "k_p_per_s": "k_p",
            "k_v_V_s_per_m": "k_v",
            "gain_N_per_V": "gain",
            "u_max_V": "u_max",
        },
    ),
}
NOISE_KEYS = {"p_Pa": "p", "x_m": "x"}


def read_bench(path: str | Path) -> AnyBench:
    """Read `bench.json`: a `Bench`, or a `ForceBench` where ``"axis": "force"`` says so.

    Each key ends in its SI unit (``p_supply_Pa``), those of the data sheet too (``M_kg``).

    Parameters
    ----------
    path : path
        The file; its fields are described in ``docs/how_to/your_data.md``.

    Returns
    -------
    Bench or ForceBench

    Raises
    ------
    CaseError
        If the file is missing or no JSON, a key is missing, unknown or given twice, or a
        value is not plausible in its unit.
    """
    path = Path(path)
    content = _read_json(path)
    try:
        return bench_from_content(content)
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None


def bench_content(bench: AnyBench) -> dict[str, Any]:
    """Return what `bench.json` holds for a bench; `read_bench` gives the same bench back."""
    _, keys = BENCH_CLASSES[bench.kind.name]
    content: dict[str, Any] = {"axis": bench.kind.name}
    content |= {key: getattr(bench, name) for key, name in keys.items()}
    for kind, (make, names) in CONTROLLERS.items():
        if isinstance(bench.controller, make):
            values = {key: getattr(bench.controller, name) for key, name in names.items()}
            content["controller"] = {"type": kind, **values}
    content["datasheet"] = dict(bench.datasheet)
    if bench.noise is not None:
        content["sensor_noise"] = {
            key: getattr(bench.noise, name) for key, name in NOISE_KEYS.items()
        }
    return content


def _read_json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise CaseError(f"{path}: no such file; a case folder describes its axis in bench.json")
    try:
        content = json.loads(path.read_text("utf-8"), object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise CaseError(
            f"{path}: line {error.lineno}: {error.msg}; the file is empty, cut short or no JSON"
        ) from None
    except (CaseError, UnicodeDecodeError) as error:
        raise CaseError(f"{path}: {error}; write UTF-8 JSON with unique keys") from None
    if not isinstance(content, dict):
        raise CaseError(f"{path}: expected a JSON object, got {content!r}")
    return content


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    twice = sorted({key for key in keys if keys.count(key) > 1})
    if twice:
        raise CaseError(f"key {', '.join(twice)} stands twice")
    return dict(pairs)


def bench_from_content(content: dict[str, Any]) -> AnyBench:
    """Return the bench that `bench_content` has described; errors as in `read_bench`."""
    kind = content.get("axis", Bench.kind.name)
    if not isinstance(kind, str) or kind not in BENCH_CLASSES:
        raise CaseError(f"`axis`: got {kind!r}; write {' or '.join(map(repr, BENCH_CLASSES))}")
    bench_class, keys = BENCH_CLASSES[kind]
    optional = {"axis", "datasheet", "sensor_noise", "comment"}
    _check_keys("", content, {*keys, "controller"}, optional)
    values = {name: content[key] for key, name in keys.items()}
    noise = content.get("sensor_noise")
    parts: dict[str, Any] = {
        "controller": _controller(_section("controller", content["controller"])),
        "datasheet": _section("datasheet", content.get("datasheet", {})),
        "noise": None if noise is None else _noise(_section("sensor_noise", noise)),
    }
    return bench_class(**values, **parts)


def _section(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise CaseError(f"`{name}`: expected a JSON object, got {value!r}")
    return value


def _controller(content: dict[str, Any]) -> Controller:
    kind = content.get("type")
    if not isinstance(kind, str) or kind not in CONTROLLERS:
        raise CaseError(f"`controller.type`: got {kind!r}; write one of {', '.join(CONTROLLERS)}")
    make, keys = CONTROLLERS[kind]
    _check_keys("controller.", content, {*keys, "type"}, {"law"})
    controller: Controller = make(**{name: content[key] for key, name in keys.items()})
    return controller


def _noise(content: dict[str, Any]) -> SensorNoise:
    _check_keys("sensor_noise.", content, {"x_m"}, {"p_Pa"})
    return SensorNoise(p=content.get("p_Pa", 0.0), x=content["x_m"])


def _check_keys(
    where: str, content: Mapping[str, Any], needed: set[str], optional: set[str]
) -> None:
    missing = sorted(needed - content.keys())
    unknown = sorted(content.keys() - needed - optional)
    advice = f"; there stands {', '.join(f'`{where}{key}`' for key in unknown)}" if unknown else ""
    if missing:
        raise CaseError(f"missing key {', '.join(f'`{where}{key}`' for key in missing)}{advice}")
    if unknown:
        raise CaseError(
            f"unknown key {', '.join(f'`{where}{key}`' for key in unknown)}; "
            f"known are {', '.join(sorted(needed | optional))}"
        )
