"""The metered flow of a valve, interpolated: enough for a check, and no model."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator, RegularGridInterpolator
from scipy.spatial import QhullError

from pneumo_casadi.data.readers.tables import read_table
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

COLUMNS = ("u_V", "p_Pa", "q_m_kg_per_s")


@dataclass(frozen=True, slots=True)
class MeteredFlow:
    """A static flow map, linear between its points.

    Parameters
    ----------
    path : Path
        Its file.
    u, p, q_m : (n,) array
        Command [V], pressure behind the valve [Pa], flow into the chamber [kg/s].
    table : callable
        q_m at (m, 2) commands and pressures within the range of the points.
    """

    path: Path
    u: FloatArray
    p: FloatArray
    q_m: FloatArray
    table: Any

    def __call__(self, u: FloatArray, p: FloatArray) -> FloatArray:
        """Return q_m(u, p) [kg/s]; beyond the points that of the nearest edge."""
        u = np.clip(u, self.u.min(), self.u.max())
        p = np.clip(p, self.p.min(), self.p.max())
        return np.asarray(self.table(np.column_stack([u, p])), dtype=float)

    @property
    def supply_pressure(self) -> float | None:
        """Pressure at which the widest open valve no longer fills [Pa]; None if all of them do."""
        widest = self.u == self.u.max()
        order = np.argsort(self.p[widest])
        p, q_m = self.p[widest][order], self.q_m[widest][order]
        # Below this share of the largest flow a meter does not tell its sign.
        closed = np.flatnonzero(q_m <= 0.02 * q_m.max())
        if not closed.size or not closed[0]:
            return None
        k = int(closed[0])
        # Near the supply pressure the flow goes with the root of the difference of pressures.
        high, low = max(float(q_m[k - 1]), 0.0) ** 2, max(float(q_m[k]), 0.0) ** 2
        return float(p[k] + (p[k] - p[k - 1]) * low / max(high - low, 1e-300))


def metered_flows(folder: Path) -> Mapping[str, MeteredFlow]:
    """Return the flow maps of a case folder by chamber; none where none can be read.

    What a map lacks is said by its own reader, where the map is used.
    """
    both = _read(folder / "flow_map.csv")
    if both is not None:
        return {"P": both, "N": both}
    own = {chamber: _read(folder / f"flow_map_{chamber}.csv") for chamber in "PN"}
    return {chamber: flow for chamber, flow in own.items() if flow is not None}


def _read(path: Path) -> MeteredFlow | None:
    if not path.is_file():
        return None
    try:
        columns = read_table(path, COLUMNS).columns
        u, p, q_m = (columns[name] for name in COLUMNS)
        return MeteredFlow(path, u, p, q_m, _interpolation(u, p, q_m))
    except (CaseError, KeyError, ValueError, QhullError):
        return None


def _interpolation(u: FloatArray, p: FloatArray, q_m: FloatArray) -> Any:
    distinct_u, distinct_p = np.unique(u), np.unique(p)
    if distinct_u.size * distinct_p.size == u.size:
        grid = q_m[np.lexsort((p, u))].reshape(distinct_u.size, distinct_p.size)
        return RegularGridInterpolator((distinct_u, distinct_p), grid)
    return LinearNDInterpolator((u, p), q_m, fill_value=0.0, rescale=True)
