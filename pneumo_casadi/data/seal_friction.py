"""Measurements of an O-ring in a single-acting pneumatic cylinder, by E. Zillen (CC0).

A cylinder of 25.7 mm bore (project "3D-printed-pneumatic-actuator") is drawn out and pushed in by
a machine ten times at about 15 mm/s, while a regulator holds its pressure at 1, 3, 5 or 7 bar
gauge. Position, pressure and the force that holds the rod are recorded with a real clock: 10 ms
between rows, now and then up to 20 ms, and gaps of up to 0.3 s.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from pneumo_casadi.data.bench.driven_bench import PressureBench
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.readers.recordings import split_at_gaps
from pneumo_casadi.data.recording.channels import InputHold
from pneumo_casadi.data.recording.clock import Clock
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

#: File of each pressure [bar gauge]; the highest one is held out.
FILES = {pressure: f"O-ring257_{pressure}bar.tsv.gz" for pressure in (1, 3, 5, 7)}
HELD_OUT = 7
BORE = 0.0257
#: The laboratory's ambient pressure is not stated; the gauge pressures make it irrelevant.
P_EXT = 101325.0
SAMPLING_FREQUENCY = 100.0
#: Standard uncertainty of a printed bore of 25.7 mm, twice that of its radius.
AREA_ACCURACY = 0.01
#: Columns of the files, which have no header; the raw voltages are not used.
COLUMNS = ("t_ms", "laser_V", "pressure_V", "force_V", "x_mm", "p_bar", "force_N")


def read_seal_friction(folder: str | Path) -> Case:
    """Read the measurements of the O-ring as a case of a pressure-driven axis.

    Channels: ``p_P`` [Pa, absolute]; ``x`` [m], which grows as the cylinder opens; ``F_load`` [N],
    the force on the rod in +x: what holds the rod against the pressure, with its sign reversed.

    Parameters
    ----------
    folder : str or Path
        Folder with the author's files.

    Returns
    -------
    Case
        1, 3 and 5 bar to identify on, 7 bar held out; one record a stretch between gaps.

    Raises
    ------
    CaseError
        If a file is missing or is not the one expected.
    """
    folder = Path(folder)
    bench = PressureBench(
        SAMPLING_FREQUENCY,
        np.pi / 4 * BORE**2,
        0.0,
        None,
        P_EXT,
        area_accuracy=AREA_ACCURACY,
        clock=Clock.AS_RECORDED,
        signals=frozenset({"F_load"}),
    )
    records = {pressure: _read(folder / name) for pressure, name in FILES.items()}
    identify = [part for pressure in FILES if pressure != HELD_OUT for part in records[pressure]]
    return Case(folder, bench, tuple(identify), records[HELD_OUT])


def is_seal_friction(folder: Path) -> bool:
    """Tell whether a folder holds these measurements."""
    return all((folder / name).is_file() for name in FILES.values())


def _read(path: Path) -> tuple[Recording, ...]:
    if not path.is_file():
        raise CaseError(f"{path}: no such file; give the folder with the author's measurements")
    try:
        table = pd.read_csv(path, sep="\t", header=None, names=COLUMNS, dtype=float)
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: no table of {len(COLUMNS)} columns ({error})") from None
    channels = {
        "p_P": 1e5 * table["p_bar"] + P_EXT,
        "x": -1e-3 * table["x_mm"],
        "F_load": -table["force_N"],
    }
    name = path.name.removesuffix(".tsv.gz")
    record = Recording(
        1e-3 * table["t_ms"],
        channels,
        name,
        str(path),
        InputHold.LINEAR,
        first_line=1,
        clock=Clock.AS_RECORDED,
    )
    return split_at_gaps(record)
