"""A fitted model linearised, so that a term is judged beside what a refit would absorb.

With the weighted residuals e and their derivatives A to all free parameters, a term with columns D
and coefficients c leaves ``min over δθ and c of |e + A δθ + D c|²``. Projection on the complement
of A gives c; δθ follows, and both, frozen, predict the residuals of held-out records.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array, diags_array, hstack, vstack

from pneumo_casadi.diagnosis.discover.sensor_errors import SENSORS, sensor_operator
from pneumo_casadi.diagnosis.discover.signals import Signals
from pneumo_casadi.diagnosis.discover.sites import LEAST_VARIATION, Site
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.problem import prior_rows
from pneumo_casadi.estimation.equation_error.residuals import linearise_residuals
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: Directions of the parameters weaker than this share of the strongest are held: the records fitted
#: say nothing of them, and the frozen change must not disturb held-out rows.
RANK_TOLERANCE = 1e-6

#: Share of its influence below which a column is absorbed by the parameters: the rest is rounding.
ABSORBED = 1e-6

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
    absorbed : (r, k) array
        Orthonormal directions that are removed from residuals and columns: parameters that may
        differ from record to record.
    """

    motions: tuple[SmoothedMotion, ...]
    signals: tuple[Signals, ...]
    used: tuple[NDArray[np.bool_], ...]
    e: FloatArray
    A: FloatArray
    sigma: FloatArray
    equations: tuple[str, ...]
    absorbed: FloatArray

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
        dense = np.asarray(columns.toarray() if hasattr(columns, "toarray") else columns)
        return without(dense, self.absorbed)

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


@dataclass(frozen=True, eq=False)
class Linearised:
    """A fit, linearised on the records fitted and on those held out.

    Parameters
    ----------
    names : tuple of str
        Free parameters.
    scales : (n,) array
        Theirs.
    train, held_out : Rows
        The records.
    e_map, A_map : (p,) and (p, n) array
        Residuals of the flow map and their derivatives, which hold the scale of the flows, and
        those of the priors of effects.
    """

    names: tuple[str, ...]
    scales: FloatArray
    train: Rows
    held_out: Rows
    e_map: FloatArray
    A_map: FloatArray

    @cached_property
    def in_longest_record(self) -> "Linearised":
        """The same with the longest of the records fitted alone; itself where there is one."""
        rows, i = self.train, longest(self.train.motions)
        if len(rows.used) == 1:
            return self
        counts = [int(used.sum()) for used in rows.used]
        part = slice(sum(counts[:i]), sum(counts[: i + 1]))
        alone = replace(
            rows,
            motions=(rows.motions[i],),
            signals=(rows.signals[i],),
            used=(rows.used[i],),
            e=rows.e[part],
            A=rows.A[part],
            absorbed=rows.absorbed[part],
        )
        return replace(self, train=alone)

    @cached_property
    def _svd(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        A = np.vstack([self.train.A, self.A_map])
        size = np.linalg.norm(A, axis=0)
        size = np.where(size > 0, size, 1.0)
        U, s, Vt = np.linalg.svd(A / size, full_matrices=False)
        strong = s > RANK_TOLERANCE * s[0]
        return U[:, strong], s[strong], Vt[strong], size

    @cached_property
    def e(self) -> FloatArray:
        """Residuals of the records fitted, those of the flow map last."""
        return np.concatenate([self.train.e, self.e_map])

    @cached_property
    def projected(self) -> FloatArray:
        """The residuals that no change of the parameters removes."""
        return self.project(self.e)

    @property
    def reachable(self) -> FloatArray:
        """Orthonormal directions of what a change of the parameters does, those of the map last."""
        return self._svd[0]

    def project(self, columns: FloatArray) -> FloatArray:
        """Return columns, (r, k) or (r,), without what a change of the parameters can do."""
        return without(columns, self.reachable)

    def absorbed(self, rows: NDArray[np.bool_]) -> FloatArray:
        """Return B, (n, k): of columns D in some rows (n,) a refit takes up the squares |Bᵀ D|²."""
        U, s, _ = np.linalg.svd(self.reachable[: rows.size][rows], full_matrices=False)
        strong = s > ABSORBED  # in a force, what flows have is lost
        return np.asarray(U[:, strong] * s[strong])

    def padded(self, D: FloatArray) -> FloatArray:
        """Return columns of the records fitted with zeros for the flow map."""
        return np.vstack([D, np.zeros((self.e_map.size, D.shape[1]))])

    def removed_squares(self, D: FloatArray) -> float:
        """Return the sum of squares that columns (r, k) remove beside a refit."""
        _, components = self._components(D)
        return float(np.sum(components**2))

    def coefficients(self, D: FloatArray) -> FloatArray:
        """Return the coefficients of columns (r, k) that remove most beside a refit."""
        directions, components = self._components(D)
        return np.asarray(-directions @ components)

    def _components(self, D: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coefficients, (k, n), of orthonormal combinations of columns and what they remove.

        The combinations are those of the columns projected, without what the parameters absorb;
        the second is the component of the residuals along each, (n,).
        """
        P = self.project(self.padded(D))
        size = np.sqrt(np.maximum(np.diag(D.T @ D), 1e-300))
        values, vectors = np.linalg.eigh(P.T @ P / np.outer(size, size))
        strong = values > ABSORBED
        directions = vectors[:, strong] / np.sqrt(values[strong]) / size[:, None]
        return directions, directions.T @ (P.T @ self.projected)

    def observable(self, D: FloatArray) -> FloatArray:
        """Return the share of each column's influence that no refit takes up, (k,)."""
        P = self.project(self.padded(D))
        whole = np.maximum(np.sum(D**2, axis=0), 1e-300)
        return np.asarray(np.sum(P**2, axis=0) / whole)

    def parameter_change(self, e: FloatArray) -> FloatArray:
        """Return the scaled change of the parameters that best removes residuals e."""
        U, s, Vt, size = self._svd
        return np.asarray(-(Vt.T @ ((U.T @ e) / s)) / size)

    def predicted(
        self, site: Site, basis: Basis, c: FloatArray, refitted: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """Return the residuals of both sets of records with a term.

        With `refitted`, the parameters are refitted to it on the records fitted.
        """
        train, held_out = (
            rows.e + rows.columns(site, basis) @ c for rows in (self.train, self.held_out)
        )
        if not refitted:
            return train, held_out
        step = self.parameter_change(np.concatenate([train, self.e_map]))
        return train + self.train.A @ step, held_out + self.held_out.A @ step


def longest(motions: Sequence[SmoothedMotion]) -> int:
    """Return the index of the longest motion."""
    return int(np.argmax([motion.t[-1] - motion.t[0] for motion in motions]))


def without(columns: FloatArray, U: FloatArray) -> FloatArray:
    """Return columns, (r, k) or (r,), without their components in an orthonormal basis (r, n)."""
    return np.asarray(columns - U @ (U.T @ columns))


def linearise(
    study: Study,
    fitted: FittedModel,
    effects: Sequence[Effect],
    per_record: Sequence[str] = (),
) -> Linearised:
    """Linearise a fit; rows are weighted by the root mean square residual of their balance.

    Parameters
    ----------
    study : Study
        The case.
    fitted : FittedModel
        The fit.
    effects : sequence of Effect
        Of its model.
    per_record : sequence of str, optional
        Parameters that are refitted to the records held out, because they differ from record to
        record as friction does with temperature.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    model = BalanceFunctions(axis)
    sigma = residual_rms(fitted, held_out=False)
    scales = axis.parameters.select(model.free).scales
    nominal = study.axis.with_parameters(
        {name: value for name, value in fitted.values.items() if "." not in name}
    )
    anchor = study.anchor_with(effects)
    e_map, A_map = np.zeros(0), np.zeros((0, len(model.free)))
    if anchor is not None:
        c = anchor.coefficients(axis.parameters, axis.parameters.values)
        e_map, A_map = anchor(c), anchor.rows(c, model.free) * scales
    prior = prior_rows(axis)  # what effects know of their parameters holds them like the map
    free = [axis.parameters.index(name) for name in model.free]
    e_map = np.concatenate([e_map, prior @ axis.parameters.values])
    A_map = np.vstack([A_map, prior[:, free] * scales])

    def rows(motions: Sequence[SmoothedMotion], refitted: Sequence[str] = ()) -> Rows:
        e, A, used = [], [], []
        for motion in motions:
            linear = linearise_residuals(model, motion, axis.parameters.values)
            mask = motion.used(axis)
            e.append((linear.r / sigma[:, None])[mask])
            A.append((linear.J * scales / sigma[:, None, None])[mask])
            used.append(mask)
        derivatives = np.concatenate(A)
        columns = derivatives[:, [model.free.index(name) for name in refitted]]
        absorbed = np.linalg.qr(columns)[0]
        return Rows(
            tuple(motions),
            tuple(Signals(nominal, motion) for motion in motions),
            tuple(used),
            without(np.concatenate(e), absorbed),
            without(derivatives, absorbed),
            sigma,
            tuple(axis.equations),
            absorbed,
        )

    train, held_out = study.smoothed
    return Linearised(model.free, scales, rows(train), rows(held_out, per_record), e_map, A_map)
