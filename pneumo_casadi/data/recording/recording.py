"""A recording: channels on one uniform clock, with the hold of its inputs made explicit."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from pneumo_casadi.data.recording.channels import UNITS, InputHold, checked, column_name, read_only
from pneumo_casadi.data.recording.clock import (
    Clock,
    check_forward,
    sample_time,
    split_rows,
    steps_by,
    uniform,
)
from pneumo_casadi.data.recording.parts import part_edges, rows_with_all
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Presentable


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Recording(Presentable):
    """Channels sampled at the same instants.

    The inputs u[k] act from t[k] to t[k+1] as `hold` says; the outputs y[k] belong to the
    state at t[k]. The channels of a row are taken as simultaneous; where one was logged late,
    correct it with `aligned`.

    Parameters
    ----------
    t : (N,) array
        Time stamps [s]; N ≥ 2. By default stored as the uniform clock nearest to them.
    channels : mapping of str to (N,) array
        Signals in SI units, by symbol: ``u_P, u_N`` [V], ``p_P, p_N`` [Pa, absolute],
        ``x, x_ref`` [m], ``F`` [N] and others, see `UNITS`. Copied, and read-only from then on.
    name : str
        Name in messages, tables and figures.
    source : str
        Where it comes from, a file as a rule.
    hold : InputHold
        How the commands run between samples.
    first_line : int, optional
        Line of the source in which row 1 stands; 0 where the source has no lines.
    dt : float, optional
        Sample time [s]; by default that of the clock `t`.
    clock : Clock, optional
        ``Clock.AS_RECORDED`` keeps the stamps as they are: every interval has its own length
        (`intervals`), and `dt` is their median. By default the clock is uniform.

    Raises
    ------
    CaseError
        If lengths differ, a value is not finite, time does not increase, or the clock is not
        uniform although it is said to be.

    Examples
    --------
    >>> rec = Recording([0.0, 0.1, 0.2, 0.3], {"x": [0.0, 1.0, 2.0, 3.0]}, "ramp", "memory",
    ...                 InputHold.ZERO)
    >>> rec.N, round(rec.dt, 9), rec.decimate(2)["x"]
    (4, 0.1, array([0., 2.]))
    """

    t: FloatArray
    channels: Mapping[str, FloatArray]
    name: str
    source: str
    hold: InputHold
    first_line: int = 0
    dt: float = 0.0
    clock: Clock = Clock.UNIFORM

    def __init__(
        self,
        t: ArrayLike,
        channels: Mapping[str, Any],
        name: str,
        source: str,
        hold: InputHold,
        first_line: int = 0,
        dt: float = 0.0,
        clock: Clock = Clock.UNIFORM,
    ) -> None:
        if not isinstance(hold, InputHold):
            raise CaseError(f"{source}: `hold` = {hold!r}; state InputHold.ZERO or .LINEAR")
        for attribute, value in (
            ("name", name),
            ("source", source),
            ("hold", hold),
            ("first_line", first_line),
            ("clock", clock),
        ):
            object.__setattr__(self, attribute, value)
        stamps = checked("t", t, None, source, self.where)
        if stamps.size < 2:
            raise CaseError(f"{source}: {stamps.size} rows; a recording needs at least 2")
        arrays = {
            key: checked(key, values, stamps.size, source, self.where)
            for key, values in channels.items()
        }
        if clock is Clock.AS_RECORDED:
            check_forward(stamps, self.where)
            dt = float(np.median(np.diff(stamps)))
        elif dt and not steps_by(stamps, dt):
            raise CaseError(f"{source}: `t` does not step by dt = {dt:g} s; leave dt out")
        elif not dt:
            dt = sample_time(stamps, self.where)
            stamps = uniform(stamps, dt)
        object.__setattr__(self, "t", read_only(stamps))
        object.__setattr__(self, "channels", MappingProxyType(arrays))
        object.__setattr__(self, "dt", dt)

    def where(self, index: int) -> str:
        """Return source, row (from 1) and, where there is one, line of the sample `index`."""
        line = f" (line {self.first_line + index})" if self.first_line else ""
        return f"{self.source}: row {index + 1}{line}"

    def __getitem__(self, channel: str) -> FloatArray:
        if channel == "t":
            return self.t
        if channel not in self.channels:
            raise CaseError(
                f"{self.source}: no channel `{channel}`; there are {', '.join(self.channels)}"
            )
        return self.channels[channel]

    def __contains__(self, channel: object) -> bool:
        return channel == "t" or channel in self.channels

    @property
    def headline(self) -> str:
        """Name, length, sampling and hold."""
        return (
            f"Recording {self.name}: {self.N} rows of {self.dt:.6g} s, {self.duration:.4g} s, "
            f"hold {self.hold.value}"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the samples, one column a channel with its unit, as in a case folder."""
        columns = {"t_s": self.t}
        columns |= {column_name(name) if name in UNITS else name: self[name] for name in self.names}
        return pd.DataFrame(columns)

    def overview(self) -> pd.DataFrame:
        """Return minimum, mean and maximum of each channel."""
        frame = self.to_frame().drop(columns="t_s")
        return frame.agg(["min", "mean", "max"]).T

    def __reduce__(self) -> tuple[Any, ...]:
        parts = (self.t, dict(self.channels), self.name, self.source, self.hold)
        return Recording, (*parts, self.first_line, self.dt, self.clock)

    @property
    def N(self) -> int:
        """Number of rows."""
        return self.t.size

    @property
    def sampling_frequency(self) -> float:
        """Rows per second [Hz]."""
        return 1.0 / self.dt

    @property
    def duration(self) -> float:
        """Time that the rows cover [s]; the last input holds for one step `dt` too."""
        if self.clock is Clock.AS_RECORDED:
            return float(self.t[-1] - self.t[0]) + self.dt
        return self.N * self.dt

    @property
    def intervals(self) -> FloatArray:
        """Lengths of the intervals between rows [s], shape (N - 1,)."""
        if self.clock is Clock.AS_RECORDED:
            return np.diff(self.t)
        return np.full(self.N - 1, self.dt)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels, without ``t``."""
        return tuple(self.channels)

    def stack(self, names: Iterable[str]) -> FloatArray:
        """Return the named channels as columns, shape (N, n)."""
        return np.column_stack([self[name] for name in names])

    def with_channels(self, channels: Mapping[str, ArrayLike]) -> "Recording":
        """Return a copy with channels added or replaced."""
        return self._taken(slice(None), {**self.channels, **channels}, self.name)

    def without(self, names: Collection[str]) -> "Recording":
        """Return a copy without some channels; itself where there is none of them."""
        kept = {name: values for name, values in self.channels.items() if name not in names}
        return (
            self if len(kept) == len(self.channels) else self._taken(slice(None), kept, self.name)
        )

    def window(self, start: float, end: float) -> "Recording":
        """Return the rows with start ≤ t < end.

        Parameters
        ----------
        start, end : float
            Times on the clock of the recording [s]. Windows that share an end share no row.

        Raises
        ------
        CaseError
            If fewer than two rows fall into it, or an end is not a number.
        """
        first, last = (self._row(time) for time in (start, end))
        return self._rows(first, last, f"{self.name}[{start:g}:{end:g} s]")

    def split(
        self, parts: int | None = None, *, duration: float | None = None
    ) -> tuple["Recording", ...]:
        """Cut into consecutive pieces; every row belongs to exactly one.

        Parameters
        ----------
        parts : int, optional
            Number of pieces of equal length (to one row).
        duration : float, optional
            Length of a piece [s]; the last one may be shorter. One of the two must be given.

        Raises
        ------
        CaseError
            If a piece would have fewer than two rows.

        Examples
        --------
        >>> rec = Recording(range(5), {"x": range(5)}, "ramp", "memory", InputHold.ZERO)
        >>> [part["x"] for part in rec.split(2)]
        [array([0., 1.]), array([2., 3., 4.])]
        """
        edges = part_edges(self.name, self.N, self.dt, parts, duration)
        return tuple(
            self._rows(first, last, f"{self.name}[{part}]")
            for part, (first, last) in enumerate(pairwise(edges))
        )

    def split_at(self, rows: Sequence[slice]) -> tuple["Recording", ...]:
        """Return one recording for each slice of rows; itself where there is only one."""
        if len(rows) == 1:
            return (self,)
        return tuple(
            self._taken(part, self.channels, f"{self.name}[{number}]")
            for number, part in enumerate(rows)
            if part.stop - part.start > 1
        )

    def decimate(self, n: int, average: Iterable[str] = ()) -> "Recording":
        """Return every n-th row, unfiltered.

        Parameters
        ----------
        n : int
            Every n-th row is kept.
        average : iterable of str, optional
            Channels (inputs held at zero order) to replace by their mean over the n rows from
            the one kept on, so that the longer hold carries the same integral.

        Raises
        ------
        CaseError
            If `n` is not a whole number of rows that leaves two.
        """
        if n not in range(1, self.N):
            raise CaseError(
                f"{self.name}: cannot keep every {n}-th of {self.N} rows; give a whole number from "
                f"1 to {self.N - 1}"
            )
        n = int(n)
        channels = dict(self.channels)
        starts = np.arange(0, self.N, n)
        for name in average:
            mean = np.add.reduceat(self[name], starts) / np.diff(np.append(starts, self.N))
            channels[name] = np.repeat(mean, n)[: self.N]
        return self._taken(slice(None, None, n), channels, f"{self.name} (1:{n})")

    def shifted(self, channel: str, samples: int) -> "Recording":
        """Return the recording with one channel shifted to `samples` rows earlier.

        See `aligned`, of which this is the case of one channel.
        """
        return self.aligned({channel: samples})

    def aligned(self, late: Mapping[str, int]) -> "Recording":
        """Undo delays between channels, keeping the rows that all of them share.

        Parameters
        ----------
        late : mapping of str to int
            Delay of a channel in rows: y[k] of the file belongs to t[k − late].
            Negative for a channel that is early.

        Returns
        -------
        Recording
            Shorter by the spread of the delays. Where the clock is taken as recorded and has gaps,
            every stretch between them is: no row takes values from beyond a gap.

        Raises
        ------
        CaseError
            If there is no such channel, a delay is no whole number, or less than two rows are left.

        Examples
        --------
        >>> rec = Recording([0.0, 1.0, 2.0, 3.0], {"u": [0, 1, 2, 3], "y": [9, 0, 1, 2]}, "a",
        ...                 "memory", InputHold.ZERO).shifted("y", 1)
        >>> rec["u"], rec["y"]
        (array([0., 1., 2.]), array([0., 1., 2.]))
        """
        for channel, shift in late.items():
            _ = self[channel]
            if not isinstance(shift, int | np.integer):
                raise CaseError(f"{self.name}: `{channel}` by {shift} rows; shift by whole rows")
        recorded = self.clock is Clock.AS_RECORDED
        stretches = split_rows(self.t) if recorded else [slice(0, self.N)]
        rows = rows_with_all(late, stretches)
        if len(rows) < 2:
            raise CaseError(f"{self.name}: {self.N} rows are too few for shifts of {dict(late)}")
        channels = {
            name: np.roll(values, -late.get(name, 0)) for name, values in self.channels.items()
        }
        whole = len(stretches) == 1
        return self._taken(slice(rows[0], rows[-1] + 1) if whole else rows, channels, self.name)

    def _row(self, time: float) -> int:
        if np.isnan(time):
            raise CaseError(f"{self.name}: a window at {time} s; give times on its clock")
        # Times fall on rows only up to rounding: a millionth of a step early still counts.
        if self.clock is Clock.AS_RECORDED:
            return int(np.searchsorted(self.t, time - 1e-6 * self.dt))
        row = np.ceil((time - self.t[0]) / self.dt - 1e-6)
        return int(min(max(row, 0), self.N))

    def _rows(self, first: int, last: int, name: str) -> "Recording":
        if last - first < 2:
            raise CaseError(
                f"{name}: {max(last - first, 0)} rows; the record covers {self.t[0]:g} s to "
                f"{self.t[-1]:g} s in steps of {self.dt:g} s"
            )
        return self._taken(slice(first, last), self.channels, name)

    def _taken(
        self, rows: slice | list[int], channels: Mapping[str, Any], name: str
    ) -> "Recording":
        step, line = 1, 0  # rows left out in between have no line that counts on from the first
        if isinstance(rows, slice):
            step = rows.step or 1
            line = self.first_line + (rows.start or 0) if self.first_line and step == 1 else 0
        return Recording(
            self.t[rows],
            {key: np.asarray(values)[rows] for key, values in channels.items()},
            name,
            self.source,
            self.hold,
            line,
            self.dt * step,
            self.clock,
        )
