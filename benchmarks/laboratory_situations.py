"""What laboratories own: the virtual bench of each situation, its files, and its tolerances."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd
from laboratory_mistakes import rewrite

from pneumo_casadi.data import (
    Arrangement,
    CascadeController,
    FlowSource,
    NoController,
    PidController,
    read_case,
)
from pneumo_casadi.virtual_bench import Laboratory, VirtualAxis

#: Largest relative errors where the flow was metered, by the beginning of a parameter's name.
METERED = {"M": 0.005, "X_s": 0.03, "f_v": 0.1, "F_c": 0.05}
#: The same where a source of the flow is missing.
UNMETERED = {"M": 0.01, "X_s": 0.03}


@dataclass(frozen=True)
class Situation:
    """What a laboratory has, how its case is changed, and how close the estimates must be.

    `laboratory` is made for an axis; `change` rewrites the folder; `tolerances` are relative errors
    by the beginning of a name, intervals count where there is none. An error that all parameters
    of an axis share makes one draw of them: `axes` says how many times as many axes it needs.
    """

    laboratory: Callable[[VirtualAxis], Laboratory]
    change: Callable[[Path, VirtualAxis], None] | None = None
    axis: Callable[[VirtualAxis], VirtualAxis] = lambda axis: axis
    tolerances: Mapping[str, float] = field(default_factory=lambda: METERED)
    axes: int = 1


def owning(**owned: Any) -> Callable[[VirtualAxis], Laboratory]:
    """Return the same laboratory for every axis."""
    return lambda axis: Laboratory(**owned)


def pid(axis: VirtualAxis) -> Laboratory:
    """Return a PID controller at half the rate of the record."""
    controller = PidController(
        k_p=1.5 * axis.gain,
        u_max=3.0,
        k_i=axis.gain,
        k_d=0.03 * axis.gain,
        derivative_filter=0.01,
        anti_windup="clamping",
        sample_time=0.002,
    )
    return Laboratory(controller=controller)


def cascade(axis: VirtualAxis) -> Laboratory:
    """Return a PI velocity loop within a position loop."""
    k_v = 0.15 * axis.gain
    controller = CascadeController(
        k_p=6.0, k_v=k_v, u_max=3.0, k_i=3.0 * k_v, velocity_filter=0.005
    )
    return Laboratory(controller=controller)


def in_other_units(folder: Path, axis: VirtualAxis) -> None:
    """Gauge pressures in bar, position in mm from the end of the stroke; columns.json says so."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        bar = {f"p{v}": ((table[f"p_{v}_Pa"] - axis.p_ext) / 1e5).round(6) for v in "PN"}
        mm = {n: (1e3 * (table[f"{n}_m"] + stroke / 2)).round(5) for n in ("x", "x_ref")}
        return pd.DataFrame({**table[["t_s", "u_P_V", "u_N_V"]], **bar, **mm})

    stroke = read_case(folder, check=False).bench.stroke
    rewrite(folder, change)
    columns = {f"p_{v}_Pa": {"column": f"p{v}", "unit": "bar", "offset": axis.p_ext} for v in "PN"}
    for name in ("x", "x_ref"):
        columns[f"{name}_m"] = {"column": name, "unit": "mm", "offset": -stroke / 2}
    (folder / "columns.json").write_text(json.dumps(columns), "utf-8")


def in_two_files(folder: Path, axis: VirtualAxis) -> None:
    """Two records to identify on, each on a clock of its own."""
    table = pd.read_csv(folder / "identify.csv.gz")
    half = len(table) // 2
    table[:half].to_csv(folder / "identify_1.csv.gz", index=False)
    table[half:].assign(t_s=table.t_s[half:] - table.t_s[half]).to_csv(
        folder / "identify_2.csv.gz", index=False
    )
    (folder / "identify.csv.gz").unlink()


SITUATIONS = {
    "metered, two 3/2 valves": Situation(owning()),
    "metered, meter of 1 %": Situation(owning(meter_accuracy=0.01), axes=4),
    "one 5/3 valve": Situation(owning(arrangement=Arrangement.ONE_5_3)),
    "two valves with different maps": Situation(owning(other_valve=0.25)),
    "data sheet, C and b 30 % off": Situation(
        owning(source=FlowSource.DATA_SHEET, data_sheet_error=0.3), tolerances=UNMETERED
    ),
    "nothing but areas": Situation(owning(source=FlowSource.NONE), tolerances=UNMETERED),
    "gauge bar, mm from the end": Situation(owning(), in_other_units),
    "supply pressure recorded": Situation(owning(supply=True)),
    "velocity and acceleration recorded": Situation(owning(v_noise=2e-3, a_noise=0.1)),
    "force recorded": Situation(owning(load_force=40.0)),
    "vertical, 10 kg": Situation(owning(angle_deg=90.0), axis=lambda axis: replace(axis, M=10.0)),
    "double rod": Situation(owning(double_rod=True)),
    "no controller, no reference": Situation(owning(controller=NoController(), reference=False)),
    "PID, slower than the record": Situation(pid),
    "cascade": Situation(cascade),
    "two files": Situation(owning(), in_two_files),
    "jitter of 10 % and gaps": Situation(owning(jitter=0.1, gaps=((3.0, 3.2), (7.0, 7.1)))),
    "moving mass alone": Situation(owning(pressures=True)),
}
