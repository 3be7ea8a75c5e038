"""Covariance and intervals of estimated parameters, and which of them the data inform."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from scipy import special

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.robust_covariance import batch_sandwich
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Brief
from pneumo_casadi.signals import white_noise_std

#: Smallest eigenvalue of the scaled information, relative to the largest, that counts.
RANK_TOLERANCE = 1e-13
#: Share of a parameter in the uninformed directions from which it is called unidentifiable.
LOADING = 1e-3


class EstimateStatus(StrEnum):
    """What an estimate is worth; only the first has an interval."""

    ESTIMATED = "estimated"
    HELD = "held"
    AT_BOUND = "at bound"
    UNINFORMED = "no information"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True, slots=True, repr=False)
class ParameterUncertainty(Brief):
    """Covariance of estimated parameters, infinite where the data hold no information.

    Parameters
    ----------
    names : tuple of str
        Parameters, in order.
    covariance : (n, n) array
        In SI units; infinite variance for parameters without information and for those at a
        bound, whose interval is one-sided and not given.
    at_bound : tuple of str
        Parameters held by a bound; their interval is one-sided and not given here.
    uninformed : tuple of str
        Parameters with a part in a direction without information.
    combinations : tuple of str
        Those directions, written out.
    covariance_robust : (n, n) array or None
        The same for residuals of any size and correlation, see `robust_covariance`. Output error
        adds the biases of the smoothed friction and of the form of the flow map; the bias of an
        incomplete model is not included.
    covariance_scatter : (n, n) array or None
        The part of `covariance_robust` that the residuals show, without a bias.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    at_bound: tuple[str, ...] = ()
    uninformed: tuple[str, ...] = ()
    combinations: tuple[str, ...] = ()
    covariance_robust: FloatArray | None = None
    covariance_scatter: FloatArray | None = None

    def status(self, names: Iterable[str]) -> EstimateStatus:
        """Return what is known of a quantity that these parameters determine: the worst of it."""
        of = set(names) & set(self.names)
        variances = dict(zip(self.names, np.diag(self.covariance), strict=True))
        if of & set(self.at_bound):
            return EstimateStatus.AT_BOUND
        if of & set(self.uninformed) or not all(np.isfinite(variances[name]) for name in of):
            return EstimateStatus.UNINFORMED
        return EstimateStatus.ESTIMATED if of else EstimateStatus.HELD

    @property
    def std_robust(self) -> FloatArray:
        """Standard deviations that allow for correlated residuals, shape (n,)."""
        if self.covariance_robust is None:
            return self.std
        std: FloatArray = np.sqrt(np.diag(self.covariance_robust))
        return std

    @property
    def std_scatter(self) -> FloatArray:
        """Standard deviations that the residuals show, without a bias, shape (n,)."""
        if self.covariance_scatter is None:
            return self.std_robust
        std: FloatArray = np.sqrt(np.diag(self.covariance_scatter))
        return std

    @property
    def std(self) -> FloatArray:
        """Standard deviations, shape (n,)."""
        std: FloatArray = np.sqrt(np.diag(self.covariance))
        return std

    @property
    def correlation(self) -> FloatArray:
        """Correlation matrix, shape (n, n); zero where a variance is zero or infinite."""
        std = self.std
        usable = np.isfinite(std) & (std > 0)
        correlation = np.eye(std.size)
        inside = np.ix_(usable, usable)
        correlation[inside] = self.covariance[inside] / np.outer(std[usable], std[usable])
        return correlation


def invert_information(
    information: FloatArray,
    scales: FloatArray,
    names: Sequence[str],
    at_bound: Sequence[str] = (),
    scores: Sequence[Sequence[FloatArray]] | None = None,
    prior: FloatArray | None = None,
    shifts: Sequence[FloatArray] = (),
) -> ParameterUncertainty:
    """Turn information on scaled parameters into a covariance in SI units.

    Parameters
    ----------
    information : (n, n) array
        JᵀJ in parameters divided by their scales.
    scales : (n,) array
        SI value of one scaled unit.
    names : sequence of str
        Parameters, in order.
    at_bound : sequence of str
        Parameters held by a bound; left out of the inversion.
    scores : sequence of sequences of (K, n) array, optional
        For the robust covariance: Jᵀr in the same scaling, for each kind of data (records, flow
        map) one array a record, in the order of time.
    prior : (n, n) array, optional
        Part of `information` that is prior knowledge. It has no residuals whose scatter could be
        seen, and its covariance is known.
    shifts : sequence of (n,) arrays, optional
        Biases of the scaled parameters whose size is known, but not their value: the robust
        covariance contains their squares.

    Returns
    -------
    ParameterUncertainty

    Examples
    --------
    >>> invert_information(np.diag([4.0, 0.0]), np.ones(2), ["M", "f_v"]).std
    array([0.5, inf])
    """
    n = len(names)
    inside = [i for i in range(n) if names[i] not in at_bound]
    H = information[np.ix_(inside, inside)]
    # Columns are equilibrated first, so that rank does not depend on units or scales.
    size = np.sqrt(np.maximum(np.diag(H), 0.0))
    known = size > 0
    size = np.where(known, size, 1.0)
    values, vectors = np.linalg.eigh(H / np.outer(size, size))
    weak = values <= RANK_TOLERANCE * max(float(values.max(initial=0.0)), 1e-300)
    inverse = (vectors[:, ~weak] / values[~weak]) @ vectors[:, ~weak].T
    unit = scales[inside] / size
    lost = (np.abs(vectors[:, weak]).max(axis=1, initial=0.0) > LOADING) | ~known

    def in_units(matrix: FloatArray) -> FloatArray:
        covariance = matrix * np.outer(unit, unit)
        covariance[lost, :] = covariance[:, lost] = 0.0
        covariance[lost, lost] = np.inf
        full = np.zeros((n, n))
        full[np.ix_(inside, inside)] = covariance
        held = [i for i in range(n) if names[i] in at_bound]
        full[held, held] = np.inf
        return full

    full = in_units(inverse)
    robust = scatter = None
    if scores is not None:
        equilibrated = [[part[:, inside] / size for part in source] for source in scores]
        sandwich = batch_sandwich(inverse, equilibrated)
        if prior is not None:
            sandwich += inverse @ (prior[np.ix_(inside, inside)] / np.outer(size, size)) @ inverse
        scatter = in_units(sandwich)
        scaled = [shift[inside] * size for shift in shifts]
        robust = in_units(sandwich + sum(np.outer(shift, shift) for shift in scaled))
    chosen = [names[i] for i in inside]
    return ParameterUncertainty(
        tuple(names),
        full,
        tuple(at_bound),
        tuple(name for name, gone in zip(chosen, lost, strict=True) if gone),
        tuple(_direction(vectors[:, j], unit, chosen) for j in np.flatnonzero(weak)),
        robust,
        scatter,
    )


def _direction(vector: FloatArray, unit: FloatArray, names: Sequence[str]) -> str:
    """Write a direction with its three largest parts, in SI units.

    Size is judged by influence on the data: in SI units 1 N would hide any X_s.
    """
    order = np.argsort(-np.abs(vector))
    sign = np.sign(vector[order[0]])
    large = [i for i in order if abs(vector[i]) > LOADING * abs(vector[order[0]])]
    parts = [f"{sign * vector[i] * unit[i]:+.3g} {names[i]}" for i in large[:3]]
    return " ".join(parts) + (" ..." if len(large) > 3 else "")


def interval_factor(level: float = 0.95, dof: float = np.inf) -> float:
    """Return the factor between a standard deviation and half an interval at `level`."""
    quantile = 0.5 + level / 2
    return float(special.ndtri(quantile) if np.isinf(dof) else special.stdtrit(dof, quantile))


def delta_std(gradient: FloatArray, covariance: FloatArray) -> float:
    """Return the standard deviation of a scalar with this gradient (delta method)."""
    used = gradient != 0
    if not np.isfinite(np.diag(covariance)[used]).all():
        return float("inf")
    part = covariance[np.ix_(used, used)]
    return float(np.sqrt(max(0.0, gradient[used] @ part @ gradient[used])))


def stated_or_estimated_noise(bench: Any, records: Sequence[Recording], channel: str) -> float:
    """Return the noise of a channel: as the bench states it, otherwise from the records.

    Parameters
    ----------
    bench : Bench or ForceBench
        Its ``noise`` may be None.
    records : sequence of Recording
        Their mean square over all samples counts, as that of residuals over all records does.
    channel : str
        ``"p_P"``, ``"x"`` or another output.

    Returns
    -------
    float
        Standard deviation of one sample; never zero, because a channel without any noise still
        has the rounding of its file.
    """
    stated = bench.noise.of(channel) if bench.noise is not None else None
    if stated:
        return float(stated)
    squares = [white_noise_std(record[channel]) ** 2 for record in records]
    estimated = float(np.sqrt(np.average(squares, weights=[record.N for record in records])))
    return estimated or 1e-6 * float(np.ptp(records[0][channel])) or 1e-12


def autocorrelation(residual: FloatArray, lags: int) -> FloatArray:
    """Return the autocorrelation at lags 0 ... `lags`, shape (lags + 1,), biased estimate."""
    e = residual - residual.mean()
    spectrum = np.fft.rfft(e, 2 * e.size)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[: lags + 1]
    correlation: FloatArray = covariance / covariance[0]
    return correlation
