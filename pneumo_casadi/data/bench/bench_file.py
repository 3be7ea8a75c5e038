"""`bench.json`: names with their SI unit, read into a bench and written from it."""

from pathlib import Path
from typing import Any

from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC, PRESSURE_DRIVEN
from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.bench_checks import AREA_ACCURACY
from pneumo_casadi.data.bench.bench_sections import (
    NOISE_KEYS,
    NONE,
    controller_content,
    noise_content,
    read_controller,
    read_load,
    read_noise,
    read_valves,
    valves_content,
)
from pneumo_casadi.data.bench.driven_bench import AnyBench, ForceBench, PressureBench
from pneumo_casadi.data.bench.file_keys import choice, named_by_keys, percent, section
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.quantities import SHARE
from pneumo_casadi.data.bench.valve_source import Arrangement, Valves
from pneumo_casadi.data.recording.clock import Clock
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.json_input import check_keys, read_json

_GEOMETRY = {"S_P_m2": "S_P", "S_N_m2": "S_N", "stroke_m": "stroke", "p_ext_Pa": "p_ext"}
BENCH_KEYS = {
    "sampling_frequency_Hz": "sampling_frequency",
    **_GEOMETRY,
    "p_supply_Pa": "p_supply",
    "T_K": "T",
    "r_J_per_kg_K": "r",
}
FORCE_BENCH_KEYS = {"sampling_frequency_Hz": "sampling_frequency", "stroke_m": "stroke"}
PRESSURE_BENCH_KEYS = {"sampling_frequency_Hz": "sampling_frequency", **_GEOMETRY}
#: ``"axis"`` of the file -> class of the bench, and its keys with the attributes they become.
BENCH_CLASSES: dict[str, tuple[type[Any], dict[str, str]]] = {
    PNEUMATIC.name: (Bench, BENCH_KEYS),
    FORCE_DRIVEN.name: (ForceBench, FORCE_BENCH_KEYS),
    PRESSURE_DRIVEN.name: (PressureBench, PRESSURE_BENCH_KEYS),
}
#: Keys without which a file is complete, for every kind of axis and for those with given fields.
OPTIONAL = {"axis", "controller", "datasheet", "sensor_noise", "comment", "load", "clock"}
OPTIONAL_OF_FIELD = {
    "valves": "valve",
    "arrangement": "arrangement",
    "area_accuracy": "area_accuracy_percent",
}


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
    content = read_json(path, "a case folder describes its axis in bench.json")
    try:
        return bench_from_content(content)
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None


def bench_content(bench: AnyBench) -> dict[str, Any]:
    """Return what `bench.json` holds for a bench; `read_bench` gives the same bench back.

    Fields at their default are left out. Which further signals were recorded (``signals``) shows
    in the columns of the records.
    """
    kind = bench.kind.name
    _, keys = BENCH_CLASSES[kind]
    content: dict[str, Any] = {"axis": kind}
    content |= {key: getattr(bench, name) for key, name in keys.items()}
    content["controller"] = controller_content(bench.controller)
    content["datasheet"] = dict(bench.datasheet)
    if bench.noise is not None:
        content["sensor_noise"] = noise_content(bench.noise)
    if bench.load != Load():
        content["load"] = {"angle_deg": bench.load.angle_deg, "force_N": bench.load.force}
    if bench.clock is not Clock.UNIFORM:
        content["clock"] = str(bench.clock)
    if isinstance(bench, Bench):
        if bench.valves != Valves():
            content["valve"] = valves_content(bench.valves)
        if bench.arrangement is not Arrangement.TWO_3_2:
            content["arrangement"] = str(bench.arrangement)
    if not isinstance(bench, ForceBench) and bench.area_accuracy != AREA_ACCURACY:
        content["area_accuracy_percent"] = 100 * bench.area_accuracy
    return content


def bench_from_content(content: dict[str, Any]) -> AnyBench:
    """Return the bench that `bench_content` has described; errors as in `read_bench`."""
    kind = choice("axis", content.get("axis", PNEUMATIC.name), BENCH_CLASSES)
    bench_class, keys = BENCH_CLASSES[kind]
    fields = bench_class.__dataclass_fields__
    further = {key for name, key in OPTIONAL_OF_FIELD.items() if name in fields}
    needed = set(keys) if kind == PRESSURE_DRIVEN.name else {*keys, "controller"}
    check_keys("", content, needed, OPTIONAL | further)
    values: dict[str, Any] = {name: content[key] for key, name in keys.items()}
    values["controller"] = read_controller(section("controller", content.get("controller", NONE)))
    values["datasheet"] = section("datasheet", content.get("datasheet", {}))
    if content.get("sensor_noise") is not None:
        values["noise"] = read_noise(section("sensor_noise", content["sensor_noise"]))
    if "load" in content:
        values["load"] = read_load(section("load", content["load"]))
    if "clock" in content:
        values["clock"] = Clock(choice("clock", content["clock"], list(Clock)))
    if "valve" in content:
        values["valves"] = read_valves(section("valve", content["valve"]))
    if "arrangement" in content:
        values["arrangement"] = Arrangement(
            choice("arrangement", content["arrangement"], list(Arrangement))
        )
    if "area_accuracy_percent" in content:
        stated = content["area_accuracy_percent"]
        values["area_accuracy"] = percent("area_accuracy_percent", stated, SHARE)
    of_parts = {f"sensor_noise.{key}": f"noise.{name}" for key, name in NOISE_KEYS.items()}
    of_parts["controller.sample_time_s"] = "controller.sample_time"
    with named_by_keys({**keys, **of_parts}):
        bench: AnyBench = bench_class(**values)
    return bench
