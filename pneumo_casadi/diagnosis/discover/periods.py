"""Periods over a driver: a sine of any wavelength beside a refit of the parameters.

The periodogram of Lomb (1976, Astrophys. Space Sci. 39, 447-462) and Scargle (1982, ApJ 263,
835-853), with two additions: the windows that average the residuals weaken a short period more the
faster the axis moves, and what the parameters absorb is projected out: the mass takes up most of a
force that shakes the axis. The peaks are compared once more, exactly.
"""

import numpy as np

from pneumo_casadi.diagnosis.discover.linearised import ABSORBED, Linearised, Rows
from pneumo_casadi.diagnosis.discover.sensor_errors import SENSORS
from pneumo_casadi.diagnosis.discover.sites import Site
from pneumo_casadi.parameters import FloatArray

#: Frequencies compared per cycle over the whole range of the driver; a peak is one cycle wide.
OVERSAMPLING = 4.0
#: Fewest periods over the range of the driver at which a sine is looked for; refined, it may have
#: somewhat fewer (`FEWEST_CYCLES`).
LEAST_CYCLES = 2.0
#: Highest frequency in time [Hz]: the windows that average residuals leave a tenth at 27 Hz.
HIGHEST = 25.0
#: Shortest period over another driver than time, as a share of its range.
SHORTEST = 1 / 200
#: Share of all squares that a sine must remove before it is compared exactly: one balance of three
#: has a third, and a sine over a driver that only follows the cause removes a tenth of that.
LEAST_SHARE = 0.03
#: Peaks of the periodogram that are compared exactly, and frequencies about each.
PEAKS, ABOUT = 3, 13


def best_period(linear: Linearised, site: Site) -> float | None:
    """Return the period of the sine that removes most; None where none removes what matters."""
    d = linear.train.driver(site)
    if d is None or not np.ptp(d) > 0:
        return None
    length = float(np.ptp(d))
    highest = HIGHEST if site.driver == "t" else 1 / (SHORTEST * length)
    cycles = np.arange(LEAST_CYCLES, max(highest * length, 2 * LEAST_CYCLES), 1 / OVERSAMPLING)
    grid = cycles / length
    power = (
        np.array([sine_removes(linear, site, frequency) for frequency in grid])
        if site.balances[0] in SENSORS  # which differentiate the sine
        else periodogram(linear, site, grid)
    )
    if power.max() < LEAST_SHARE * float(np.sum(linear.projected**2)):
        return None
    step = grid[1] - grid[0]
    best, chosen = -np.inf, grid[0]
    for _ in range(PEAKS):
        at = int(np.argmax(power))
        fine = np.linspace(max(grid[at] - step, grid[0]), grid[at] + step, ABOUT)
        exact = [sine_removes(linear, site, frequency) for frequency in fine]
        if max(exact) > best:
            best, chosen = max(exact), fine[int(np.argmax(exact))]
        power[max(at - 4, 0) : at + 5] = -np.inf
    return float(1 / chosen)


def periodogram(linear: Linearised, site: Site, grid: FloatArray) -> FloatArray:
    """Return the squares that a sine removes at each frequency beside a refit, (grid,).

    The windows of the residuals are taken for short: see `sine_removes`.
    """
    e = linear.projected[: linear.train.e.size]
    d, rate, factor = _row_means(linear.train, site)
    seen = factor != 0
    e, d, rate, factor = e[seen], d[seen], rate[seen], factor[seen]
    absorbed = linear.absorbed(seen)
    power = np.empty(grid.size)
    # From one frequency of the even grid to the next a sine turns by the same angle in each row:
    # a product, where sine and cosine would be worked out anew.
    wave = np.exp(2j * np.pi * grid[0] * d)
    turn = np.exp(2j * np.pi * (grid[1] - grid[0]) * d)
    for i, frequency in enumerate(grid):
        weighted = factor * _attenuation(frequency * rate) * wave
        both = np.stack([weighted.imag, weighted.real])
        taken = both @ absorbed
        whole, (es, ec) = both @ both.T, both @ e
        (ss, sc), (_, cc) = whole - taken @ taken.T
        determinant = max(ss * cc - sc**2, (ABSORBED * np.trace(whole)) ** 2, 1e-300)
        power[i] = (cc * es**2 - 2 * sc * es * ec + ss * ec**2) / determinant
        wave *= turn
    return power


#: Length of the Hann windows that average residuals, in rows; see `smooth_motion`.
_WINDOW_ROWS = 4


def _attenuation(cycles_per_row: FloatArray) -> FloatArray:
    """Return what a Hann window leaves of a sine, from its cycles between two rows."""
    turns = np.abs(cycles_per_row) * _WINDOW_ROWS
    near = np.abs(turns - 1) < 1e-3  # 0/0 there; the limit is a half
    turns = np.where(near, 0.5, turns)
    return np.where(near, 0.5, np.sinc(turns) / (1 - turns**2))


def _row_means(rows: Rows, site: Site) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return driver, change of the driver to the next row, and factor of the site, each (r,)."""
    parts: list[tuple[FloatArray, FloatArray]] = []
    for signals, motion, used in zip(rows.signals, rows.motions, rows.used, strict=True):
        for equation, mask in zip(rows.equations, used, strict=True):
            values = signals.driver(site.driver, equation)
            mean = np.zeros(motion.m) if values is None else motion.averaged(values)
            parts.append((mean[mask], np.gradient(mean)[mask]))
    factor = rows.columns(site, lambda d: np.ones((d.size, 1)))[:, 0]
    return (
        np.concatenate([mean for mean, _ in parts]),
        np.concatenate([change for _, change in parts]),
        factor,
    )


def sine_removes(linear: Linearised, site: Site, frequency: float) -> float:
    """Return the sum of squares that a sine removes beside a refit of the parameters."""
    angular = 2 * np.pi * frequency

    def basis(d: FloatArray) -> FloatArray:
        return np.column_stack([np.sin(angular * d), np.cos(angular * d)])

    return linear.removed_squares(linear.train.columns(site, basis))
