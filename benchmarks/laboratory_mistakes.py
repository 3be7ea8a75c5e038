"""Mistakes with records and maps, and what `identify --strict` says first of them."""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from pneumo_casadi.virtual_bench import VirtualAxis, make_case, metered_map

#: Length of the records [s].
DURATION = 10.0


def rewrite(folder: Path, change: Callable[[pd.DataFrame], pd.DataFrame | None]) -> None:
    """Replace the records of a case by what a function makes of their tables."""
    for path in sorted(folder.glob("*.csv.gz")):
        table = pd.read_csv(path)
        changed = change(table)
        (table if changed is None else changed).to_csv(path, index=False)


def shifted(table: pd.DataFrame) -> None:
    """Log the command one row late."""
    for column in ("u_P_V", "u_N_V"):
        table[column] = table[column].shift(1, fill_value=table[column][0])


def swapped(table: pd.DataFrame) -> None:
    """Exchange the pressure sensors."""
    table[["p_P_Pa", "p_N_Pa"]] = table[["p_N_Pa", "p_P_Pa"]].to_numpy()


def scaled(
    columns: tuple[str, ...], factor: float, offset: float
) -> Callable[[pd.DataFrame], None]:
    """Return a change of unit or zero that nothing tells of."""

    def change(table: pd.DataFrame) -> None:
        for column in columns:
            table[column] = factor * table[column] + offset

    return change


def other_valve(folder: Path, axis: VirtualAxis) -> None:
    """Put the map of a valve of 1.6 times the conductance into the folder."""
    valve = axis.valve
    larger = replace(valve, k_supply=1.6 * valve.k_supply, k_exhaust=1.6 * valve.k_exhaust)
    table = pd.DataFrame(metered_map(replace(axis, valve=larger)))
    table.to_csv(folder / "flow_map.csv", index=False)


PRESSURES, POSITIONS = ("p_P_Pa", "p_N_Pa"), ("x_m", "x_ref_m")
#: Mistake -> how it is made, and a word that its first line must hold.
MISTAKES: dict[str, tuple[Callable[[Path, VirtualAxis], None], str]] = {
    "gauge pressures": (
        lambda folder, axis: rewrite(folder, scaled(PRESSURES, 1.0, -axis.p_ext)),
        "gauge",
    ),
    "swapped chambers": (lambda folder, axis: rewrite(folder, swapped), "swapped"),
    "bar for Pa": (lambda folder, axis: rewrite(folder, scaled(PRESSURES, 1e-5, 0.0)), "bar"),
    "u one row late": (lambda folder, axis: rewrite(folder, shifted), "late"),
    "position from the end": (
        lambda folder, axis: rewrite(folder, scaled(POSITIONS, 1.0, axis.stroke / 2)),
        "end of the stroke",
    ),
    "map of another valve": (other_valve, "map"),
}


def commit(mistake: str, seed: int) -> dict[str, Any]:
    """Return what `identify --strict` says first of a case with a mistake, and its exit code."""
    make, word = MISTAKES[mistake]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case"
        made = make_case(path, seed, duration=DURATION)
        make(path, made.axis)
        command = [sys.executable, "-m", "pneumo_casadi", "identify", str(path), "--strict"]
        run = subprocess.run(
            [*command, "--output", str(Path(folder) / "report")],
            capture_output=True,
            text=True,
            check=False,
        )
    said = (run.stdout + run.stderr).replace(f"{folder}/", "")
    lines = [line for line in said.splitlines() if line.strip()]
    first = lines[0].strip() if lines else ""
    named = word in first.lower()
    return {
        "seed": seed,
        "first_line": first[:300],
        "exit_code": run.returncode,
        "named": named,
        "met": named and run.returncode != 0,
    }
