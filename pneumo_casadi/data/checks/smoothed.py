"""A record as the balances need it: means over blocks, low-passed, with their rates."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy  # its submodules are loaded at first use

from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.parameters import FloatArray

BLOCK = 0.005
"""Length of a block [s]: fast enough for the axis, slow enough for the noise."""
CUT_OFF = 20.0
"""Of the zero-phase low-pass [Hz]: above the bandwidth of a servo axis, a few Hz."""
FEWEST_BLOCKS = 100
"""Half a second: less shows no motion."""
ROWS_OF_FLOW = 5
"""Rows of a block in which the flow is evaluated: 1 kHz, as fast as any valve."""
Flow = Callable[[FloatArray, FloatArray], FloatArray]
"""Flow into a chamber q_m(u, p) [kg/s] of commands [V] and pressures [Pa]."""
EDGE_BLOCKS = 20
"""Blocks at each end that the transients of the filter reach: two periods of the cut-off."""


@dataclass(frozen=True, slots=True)
class BlockMeans:
    """Means over blocks of rows and a zero-phase low-pass of second order.

    Parameters
    ----------
    rows : int
        Rows of a block.
    blocks : int
        Number of blocks.
    dt : float
        Length of a block [s].
    """

    rows: int
    blocks: int
    dt: float

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the smoothed values, shape (blocks,)."""
        means = values[: self.rows * self.blocks].reshape(self.blocks, self.rows).mean(axis=1)
        # Continued at both ends by three times the filter's order and one, as SciPy does, or by
        # what a very short record has.
        padding = min(9, self.blocks - 1)
        return np.asarray(
            scipy.signal.sosfiltfilt(_low_pass(self.dt), means, padlen=padding), dtype=float
        )


@lru_cache(maxsize=8)
def _low_pass(dt: float) -> FloatArray:
    return np.asarray(
        scipy.signal.butter(2, min(CUT_OFF, 0.2 / dt), fs=1 / dt, output="sos"), dtype=float
    )


@dataclass(frozen=True, slots=True)
class SmoothedChamber:
    """Pressure of one chamber.

    Parameters
    ----------
    name : str
        ``"P"`` or ``"N"``.
    sign : int
        +1 where positive motion opens the chamber, −1 where it closes it.
    p, p_rate : (n,) array
        Pressure [Pa] and its rate [Pa/s].
    """

    name: str
    sign: int
    p: FloatArray
    p_rate: FloatArray


@dataclass(frozen=True, slots=True)
class SmoothedRecord:
    """Motion and pressures of a record, smoothed alike.

    Parameters
    ----------
    recording : Recording
        The record itself.
    smooth : BlockMeans
        What smooths any channel in the same way.
    x, v, a : (n,) array
        Position [m], velocity [m/s] and acceleration [m/s²].
    chambers : mapping of str to SmoothedChamber
        By name.
    """

    recording: Recording
    smooth: BlockMeans
    x: FloatArray
    v: FloatArray
    a: FloatArray
    chambers: Mapping[str, SmoothedChamber]

    def flow(self, flow: Flow, chamber: str, pressure_offset: float = 0.0) -> FloatArray:
        """Return a flow q_m(u, p) of one chamber [kg/s], smoothed as the channels are.

        It is evaluated in some rows of each block, symmetric about its middle.

        Parameters
        ----------
        flow : callable
            q_m(u, p) of arrays [V, Pa].
        chamber : str
            ``"P"`` or ``"N"``.
        pressure_offset : float, optional
            Added to the recorded pressure [Pa].
        """
        rows = self.smooth.rows
        chosen = np.unique(np.linspace(0, rows - 1, ROWS_OF_FLOW).round().astype(int))
        k = (rows * np.arange(self.smooth.blocks)[:, None] + chosen).ravel()
        u, p = (self.recording[f"{name}_{chamber}"][k] for name in "up")
        return replace(self.smooth, rows=chosen.size)(flow(u, p + pressure_offset))

    @property
    def inner(self) -> slice:
        """The blocks that the transients of the filter do not reach."""
        return slice(EDGE_BLOCKS, self.smooth.blocks - EDGE_BLOCKS)


def block_means(recording: Recording) -> BlockMeans:
    """Return what smooths the channels of a recording, blocks of about 5 ms."""
    rows = max(1, min(round(BLOCK / recording.dt), recording.N // 2))
    return BlockMeans(rows, recording.N // rows, rows * recording.dt)


def smoothed_record(recording: Recording) -> SmoothedRecord | None:
    """Return the smoothed record, or None where it is shorter than half a second."""
    smooth = block_means(recording)
    if smooth.blocks < FEWEST_BLOCKS:
        return None
    x = smooth(recording["x"])
    v = np.gradient(x, smooth.dt)
    chambers = {}
    for name, sign in (("P", 1), ("N", -1)):
        if f"p_{name}" not in recording:  # a single-acting cylinder
            continue
        p = smooth(recording[f"p_{name}"])
        chambers[name] = SmoothedChamber(name, sign, p, np.gradient(p, smooth.dt))
    return SmoothedRecord(recording, smooth, x, v, np.gradient(v, smooth.dt), chambers)


def least_squares(columns: list[FloatArray], y: FloatArray) -> tuple[FloatArray, float]:
    """Return the coefficients of columns, and the share of y's variance that they leave."""
    regressor = np.column_stack(columns)
    scale = np.maximum(np.abs(regressor).max(axis=0), 1e-300)
    coefficients = np.linalg.lstsq(regressor / scale, y, rcond=None)[0]
    variance = float(y.var())
    left = float((y - regressor / scale @ coefficients).var())
    return coefficients / scale, left / variance if variance > 0 else 1.0
