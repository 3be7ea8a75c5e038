"""Periods over a driver: a sine of any wavelength beside a refit of the parameters.

The periodogram of Lomb (1976, Astrophys. Space Sci. 39, 447-462) and Scargle (1982, ApJ 263,
835-853), with two additions: the windows that average the residuals weaken a short period more the
faster the axis moves, and what the parameters absorb is projected out: the mass takes up most of a
force that shakes the axis. The peaks are compared once more, exactly.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.discover.linear.linearised import ABSORBED, Linearised
from pneumo_casadi.diagnosis.discover.linear.rows import Rows
from pneumo_casadi.diagnosis.discover.linear.sensor_errors import SENSORS
from pneumo_casadi.diagnosis.discover.linear.sites import Site
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
#: Frequencies worked on together: enough to keep a processor busy, few enough for its cache.
TOGETHER = 8


def best_period(linear: Linearised, site: Site) -> float | None:
    """Return the period of the sine that removes most; None where none removes what matters."""
    return best_periods(linear, [site])[site]


def best_periods(linear: Linearised, sites: Sequence[Site]) -> dict[Site, float | None]:
    """Return the best period of every one of some sites; see `best_period`.

    All have the same driver, ``x`` or ``t``, which no balance has for itself.
    """
    d = linear.train.driver(sites[0]) if sites else None
    if d is None or not np.ptp(d) > 0:
        return dict.fromkeys(sites)
    length = float(np.ptp(d))
    highest = HIGHEST if sites[0].driver == "t" else 1 / (SHORTEST * length)
    cycles = np.arange(LEAST_CYCLES, max(highest * length, 2 * LEAST_CYCLES), 1 / OVERSAMPLING)
    grid = cycles / length
    differentiated = [site for site in sites if site.balances[0] in SENSORS]
    power = {site: sines_remove(linear, site, grid) for site in differentiated}
    others = [site for site in sites if site not in power]
    power |= dict(zip(others, periodograms(linear, others, grid), strict=True))
    return {site: _highest_peak(linear, site, grid, power[site]) for site in sites}


def _highest_peak(
    linear: Linearised, site: Site, grid: FloatArray, power: FloatArray
) -> float | None:
    """Return the period of the peak (grid,) that is highest where compared exactly."""
    if power.max() < LEAST_SHARE * float(np.sum(linear.projected**2)):
        return None
    step = grid[1] - grid[0]
    best, chosen = -np.inf, grid[0]
    for _ in range(PEAKS):
        at = int(np.argmax(power))
        fine = np.linspace(max(grid[at] - step, grid[0]), grid[at] + step, ABOUT)
        exact = sines_remove(linear, site, fine)
        if exact.max() > best:
            best, chosen = exact.max(), fine[int(np.argmax(exact))]
        power[max(at - 4, 0) : at + 5] = -np.inf
    return float(1 / chosen)


def periodograms(linear: Linearised, sites: Sequence[Site], grid: FloatArray) -> FloatArray:
    """Return the squares that a sine removes beside a refit, by site and even frequency.

    The sites have the same driver, as in `best_periods`; shape (sites, grid). The windows of the
    residuals are taken for short: see `sines_remove`.
    """
    power = np.empty((len(sites), grid.size))
    if not sites:
        return power
    e = linear.projected[: linear.train.e.size]
    factors = [_factor(linear.train, site) for site in sites]
    seen = [np.flatnonzero(factor) for factor in factors]
    absorbed = [linear.absorbed(factor != 0) for factor in factors]
    d, rate = _row_means(linear.train, sites[0].driver)
    for block, wave in _waves(d, grid):
        averaged = _attenuation(rate[:, None] * grid[block]) * wave
        for i, (factor, rows) in enumerate(zip(factors, seen, strict=True)):
            weighted = factor[rows, None] * averaged[rows]
            power[i, block] = _removed(weighted, e[rows], absorbed[i])
    return power


def sines_remove(linear: Linearised, site: Site, frequencies: FloatArray) -> FloatArray:
    """Return the squares that a sine removes at each even frequency beside a refit, (n,)."""
    d = linear.train.driver(site)
    assert d is not None  # sites without a driver are left out before
    blocks = [_wave_removes(linear, site, wave) for _, wave in _waves(d, frequencies)]
    return np.concatenate(blocks)


def _wave_removes(linear: Linearised, site: Site, wave: NDArray[np.complex128]) -> FloatArray:
    parts = np.hstack([wave.real, wave.imag])
    D = linear.train.columns(site, lambda _: parts)
    r, n = linear.train.e.size, wave.shape[1]
    return _removed(D[:, :n] + 1j * D[:, n:], linear.projected[:r], linear.reachable[:r])


def _waves(
    d: FloatArray, frequencies: FloatArray
) -> Iterator[tuple[slice, NDArray[np.complex128]]]:
    """Yield waves of even frequencies over a driver (r,), a block of them at a time, (r, n)."""
    first = np.exp(2j * np.pi * d[:, None] * frequencies[:TOGETHER])
    for start in range(0, frequencies.size, TOGETHER):
        block = slice(start, min(start + TOGETHER, frequencies.size))
        # From one block to the next all waves turn by the same angle in each row: a product, where
        # sine and cosine would be worked out anew.
        turn = np.exp(2j * np.pi * (frequencies[start] - frequencies[0]) * d)
        yield block, first[:, : block.stop - start] * turn[:, None]


def _removed(waves: NDArray[np.complex128], e: FloatArray, absorbed: FloatArray) -> FloatArray:
    """Return the squares of e that sine and cosine of each wave (r, n) remove together, (n,).

    Of both, what lies in the directions absorbed (r, k) is what a refit takes up.
    """
    s, c = (np.ascontiguousarray(part) for part in (waves.imag, waves.real))
    taken_s, taken_c = absorbed.T @ s, absorbed.T @ c
    ss_whole, cc_whole = _products(s, s), _products(c, c)
    ss, cc = ss_whole - _products(taken_s, taken_s), cc_whole - _products(taken_c, taken_c)
    sc = _products(s, c) - _products(taken_s, taken_c)
    es, ec = e @ s, e @ c
    least = (ABSORBED * (ss_whole + cc_whole)) ** 2
    determinant = np.maximum(np.maximum(ss * cc - sc**2, least), 1e-300)
    return np.asarray((cc * es**2 - 2 * sc * es * ec + ss * ec**2) / determinant)


def _products(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar product of every column of one with that of the other, (n,)."""
    return np.asarray(np.einsum("ij,ij->j", a, b))


#: Length of the Hann windows that average residuals, in rows; see `smooth_motion`.
_WINDOW_ROWS = 4


def _attenuation(cycles_per_row: FloatArray) -> FloatArray:
    """Return what a Hann window leaves of a sine, from its cycles between two rows."""
    turns = np.abs(cycles_per_row) * _WINDOW_ROWS
    near = np.abs(turns - 1) < 1e-3  # 0/0 there; the limit is a half
    turns = np.where(near, 0.5, turns)
    return np.where(near, 0.5, np.sinc(turns) / (1 - turns**2))


def _factor(rows: Rows, site: Site) -> FloatArray:
    """Return the factor of a site in all rows, (r,)."""
    return rows.columns(site, lambda d: np.ones((d.size, 1)))[:, 0]


def _row_means(rows: Rows, driver: str) -> tuple[FloatArray, FloatArray]:
    """Return a driver, and its change to the next row, in all rows, each (r,)."""
    parts: list[tuple[FloatArray, FloatArray]] = []
    for signals, motion, used in zip(rows.signals, rows.motions, rows.used, strict=True):
        for equation, mask in zip(rows.equations, used, strict=True):
            values = signals.driver(driver, equation)
            mean = np.zeros(motion.m) if values is None else motion.averaged(values)
            parts.append((mean[mask], np.gradient(mean)[mask]))
    return np.concatenate([mean for mean, _ in parts]), np.concatenate([rate for _, rate in parts])
