"""A case folder made from log files: ``bench.json`` and ``columns.json`` besides copies of them."""

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.data.bench.bench_file import bench_from_content
from pneumo_casadi.data.readers.column_guess import (
    ColumnGuess,
    guess_channels,
    guess_unit,
    looks_gauge,
)
from pneumo_casadi.data.readers.columns import COLUMNS_FILE, column_map
from pneumo_casadi.data.readers.tables import read_table, suffix_of
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import atomic_folder

NEEDED = ("t", "p_P", "p_N", "x")
GAS_CONSTANT = 287.0
CELSIUS = 273.15


@dataclass(frozen=True, slots=True)
class Cylinder:
    """What stands on the label of a cylinder and on the gauges of its supply.

    Parameters
    ----------
    piston, rod : float
        Diameters [m].
    stroke : float
        Length [m].
    supply : float
        Supply pressure, absolute [Pa].
    ambient : float, optional
        Ambient pressure, absolute [Pa].
    temperature : float, optional
        Of the air [K].
    double_rod : bool, optional
        Whether the rod goes through both covers.
    gauge : bool, optional
        Whether its pressures were recorded relative to ambient; otherwise names and values below
        ambient tell.

    Examples
    --------
    >>> [round(1e6 * area) for area in Cylinder(0.040, 0.016, 0.5, 7e5).areas]
    [1257, 1056]
    """

    piston: float
    rod: float
    stroke: float
    supply: float
    ambient: float = 101325.0
    temperature: float = 293.15
    double_rod: bool = False
    gauge: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.rod < self.piston:
            raise CaseError(
                f"rod of {1e3 * self.rod:g} mm in a piston of {1e3 * self.piston:g} mm: give "
                "diameters, the rod's the smaller one"
            )

    @property
    def areas(self) -> tuple[float, float]:
        """S_P and S_N [m²], the rod being on the side of chamber N."""
        annulus = pi / 4 * (self.piston**2 - self.rod**2)
        return (annulus if self.double_rod else pi / 4 * self.piston**2), annulus


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


def guess_columns(
    columns: Mapping[str, FloatArray],
    cylinder: Cylinder,
    stated: Mapping[str, tuple[str, str]],
) -> tuple[ColumnGuess, ...]:
    """Return what `columns.json` should say.

    Parameters
    ----------
    columns : mapping of str to (n,) array
        Columns of the file.
    cylinder : Cylinder
        Its stroke and ambient pressure turn gauge pressures and positions from one end into those
        of the package.
    stated : mapping of str to (str, str)
        Channels that the user has named: column, and unit or an empty text.

    Raises
    ------
    CaseError
        If a needed channel is not found; the message lists the columns of the file.
    """
    names = {channel: column for channel, (column, _) in stated.items()}
    for channel, column in names.items():
        if column not in columns:
            raise CaseError(f"no column `{column}`; the file has {', '.join(columns)}")
        if channel not in UNITS:
            raise CaseError(f"no channel `{channel}`; there are {', '.join(UNITS)}")
    left = tuple(name for name in columns if name not in names.values())
    guessed = guess_channels(left)
    channels = {**{c: n for c, n in guessed.items() if c not in names}, **names}
    if {"u_P", "u_N"} & channels.keys():
        channels.pop("u", None)
    commanded = "u" in channels or {"u_P", "u_N"} <= channels.keys()
    missing = [c for c in NEEDED if c not in channels] + ([] if commanded else ["u"])
    if missing:
        free = [name for name in columns if name not in channels.values()] or ["NAME"]
        two = "; of two valves: --column u_P=NAME --column u_N=NAME" if "u" in missing else ""
        raise CaseError(
            f"no column was recognised as {', '.join(missing)}; the file has {', '.join(columns)}; "
            f"name it, as --column '{missing[0]}={free[0]}'{two}"
        )
    guesses = [
        _guess(channel, column, columns[column], stated.get(channel, ("", ""))[1], cylinder)
        for channel, column in channels.items()
    ]
    position = next(guess for guess in guesses if guess.channel == "x")
    return tuple(
        # One sensor and one reference count from the same end.
        replace(guess, offset=position.offset) if guess.channel == "x_ref" else guess
        for guess in sorted(guesses, key=lambda guess: tuple(UNITS).index(guess.channel))
        for guess in (_opposed(guess) if guess.channel == "u" else (guess,))
    )


def _guess(
    channel: str, column: str, values: FloatArray, unit: str, cylinder: Cylinder
) -> ColumnGuess:
    unit = unit or guess_unit(channel, column, values, cylinder.stroke)
    scale, offset = SI_FACTORS[UNITS[channel]].get(unit), 0.0
    if scale is None:
        raise CaseError(
            f"--column {channel}={column}:{unit}: known units are "
            f"{', '.join(SI_FACTORS[UNITS[channel]])}"
        )
    lowest, highest = scale * float(values.min()), scale * float(values.max())
    below = lowest < 0.9 * cylinder.ambient
    if UNITS[channel] == "Pa" and (cylinder.gauge or looks_gauge(column) or below):
        offset = cylinder.ambient
    elif channel == "x" and lowest > -0.02 * cylinder.stroke and highest > 0.52 * cylinder.stroke:
        offset = -cylinder.stroke / 2
    elif channel == "u" and lowest >= 0:
        offset = -round(scale * float(np.median(values)))  # 0 to 10 V about the null voltage
    return ColumnGuess(channel, column, unit, offset)


def _opposed(command: ColumnGuess) -> tuple[ColumnGuess, ColumnGuess]:
    """Return the commands of both chambers from the one that is logged."""
    scale = SI_FACTORS["V"][command.unit]
    return (
        replace(command, channel="u_P"),
        replace(command, channel="u_N", scale=-scale, offset=-command.offset),
    )


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
