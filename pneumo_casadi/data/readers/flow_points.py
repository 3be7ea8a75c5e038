"""Points of a metered flow map, read from its file: columns and finite values, no physics."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data.readers.tables import read_table
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.input_files import listed

FLOW_COLUMNS = ("u_V", "p_Pa", "q_m_kg_per_s")
"""Columns of ``flow_map.csv``: command, pressure at the outlet, flow into the chamber."""


def read_flow_points(path: Path) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the points of a flow map and their rows.

    Parameters
    ----------
    path : Path
        The file, plain or compressed (``.gz``); other columns are ignored, and so are empty lines.

    Returns
    -------
    points : (n, 3) array
        Command [V], absolute pressure [Pa] and mass flow [kg/s].
    rows : (n,) array
        Line of the file of each point; the header is line 1.

    Raises
    ------
    CaseError
        Naming file, row, column and remedy, if a column is missing or a value is no number.
    """
    table = read_table(path, FLOW_COLUMNS)
    missing = [name for name in FLOW_COLUMNS if name not in table.columns]
    if missing:
        raise CaseError(
            f"{path}, row 1: column {', '.join(missing)} missing; found "
            f"{listed(table.names)}; the header must read {','.join(FLOW_COLUMNS)}"
        )
    values = np.column_stack([table.columns[name] for name in FLOW_COLUMNS])
    kept = np.flatnonzero(~np.isnan(values).all(axis=1))
    points, rows = values[kept], kept + table.first_line
    for name, column in zip(FLOW_COLUMNS, points.T, strict=True):
        bad = ~np.isfinite(column)
        if bad.any():
            first = int(np.argmax(bad))
            cell = "empty" if np.isnan(column[first]) else f"{column[first]}"
            raise CaseError(
                f"{path}, row {rows[first]}: {name} is {cell}, not a number; complete or remove "
                "the row"
            )
    return points, rows
