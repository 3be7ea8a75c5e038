"""Sound cases and results, which the kinds of damage are done to."""

import contextlib
import os
import shutil
from pathlib import Path

import numpy as np
import scipy.io

import pneumo_casadi as pc
from damage import of_bench, of_flow_maps, of_json, of_records, of_results
from damage.kind import Kind, Subject
from pneumo_casadi.data import Case, write_case
from pneumo_casadi.data.readers.columns import COLUMNS
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.runtime.atomic_files import atomic_folder
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.valve import FlowForm

#: Environment variable with a folder that keeps what `make_bases` makes for further scripts.
KEPT = "PNEUMO_CASADI_BASES"


def all_kinds() -> tuple[Kind, ...]:
    """Return all kinds of damage."""
    return (
        *of_json.kinds("bench.json", Subject.CASE, closed=True),
        *of_json.kinds("columns.json", Subject.CASE, closed=True),
        *of_json.kinds("truth.json", Subject.CASE, closed=False),
        *of_json.kinds("result.json", Subject.RESULT, closed=False),
        *of_bench.kinds(),
        *of_records.kinds(),
        *of_flow_maps.kinds(),
        *of_results.results(),
        *of_results.folders(),
        *of_results.emps(),
    )


def make_bases(folder: Path, identified: bool = True) -> None:
    """Write a sound folder for each subject; a result takes a quarter of a minute."""
    kept = os.environ.get(KEPT)
    if not kept:
        _make_bases(folder, identified)
        return
    if not Path(kept).exists():
        with atomic_folder(kept) as draft:
            _make_bases(draft, True)
    shutil.copytree(kept, folder, dirs_exist_ok=True)


def _make_bases(folder: Path, identified: bool) -> None:
    case = short_case(folder / Subject.CASE.value)
    (folder / Subject.EMPS.value).mkdir()
    write_emps(folder / Subject.EMPS.value)
    (folder / Subject.RESULT.value).mkdir()
    if identified:
        options = IdentifyOptions(FlowForm.POLYNOMIALS, end=7.0, windows=(0.5,), each_record=False)
        write_json(
            result_dict(pc.identify(case, options)), folder / Subject.RESULT.value / "result.json"
        )


def short_case(folder: Path) -> Case:
    """Write a case of the example: 4 s and 3 s at 1 kHz as plain CSV, with all its files."""
    example = pc.example_case()
    names = ("u_P", "u_N")
    records = [
        record.window(start, end).decimate(5, average=names)
        for record, start, end in ((example.identify[0], 5, 9), (example.validate[0], 8, 11))
    ]
    packed = folder.with_name("packed")
    bench = pc.data.Bench(
        **{
            name: getattr(example.bench, name)
            for name in example.bench.__dataclass_fields__
            if name != "sampling_frequency"
        },
        sampling_frequency=1000.0,
    )
    write_case(packed, bench, records[:1], records[1:], example.flow_map_path)
    shutil.copytree(packed, folder)
    for name, record in zip(("identify", "validate"), records, strict=True):
        (folder / f"{name}.csv.gz").unlink()
        record.to_frame().round(9).to_csv(folder / f"{name}.csv", index=False)
    shutil.copy(example.folder / "truth.json", folder)
    stated = {name: name for name in COLUMNS if name[:-2] in ("t", "p_P_", "x", "u_P", "x_ref")}
    write_json(
        stated | {"p_N_Pa": {"column": "p_N_Pa", "scale": 1.0, "offset": 0.0}},
        folder / "columns.json",
    )
    with contextlib.suppress(OSError):
        shutil.rmtree(packed)
    return pc.read_case(folder)


def write_emps(folder: Path) -> None:
    """Write files of the form of EMPS: a mass under nested loops, 3 s at 1 kHz."""
    for seed, name in enumerate(("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")):
        scipy.io.savemat(folder / name, _emps_signals(np.random.default_rng(seed)))


def _emps_signals(rng: np.random.Generator) -> dict[str, object]:
    t = 1e-3 * np.arange(3000)
    x = 0.1 * np.sin(2 * np.pi * 0.4 * t)
    force = -0.1 * (0.8 * np.pi) ** 2 * 95 * np.sin(0.8 * np.pi * t) + 15 * np.sign(
        np.cos(0.8 * np.pi * t)
    )
    return {
        "t": t,
        "qm": x + 1e-6 * rng.standard_normal(t.size),
        "qg": x + 1e-4 * np.cos(t),
        "vir": force / 35.15,
        "kp": 160.18,
        "kv": 243.45,
        "gtau": 35.15,
        "pulses_N": 0 * t,
    }
