"""The metered flow of a valve, interpolated: enough for a check, and no model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # its submodules are loaded at first use
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import cKDTree

from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.readers.flow_points import read_flow_points
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.input_files import is_named

NO_FLOW_MAP = (
    "no flow_map.csv, but bench.json does not say that the valve is not metered; add the map "
    '(columns u_V,p_Pa,q_m_kg_per_s), or write "valve": {"source": "none"} or the data '
    "sheet's C and b"
)
FEWEST = 3
"""Commands and pressures of a map: the least with which its three branches have a slope."""
KNOTS = 100
"""Commands and pressures, at most, between which scattered points are interpolated."""
PLANE, NEAR, FLAT = 8, 1e-3, 1e-6
"""Points that a plane is laid through, the distance, in shares of the ranges, up to which one is at
the very place, and the weight that keeps a plane flat where its points lie on a line."""
REPEATED = 0.05
"""Difference of two flows at one point, over the size of the flow: hysteresis stays below it."""
CONTRADICTED = 0.3
"""The same that no metering explains."""
CORRELATED = 0.3
"""Rank correlation of flow and command: above 0.8 for a valve, near 0 for noise."""
MOSTLY, COARSE = 0.5, 1e-3
"""Share of the points metered again that agree to the last digit, from which rows were copied, and
quantum of the flow over its size from which a meter shows the same number by chance."""
ON_A_LINE = "flow map on a line"
USELESS = frozenset(
    {ON_A_LINE, "flow map too small", "flow map without flow", "flow map without opening"}
)
"""Findings after which nothing is compared with a map; none is fitted to one on a line."""
AROUND, OUTLIER = 6, 5.0
"""Neighbours that a point is compared with, and how many times as far off as nine of ten it is."""


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
    """Return the flow maps of a case folder by chamber; none where none was metered.

    Raises
    ------
    CaseError
        If a map cannot be read.
    """
    both = _read(folder / "flow_map.csv")
    if both is not None:
        return {"P": both, "N": both}
    own = {chamber: _read(folder / f"flow_map_{chamber}.csv") for chamber in "PN"}
    return {chamber: flow for chamber, flow in own.items() if flow is not None}


def _read(path: Path) -> MeteredFlow | None:
    if not is_named(path):
        return None
    points, _ = read_flow_points(path)
    u, p, q_m = points.T
    try:
        interpolation = _interpolation(u, p, q_m)
    except ValueError:
        raise CaseError(
            f"{path}: its {u.size} points span no area of commands and pressures; meter several "
            "commands at several pressures"
        ) from None
    return MeteredFlow(path, u, p, q_m, interpolation)


def check_flow_map(flow: MeteredFlow) -> Iterator[Finding]:
    """Yield where a map contradicts itself: too few points, two flows of a point, no monotony."""
    name, u, p = flow.path.name, flow.u, flow.p
    commands, pressures = np.unique(u).size, np.unique(p).size
    if not np.ptp(flow.q_m):
        yield _finding(
            Grade.SEVERE,
            "flow map without flow",
            f"{name}: states {flow.q_m[0]:g} kg/s at all points; is it the right column?",
        )
        return
    if commands < FEWEST or pressures < FEWEST or u.size < FEWEST**2:
        yield _finding(
            Grade.SEVERE,
            ON_A_LINE if min(commands, pressures) == 1 else "flow map too small",
            f"{name}: {_count(u.size, 'point')}, {_count(commands, 'command')} and "
            f"{_count(pressures, 'pressure')}: meter filling, closed and emptying, at three "
            "pressures each at least.",
        )
        return
    size = float(np.quantile(np.abs(flow.q_m), 0.9)) or float(np.abs(flow.q_m).max())
    order = np.lexsort((p, u))
    same = (np.diff(u[order]) == 0) & (np.diff(p[order]) == 0)
    spread = np.abs(np.diff(flow.q_m[order])) * same
    k = int(np.argmax(spread))
    if spread[k] > REPEATED * size:
        yield _finding(
            Grade.SEVERE if spread[k] > CONTRADICTED * size else Grade.CAUTION,
            "flow map with two flows of a point",
            f"{name}: at {u[order[k]]:.4g} V and {p[order[k]]:.6g} Pa it states "
            f"{flow.q_m[order[k]]:.3g} and {flow.q_m[order[k + 1]]:.3g} kg/s "
            f"({int(np.count_nonzero(spread > REPEATED * size))} such points); meter them again.",
        )
    yield from _copies(flow, size)
    correlation = float(scipy.stats.spearmanr(u, flow.q_m).statistic)
    if correlation < CORRELATED:
        remedy = (
            "is the sign of u or q_m reversed?"
            if correlation < -CORRELATED
            else "are its columns swapped, or its rows mixed?"
        )
        yield _finding(
            Grade.SEVERE,
            "flow map without opening",
            f"{name}: the flow does not grow with the command (rank correlation "
            f"{correlation:.2f}); {remedy}",
        )
        return
    yield from _outliers(flow, size)


def _copies(flow: MeteredFlow, size: float) -> Iterator[Finding]:
    """Yield rows that stand in a map twice; closed valves may show 0 again and again."""
    flowing = np.flatnonzero(flow.q_m)
    points = np.column_stack([flow.u, flow.p, flow.q_m])[flowing]
    _, first, which = np.unique(points, axis=0, return_index=True, return_inverse=True)
    again = len(points) - np.unique(points[:, :2], axis=0).shape[0]
    copied = np.flatnonzero(first[which.ravel()] != np.arange(flowing.size))
    quantum = float(np.diff(np.unique(flow.q_m)).min())
    if copied.size > MOSTLY * again and copied.size and quantum < COARSE * size:
        k = int(flowing[copied[0]])
        yield _finding(
            Grade.CAUTION,
            "flow map with copied rows",
            f"{flow.path.name}: {copied.size} of {flow.u.size} points repeat an earlier one to the "
            f"last digit of the flow, the first is point {k + 1}, {flow.u[k]:.4g} V and "
            f"{flow.p[k]:.6g} Pa: what is metered once counts twice, and intervals come out too "
            "small; remove them.",
        )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _outliers(flow: MeteredFlow, size: float) -> Iterator[Finding]:
    """Yield points far from those around them."""
    points = np.column_stack([x / np.ptp(x) for x in (flow.u, flow.p)])
    count = min(AROUND + 1, flow.u.size)
    nearest = np.asarray(cKDTree(points).query(points, k=count)[1])
    off = np.abs(flow.q_m - np.median(flow.q_m[nearest[:, 1:]], axis=1))
    usual = float(np.quantile(off, 0.9))
    far = np.flatnonzero(off > max(OUTLIER * usual, CONTRADICTED * size))
    if far.size:
        k = int(far[np.argmax(off[far])])
        yield _finding(
            Grade.CAUTION,
            "flow map with outliers",
            f"{flow.path.name}: point {k + 1}, {flow.u[k]:.4g} V and {flow.p[k]:.6g} Pa, states "
            f"{flow.q_m[k]:.3g} kg/s, those around it {flow.q_m[k] - off[k]:.3g} or so "
            f"({far.size} such points); meter it again, or remove it.",
        )


def _finding(grade: Grade, name: str, text: str) -> Finding:
    return Finding(grade, name, "flow_map", text)


def _interpolation(u: FloatArray, p: FloatArray, q_m: FloatArray) -> Any:
    points, which, times = np.unique(
        np.column_stack([u, p]), axis=0, return_inverse=True, return_counts=True
    )
    q_m = np.bincount(which.ravel(), weights=q_m) / times  # the mean of a point's flows
    distinct_u, distinct_p = (np.unique(values) for values in points.T)
    if distinct_u.size * distinct_p.size == len(points):  # in the order of the commands
        grid = q_m.reshape(distinct_u.size, distinct_p.size)
        return RegularGridInterpolator((distinct_u, distinct_p), grid)
    knots = tuple(_knots(distinct) for distinct in (distinct_u, distinct_p))
    return RegularGridInterpolator(knots, _at_knots(points, q_m, knots))


def _at_knots(points: FloatArray, q_m: FloatArray, knots: Sequence[FloatArray]) -> FloatArray:
    """Return flows at the knots of a grid, each by a plane through the points around it.

    Near points weigh most, and no flow is beyond those around. Triangles between the points would
    do as well where these are spread, but take seconds where they lie almost on lines.
    """
    size = np.ptp(points, axis=0)
    if not size.all() or np.linalg.matrix_rank((points - points.mean(axis=0)) / size, 1e-6) < 2:
        raise ValueError("the points lie on a line")
    at = np.stack(np.meshgrid(*knots, indexing="ij"), axis=-1) / size
    count = min(PLANE, len(points))
    distance, nearest = cKDTree(points / size).query(at, k=count)
    away = points[nearest] / size - at[:, :, None]
    plane = np.concatenate([np.ones((*away.shape[:-1], 1)), away], axis=-1)
    weights = 1.0 / (np.square(distance) + NEAR**2)
    H = np.einsum("...k,...ki,...kj->...ij", weights, plane, plane)
    g = np.einsum("...k,...ki,...k->...i", weights, plane, q_m[nearest])
    level = np.linalg.solve(H + FLAT * np.diag([0.0, 1.0, 1.0]), g[..., None])[..., 0, 0]
    around = q_m[nearest]
    return np.asarray(np.clip(level, around.min(axis=-1), around.max(axis=-1)))


def _knots(distinct: FloatArray) -> FloatArray:
    """Return the distinct values, or some spread over them where there are many."""
    if distinct.size <= KNOTS:
        return distinct
    return np.asarray(np.unique(np.quantile(distinct, np.linspace(0.0, 1.0, KNOTS))))
