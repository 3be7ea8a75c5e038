"""Weighted residuals of some records, with the columns that terms have in them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array, diags_array, hstack, vstack

from pneumo_casadi.diagnosis.discover.linear.sensor_errors import SENSORS, sensor_operator
from pneumo_casadi.diagnosis.discover.linear.signals import Signals
from pneumo_casadi.diagnosis.discover.linear.sites import LEAST_VARIATION, Site
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.parameters import FloatArray

#: ``basis(d) -> (N, k)``: columns of a term over its driver, an array or a sparse one.
Basis = Callable[[FloatArray], Any]


@dataclass(frozen=True, eq=False)
class Rows:
    """Weighted residuals and derivatives of some records, rows that count only.

    Parameters
    ----------
    motions : tuple of SmoothedMotion
        The records.
    signals : tuple of Signals
        Drivers and factors along them.
    used : tuple of (ne, m) array of bool
        Rows that count.
    e : (r,) array
        Residuals over `sigma`.
    A : (r, n) array
        Derivatives to the scaled free parameters.
    sigma : (ne,) array
        Standard deviation of the residuals of each balance.
    equations : tuple of str
        Names of the balances.
    """

    motions: tuple[SmoothedMotion, ...]
    signals: tuple[Signals, ...]
    used: tuple[NDArray[np.bool_], ...]
    e: FloatArray
    A: FloatArray
    sigma: FloatArray
    equations: tuple[str, ...]

    def of(self, i: int) -> "Rows":
        """Return the rows of one record."""
        counts = [int(used.sum()) for used in self.used]
        part = slice(sum(counts[:i]), sum(counts[: i + 1]))
        return replace(
            self,
            motions=(self.motions[i],),
            signals=(self.signals[i],),
            used=(self.used[i],),
            e=self.e[part],
            A=self.A[part],
        )

    @cached_property
    def rms(self) -> FloatArray:
        """Root mean square residual of each balance in these records, (ne,)."""
        return self.rms_of(self.e)

    def rms_of(self, e: FloatArray) -> FloatArray:
        """Return the root mean square of weighted rows (r,) as residuals of each balance, (ne,)."""
        squares = np.hstack(self.unweighted(e)) ** 2
        rows = np.hstack(self.used).sum(axis=1)
        return np.asarray(np.sqrt(squares.sum(axis=1) / np.maximum(rows, 1)))

    def driver(self, site: Site) -> FloatArray | None:
        """Return the driver of a site over its balances and all records, (N,).

        None where the axis has no such signal, or where it does not vary; time does, whatever the
        hour at which its clock begins.
        """
        if site not in self._drivers:
            parts = [self._driver_in(site.driver, balance) for balance in site.balances]
            known = [part for part in parts if part is not None]
            d = np.concatenate(known) if len(known) == len(parts) else None
            varies = d is not None and (
                site.driver == "t" or np.ptp(d) > LEAST_VARIATION * np.abs(d).max()
            )
            self._drivers[site] = d if varies else None
        return self._drivers[site]

    def _driver_in(self, name: str, balance: str) -> FloatArray | None:
        parts = [signals.driver(name, balance) for signals in self.signals]
        known = [part for part in parts if part is not None]
        return np.concatenate(known) if len(known) == len(parts) else None

    @cached_property
    def _drivers(self) -> dict[Site, FloatArray | None]:
        return {}

    def columns(self, site: Site, basis: Basis) -> FloatArray:
        """Return the weighted columns of a term, (r, k)."""
        d = self.driver(site)
        assert d is not None  # sites without a driver are left out before
        columns = self._windows(site.balances, site.factor) @ basis(d)
        return np.asarray(columns.toarray() if hasattr(columns, "toarray") else columns)

    def _windows(self, balances: tuple[str, ...], factor: str) -> Any:
        """Return what averages a function of all samples to weighted rows, (r, N)."""
        key = (balances, factor)
        if key not in self._kept:
            records = range(len(self.motions))
            self._kept[key] = csr_array(
                hstack(
                    [
                        block_diag([self._record_windows(i, balance, factor) for i in records])
                        for balance in balances
                    ]
                )
            )
        return self._kept[key]

    def _record_windows(self, i: int, balance: str, factor: str) -> Any:
        motion, signals, used = self.motions[i], self.signals[i], self.used[i]
        parts = []
        for equation, sigma, rows in zip(self.equations, self.sigma, used, strict=True):
            if balance in SENSORS:
                scaled = motion.weak @ sensor_operator(signals, balance, equation) / sigma
            elif equation == balance:
                scaled = motion.weak @ diags_array(signals.factor(equation, factor) / sigma)
            else:
                scaled = csr_array((motion.m, motion.N))
            parts.append(csr_array(scaled)[rows])
        return vstack(parts)

    @cached_property
    def _kept(self) -> dict[Any, Any]:
        return {}

    def scores(self, J: FloatArray, e: FloatArray) -> list[FloatArray]:
        """Return row times residual, summed over the balances, by record and instant, (m, k)."""
        parts, at = [], 0
        for used in self.used:
            n = int(used.sum())
            score = np.zeros((*used.shape, J.shape[1]))
            score[used] = J[at : at + n] * e[at : at + n, None]
            parts.append(score.sum(axis=0))
            at += n
        return parts

    def unweighted(self, e: FloatArray) -> tuple[FloatArray, ...]:
        """Return weighted rows as residuals by record, (ne, m); zero where a row does not count."""
        parts, at = [], 0
        for used in self.used:
            r = np.zeros(used.shape)
            n = int(used.sum())
            r[used] = e[at : at + n]
            parts.append(r * self.sigma[:, None])
            at += n
        return tuple(parts)
