"""A fitted model linearised, so that a term is judged beside what a refit would absorb.

With the weighted residuals e and their derivatives A to all free parameters, a term with columns D
and coefficients c leaves ``min over δθ and c of |e + A δθ + D c|²``. Projection on the complement
of A gives c; δθ follows, and both, frozen, predict the residuals of held-out records.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.discover.linear.rows import Basis, Rows
from pneumo_casadi.diagnosis.discover.linear.signals import Signals
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.credible import least_mass, masses_of, moving_mass
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
    mass, least_mass : float
        What moves in the model [kg], and what must be left of it; see `least_mass`.
    mass_of : (n,) array
        Mass in each scaled parameter [kg]; zero for most.
    """

    names: tuple[str, ...]
    scales: FloatArray
    train: Rows
    held_out: Rows
    e_map: FloatArray
    A_map: FloatArray
    mass: float
    least_mass: float
    mass_of: FloatArray

    @cached_property
    def in_longest_record(self) -> "Linearised":
        """The same with the longest of the records fitted alone; itself where there is one."""
        motions = self.train.motions
        return self if len(motions) == 1 else replace(self, train=self.train.of(longest(motions)))

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
        """Residuals of the records fitted, those of the flow map and the priors last."""
        return np.concatenate([self.train.e, self.e_map])

    @cached_property
    def projected(self) -> FloatArray:
        """The residuals that no change of the parameters removes."""
        return self.project(self.e)

    @property
    def reachable(self) -> FloatArray:
        """Orthonormal directions of what a change of the parameters does, as rows of `e`."""
        return self._svd[0]

    def project(self, columns: FloatArray) -> FloatArray:
        """Return columns, (r, k) or (r,), without what a change of the parameters can do."""
        return np.asarray(columns - self.reachable @ (self.reachable.T @ columns))

    def absorbed(self, rows: NDArray[np.bool_]) -> FloatArray:
        """Return B, (n, k): of columns D in some rows (n,) a refit takes up the squares |Bᵀ D|²."""
        U, s, _ = np.linalg.svd(self.reachable[: rows.size][rows], full_matrices=False)
        strong = s > ABSORBED  # in a force, what flows have is lost
        return np.asarray(U[:, strong] * s[strong])

    def padded(self, D: FloatArray) -> FloatArray:
        """Return columns of the records fitted with zeros for the flow map and the priors."""
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

    def keeps_mass(self, site: Site, basis: Basis, c: FloatArray) -> bool:
        """Return whether the mass stays credible once the parameters are refitted to a term.

        A term in proportion to the force itself would else explain all.
        """
        e = self.e + np.append(self.train.columns(site, basis) @ c, np.zeros(self.e_map.size))
        return bool(self.mass + self.mass_of @ self.parameter_change(e) >= self.least_mass)

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


def linearise(study: Study, fitted: FittedModel, effects: Sequence[Effect]) -> Linearised:
    """Linearise a fit; rows are weighted by the root mean square residual of their balance.

    Parameters
    ----------
    study : Study
        The case.
    fitted : FittedModel
        The fit.
    effects : sequence of Effect
        Of its model.
    """
    axis = study.axis.with_effects(*effects).with_parameters(dict(fitted.values))
    model = BalanceFunctions(axis)
    sigma = residual_rms(fitted, held_out=False)
    scales = axis.parameters.select(model.free).scales
    nominal = study.axis.with_parameters(
        {name: value for name, value in fitted.values.items() if "." not in name}
    )
    e_map, A_map = _known_beforehand(study, model, effects)
    masses = ("M", *masses_of(effects))

    def rows(motions: Sequence[SmoothedMotion]) -> Rows:
        e, A, used = [], [], []
        for motion in motions:
            linear = linearise_residuals(model, motion, axis.parameters.values)
            mask = motion.used(axis)
            e.append((linear.r / sigma[:, None])[mask])
            A.append((linear.J * scales / sigma[:, None, None])[mask])
            used.append(mask)
        return Rows(
            tuple(motions),
            tuple(Signals(nominal, motion) for motion in motions),
            tuple(used),
            np.concatenate(e),
            np.concatenate(A),
            sigma,
            tuple(axis.equations),
        )

    train, held_out = study.smoothed
    return Linearised(
        model.free,
        scales,
        rows(train),
        rows(held_out),
        e_map,
        A_map * scales,
        moving_mass(effects, fitted.values),
        least_mass(study),
        scales * [name in masses for name in model.free],
    )


def _known_beforehand(
    study: Study, model: BalanceFunctions, effects: Sequence[Effect]
) -> tuple[FloatArray, FloatArray]:
    """Return residuals of the flow map and of the priors of effects, and their derivatives."""
    parameters, prior = model.axis.parameters, prior_rows(model.axis)
    free = [parameters.index(name) for name in model.free]
    e, A = prior @ parameters.values, prior[:, free]
    anchor = study.anchor_with(effects)
    if anchor is None:
        return e, A
    c = anchor.coefficients(parameters, parameters.values)
    return np.concatenate([anchor(c), e]), np.vstack([anchor.rows(c, model.free), A])
