"""A case folder made from log files: ``bench.json`` and ``columns.json`` besides copies of them."""

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pneumo_casadi.data.bench.bench_file import bench_from_content
from pneumo_casadi.data.cylinder import Cylinder
from pneumo_casadi.data.readers.column_guess import ColumnGuess
from pneumo_casadi.data.readers.columns import COLUMNS_FILE, column_map
from pneumo_casadi.data.readers.tables import read_table, suffix_of
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import atomic_folder

GAS_CONSTANT = 287.0
CELSIUS = 273.15


def read_header(path: Path) -> dict[str, FloatArray]:
    """Return the columns of numbers of a log file.

    Raises
    ------
    CaseError
        If the file cannot be read or has no column of numbers.
    """
    columns: dict[str, FloatArray] = {}
    for name in read_table(path, ()).names:
        try:
            columns |= read_table(path, {name}).columns
        except CaseError:  # text in a column that may well not be needed
            continue
    if not columns:
        raise CaseError(f"{path}: no column of numbers; export the record again")
    return columns


def make_folder(
    folder: Path,
    cylinder: Cylinder,
    guesses: Sequence[ColumnGuess],
    records: Mapping[str, Sequence[Path]],
    sampling_frequency: float,
    further: Mapping[str, Any],
    flow_map: Path | None = None,
) -> None:
    """Write a case folder in one step; nothing is overwritten.

    Parameters
    ----------
    folder : Path
        New folder.
    cylinder : Cylinder
        The axis.
    guesses : sequence of ColumnGuess
        Entries of ``columns.json``.
    records : mapping of str to sequence of Path
        Files to copy, under ``"identify"`` and ``"validate"``.
    sampling_frequency : float
        [Hz].
    further : mapping
        Further entries of ``bench.json``, the controller among them.
    flow_map : Path, optional
        Map of the valve to copy; without it the valve counts as unknown.

    Raises
    ------
    CaseError
        If the folder holds something, or an entry is not plausible.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise CaseError(f"{folder}: is there already and not empty; choose a new folder")
    S_P, S_N = cylinder.areas
    bench: dict[str, Any] = {
        "sampling_frequency_Hz": _short(sampling_frequency),
        "S_P_m2": _short(S_P),
        "S_N_m2": _short(S_N),
        "stroke_m": _short(cylinder.stroke),
        "p_ext_Pa": _short(cylinder.ambient),
        "p_supply_Pa": _short(cylinder.supply),
        "T_K": _short(cylinder.temperature),
        "r_J_per_kg_K": GAS_CONSTANT,
        "valve": {"source": "none" if flow_map is None else "metered"},
        **further,
    }
    bench_from_content(bench)
    columns: dict[str, Any] = {}
    for guess in guesses:
        columns |= guess.entry
    column_map(columns)
    with atomic_folder(folder, over=False) as draft:
        for name, content in (("bench.json", bench), (COLUMNS_FILE, columns)):
            (draft / name).write_text(_one_line_an_entry(content), "utf-8")
        for role, paths in records.items():
            for number, path in enumerate(paths, start=1):
                stem = role if len(paths) == 1 else f"{role}_{number:02d}"
                shutil.copyfile(path, draft / f"{stem}{suffix_of(path)}")
        if flow_map is not None:
            shutil.copyfile(flow_map, draft / "flow_map.csv")


def sampling_frequency_of(guesses: Sequence[ColumnGuess], columns: Mapping[str, Any]) -> float:
    """Return the rows per second of a file, from its column of time."""
    clock = next(guess for guess in guesses if guess.channel == "t")
    t = SI_FACTORS["s"][clock.unit] * columns[clock.column]
    if t.size < 2 or t[-1] <= t[0]:
        raise CaseError(f"column `{clock.column}` does not run forward; is it the time?")
    return float((t.size - 1) / (t[-1] - t[0]))


def _one_line_an_entry(content: Mapping[str, Any]) -> str:
    entries = (
        f" {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}"
        for key, value in content.items()
    )
    return "{\n" + ",\n".join(entries) + "\n}\n"


def _short(value: float) -> float:
    return float(f"{value:.6g}")
