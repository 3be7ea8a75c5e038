"""The measured static flow map of a servodistributor: q_m(u, p) at constant supply pressure."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumo_casadi.data.readers.flow_points import read_flow_points
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

# Outside these bounds a value is a unit error rather than a pneumatic valve: 10 kPa is a
# technical vacuum, 100 MPa a hydraulic pressure, and 1 kg/s is about 50 000 NL/min.
P_PLAUSIBLE = (1e4, 1e8)
Q_PLAUSIBLE = 1.0
#: Pressures nearer than this share of their range are equal: no sensor resolves a millionth.
RESOLUTION = 1e-6
#: Commands nearer than this share of their range are one: a converter of ten bits gives as much.
COMMAND_RESOLUTION = 1e-3
#: Two pressures belong to two columns where the gap between them is at least this share of the
#: step that a command makes across it. A gap between columns is nearly a whole step, less their
#: scatter; one within a column is a small part of the step to the next column. A grid of which
#: commands were left out at random has still its columns where a quarter of the points is left.
LEAST_SHARE = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class FlowMap:
    """Measured points of the mass flow out of a servodistributor into a chamber.

    Parameters
    ----------
    u : (n,) array
        Command (spool position) [V].
    p : (n,) array
        Absolute pressure at the outlet [Pa].
    q_m : (n,) array
        Mass flow, positive into the chamber [kg/s].
    p_supply : float or (n,) array, optional
        Absolute supply pressure [Pa]; an array where it differs from point to point.
    p_ext : float, optional
        Absolute pressure at the exhaust [Pa].
    source : str, optional
        Where the points come from; it opens every error message.
    rows : (n,) array of int, optional
        Line of each point in `source`, for error messages; counted from 1 by default.

    Raises
    ------
    CaseError
        If lengths differ, a value is not finite, or a pressure or flow is out of all
        proportion, which means bar, gauge pressure, NL/min or g/s.

    Notes
    -----
    The points are stored read-only, in the order given, as copies. They may be scattered;
    `is_grid` states whether every command was metered at every pressure exactly once.

    Examples
    --------
    >>> table = FlowMap([-1, -1, 1, 1], [1e5, 7e5, 1e5, 7e5], [0, -4e-3, 3e-3, 0], p_supply=7e5)
    >>> table.n, table.is_grid, table.q_max
    (4, True, 0.004)
    """

    u: FloatArray
    p: FloatArray
    q_m: FloatArray
    p_supply: float | FloatArray | None = None
    p_ext: float | None = None
    source: str = "flow map"
    rows: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        for name in ("u", "p", "q_m"):
            object.__setattr__(self, name, _frozen_vector(getattr(self, name), name, self.source))
        if not self.n:
            raise CaseError(
                f"{self.source}: no points; meter q_m at several commands and pressures"
            )
        for name in ("p", "q_m"):
            if len(getattr(self, name)) != self.n:
                raise CaseError(
                    f"{self.source}: `u` has {self.n} points but `{name}` has "
                    f"{len(getattr(self, name))}; give one value per point"
                )
        rows = np.arange(1, self.n + 1) if self.rows is None else np.array(self.rows, dtype=int)
        rows.setflags(write=False)
        object.__setattr__(self, "rows", rows)
        for name, unit in (("u", "V"), ("p", "Pa"), ("q_m", "kg/s")):
            self._refuse(~np.isfinite(getattr(self, name)), name, unit, "remove the point")
        self._check_pressures()
        self._refuse(
            np.abs(self.q_m) > Q_PLAUSIBLE, "q_m", "kg/s", "is it in NL/min or g/s? convert to kg/s"
        )
        if not np.any(self.q_m):
            raise CaseError(f"{self.source}: `q_m` is zero at all {self.n} points; nothing to fit")

    def _refuse(self, bad: NDArray[np.bool_], name: str, unit: str, remedy: str) -> None:
        if bad.any():
            first = int(np.argmax(bad))
            value = np.broadcast_to(getattr(self, name), (self.n,))[first]
            row = np.asarray(self.rows)[first]
            more = f" ({int(bad.sum())} such points)" if bad.sum() > 1 else ""
            raise CaseError(
                f"{self.source}, row {row}: `{name}` is {value:g} {unit}{more}; {remedy}"
            )

    def _check_pressures(self) -> None:
        low, high = P_PLAUSIBLE
        remedy = "expected absolute Pa; is it in bar, psi or a gauge pressure?"
        self._refuse(~((self.p >= low) & (self.p <= high)), "p", "Pa", remedy)
        if self.p_supply is not None:
            supply = np.array(self.p_supply, dtype=float)
            if supply.shape not in ((), (self.n,)):
                raise CaseError(
                    f"{self.source}: `p_supply` has shape {supply.shape}; "
                    f"give one value or one for each of the {self.n} points"
                )
            supply.setflags(write=False)
            object.__setattr__(self, "p_supply", float(supply) if supply.ndim == 0 else supply)
            bad = np.broadcast_to(~((supply >= low) & (supply <= high)), (self.n,))
            self._refuse(bad, "p_supply", "Pa", remedy)
            self._refuse(
                self.p > 1.05 * supply,
                "p",
                "Pa",
                f"it exceeds the supply pressure ({np.max(supply):g} Pa at most) by more than 5 %: "
                "is one of them a gauge pressure, or `p_supply_Pa` of bench.json too low?",
            )
        if self.p_ext is not None and not low <= self.p_ext <= high:
            raise CaseError(f"{self.source}: `p_ext` is {self.p_ext:g} Pa; {remedy}")

    @property
    def n(self) -> int:
        """Number of points."""
        return len(self.u)

    @property
    def u_range(self) -> tuple[float, float]:
        """Least and greatest command [V]."""
        return float(self.u.min()), float(self.u.max())

    @property
    def p_range(self) -> tuple[float, float]:
        """Least and greatest outlet pressure [Pa]."""
        return float(self.p.min()), float(self.p.max())

    @property
    def q_max(self) -> float:
        """Greatest magnitude of the flow [kg/s]; errors are stated in per cent of it."""
        return float(np.abs(self.q_m).max())

    @property
    def is_grid(self) -> bool:
        """True if each distinct command occurs once with each distinct pressure."""
        u, p = np.unique(self.u), np.unique(self.p)
        if u.size * p.size != self.n:
            return False
        cell = np.searchsorted(u, self.u) * p.size + np.searchsorted(p, self.p)
        return np.unique(cell).size == self.n

    @property
    def command_numbers(self) -> NDArray[np.int64]:
        """Number of each point's command, counted from 0 at the least one, shape (n,)."""
        order = np.argsort(self.u, kind="stable")
        width = max(float(np.ptp(self.u)), float(np.finfo(float).tiny))
        number = np.empty(self.n, dtype=np.int64)
        number[order] = np.r_[0, np.cumsum(np.diff(self.u[order]) > COMMAND_RESOLUTION * width)]
        return number

    @property
    def column_numbers(self) -> NDArray[np.int64]:
        """Pressure column of each point, counted from 0 at the least pressure, shape (n,).

        Pressures that were measured, not only set, scatter about those that were meant: points
        of one column differ by less than the steps that each command makes from column to column.
        """
        return _columns(self.command_numbers, self.p)

    def grid(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return commands (n_u,) [V], pressures (n_p,) [Pa] and flows (n_u, n_p) [kg/s].

        Raises
        ------
        CaseError
            If the points are not a grid.
        """
        if not self.is_grid:
            raise CaseError(
                f"{self.source}: the {self.n} points are not a grid of "
                f"{np.unique(self.u).size} commands by {np.unique(self.p).size} pressures; "
                "meter every command at every pressure once, or use a model that takes "
                "scattered points"
            )
        u, p = np.unique(self.u), np.unique(self.p)
        return u, p, self.q_m[np.lexsort((self.p, self.u))].reshape(u.size, p.size)

    def require_one_supply(self) -> None:
        """Raise a `CaseError` if the supply pressures differ by more than 1 %."""
        supply = self.p_supply
        if isinstance(supply, np.ndarray) and np.ptp(supply) > 0.01 * supply.mean():
            raise CaseError(
                f"{self.source}: supply pressures from {supply.min():g} to {supply.max():g} Pa; "
                "this model holds at one supply pressure: select the points of one, or fit an "
                "ISO 6358 valve"
            )

    def select(self, mask: ArrayLike) -> "FlowMap":
        """Return the points where `mask`, a boolean (n,) array or an index, holds."""
        keep = np.asarray(mask)
        supply = self.p_supply
        return FlowMap(
            self.u[keep],
            self.p[keep],
            self.q_m[keep],
            supply[keep] if isinstance(supply, np.ndarray) else supply,
            self.p_ext,
            self.source,
            np.asarray(self.rows)[keep],
        )


def _columns(command: NDArray[np.int64], p: FloatArray) -> NDArray[np.int64]:
    """Return the pressure column of each point, see `FlowMap.column_numbers`.

    A gap in the pressures of all points is judged by the mean, over the commands that step across
    it, of its share of their step (`LEAST_SHARE`). There are at least half of the commands in that
    mean: fewer step across a gap within the outermost columns.
    """
    width = float(np.ptp(p)) or 1.0
    levels, level = np.unique(np.round((p - p.min()) / (RESOLUTION * width)), return_inverse=True)
    levels, level = levels * RESOLUTION, level.ravel()
    order = np.lexsort((level, command))
    low, high = level[order[:-1]], level[order[1:]]
    is_step = (np.diff(command[order]) == 0) & (high > low)
    low, high = low[is_step], high[is_step]
    if low.size <= command.max():  # most commands occur once: nothing tells columns from scatter
        return np.asarray(level, dtype=np.int64)
    # What a step adds to the gaps that it spans, from its lower level to its upper one.
    spans, inverses = np.zeros(levels.size), np.zeros(levels.size)
    for total, added in ((spans, np.ones(low.size)), (inverses, 1 / (levels[high] - levels[low]))):
        np.add.at(total, low, added)
        np.add.at(total, high, -added)
        total[:] = np.cumsum(total)
    gaps, n = np.diff(levels), spans[:-1]
    # A gap that no command steps across has nothing to be judged by: its sides are kept apart.
    judges = np.maximum(n, (command.max() + 1) / 2)
    apart = (n < 0.5) | (gaps * inverses[:-1] >= LEAST_SHARE * judges)
    column = np.r_[0, np.cumsum(apart)]
    column = _cut(column, levels, float(np.mean(levels[high] - levels[low])))
    return np.asarray(column[level], dtype=np.int64)


def _cut(column: NDArray[np.int64], levels: FloatArray, step: float) -> NDArray[np.int64]:
    """Cut what is wider than a step: where pressures were swept there are no gaps."""
    first = np.flatnonzero(np.r_[True, np.diff(column) > 0])
    start, end = levels[first], levels[np.r_[first[1:], levels.size] - 1]
    pieces = np.maximum(np.ceil((end - start) / step - RESOLUTION), 1)
    inside = (levels - start[column]) / np.where(end > start, end - start, 1.0)[column]
    piece = np.minimum(np.floor(inside * pieces[column]), pieces[column] - 1)
    apart = (np.diff(column) > 0) | (np.diff(piece) != 0)
    return np.asarray(np.r_[0, np.cumsum(apart)], dtype=np.int64)


def _frozen_vector(values: ArrayLike, name: str, source: str) -> FloatArray:
    vector = np.array(values, dtype=float)
    if vector.ndim != 1:
        raise CaseError(
            f"{source}: `{name}` has shape {vector.shape}; give a flat array, one value per point"
        )
    vector.setflags(write=False)
    return vector


def read_flow_map(
    path: str | Path,
    *,
    p_supply: float | None = None,
    p_ext: float | None = None,
) -> FlowMap:
    """Read a flow map from a CSV file with columns ``u_V, p_Pa, q_m_kg_per_s``.

    Parameters
    ----------
    path : str or Path
        The file, plain or compressed (``.gz``); other columns are ignored.
    p_supply, p_ext : float, optional
        Absolute supply and exhaust pressure of the metering [Pa].

    Returns
    -------
    FlowMap

    Raises
    ------
    CaseError
        Naming file, row (line of the file; the header is line 1), value, unit and remedy.
    """
    path = Path(path)
    points, rows = read_flow_points(path)
    u, p, q_m = points.T
    return FlowMap(u, p, q_m, p_supply=p_supply, p_ext=p_ext, source=str(path), rows=rows)
