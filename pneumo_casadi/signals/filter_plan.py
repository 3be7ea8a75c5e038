"""The plan of both filters: cut-offs from the dynamics (eq. 14) and a bound on distortion."""

import warnings
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.signals.decimation import Decimation, passband_edge
from pneumo_casadi.signals.zero_phase import (
    Difference,
    Distortion,
    amplitude_distortion,
    central_difference,
    least_cutoff,
    noise_gains,
    settling_samples,
)

#: Eq. 14: sampling at least this many times faster than the dynamics.
SAMPLING_RATIO = 100.0
#: Parallel low-pass over dynamics: the useful band ends here at the latest, ...
PASSBAND_RATIO = 5.0
#: ... and here at the earliest (Gautier 1997: ω_Fp ≥ 2 ω_dyn).
LEAST_PASSBAND_RATIO = 2.0


#: Butterworth cut-off over the edge of the parallel low-pass, unless the bound asks for more.
#: x ṗ and sign(ẋ) of filtered signals are the filtered x ṗ and sign(ẋ) only where the filter is
#: transparent, and its transients at the end of a stick phase last about 1/f_H. Going from a
#: ratio of 1.8 to 5 lowers the error of f_v on a record with stick phases from 4 % to 1 %.
SEPARATION = 5.0


class SamplingWarning(UserWarning):
    """The record is sampled too slowly for its dynamics (eq. 14)."""


@dataclass(frozen=True, slots=True)
class FilterPlan:
    """Both filters of section 4.2 with all that is needed to repeat them.

    Parameters
    ----------
    sampling_frequency : float
        Of the record [Hz].
    cutoff : float
        Of the zero-phase Butterworth filter on the measurements, f_H [Hz].
    order : int
        Of one of its two passes.
    factor : int
        Of the parallel decimation of Y and W; 1 for none.
    decimation : Decimation
        Low-pass ahead of the resampling.
    f_dyn : float
        Bandwidth of the dynamics [Hz].
    f_bound : float
        Frequency at which the distortion is bounded [Hz]; by rule the edge of the parallel
        low-pass, above which nothing enters the estimate.
    drop : tuple of int, optional
        Samples dropped at the front and at the back of the record, where the edges disturb the
        Butterworth filter; by default its settling time.

    Raises
    ------
    ModelError
        If a frequency is not below half the sampling frequency, or a count is negative.

    Examples
    --------
    >>> plan = FilterPlan(sampling_frequency=1e3, cutoff=100.0, factor=10, f_dyn=20.0)
    >>> plan.passband, plan.drop
    (40.0, (33, 33))
    """

    sampling_frequency: float
    cutoff: float
    order: int = 4
    factor: int = 1
    decimation: Decimation = Decimation.CHEBYSHEV
    f_dyn: float = 0.0
    f_bound: float = 0.0
    drop: tuple[int, int] = (-1, -1)

    def __post_init__(self) -> None:
        if self.order < 1 or self.factor < 1:
            raise ModelError(f"order {self.order} and factor {self.factor} must be at least 1")
        settling = settling_samples(self.cutoff, self.sampling_frequency, self.order)
        front, back = self.drop
        drop = (settling if front < 0 else front, settling if back < 0 else back)
        object.__setattr__(self, "drop", drop)
        object.__setattr__(self, "f_bound", self.f_bound or min(self.passband, self.cutoff))

    @property
    def passband(self) -> float:
        """Edge of the parallel low-pass [Hz]; half the sampling frequency without decimation."""
        if self.factor == 1:
            return self.sampling_frequency / 2
        return passband_edge(self.factor, self.sampling_frequency)

    @property
    def sampling_ratio(self) -> float:
        """Sampling frequency over the bandwidth of the dynamics, to be at least 100 (eq. 14)."""
        return self.sampling_frequency / self.f_dyn if self.f_dyn > 0 else np.inf

    def distortion(self, frequency: float) -> Distortion:
        """Return how filter and differences distort a sine of that frequency [Hz]."""
        return amplitude_distortion(frequency, self.cutoff, self.sampling_frequency, self.order)

    def noise_gains(
        self, difference: Difference = central_difference
    ) -> tuple[float, float, float]:
        """Return noise of x, ẋ [1/s] and ẍ [1/s²] after filtering, per unit of measured noise."""
        return noise_gains(self.cutoff, self.sampling_frequency, self.order, difference)

    def describe(self) -> str:
        """Return the cut-offs with their effect, a few lines of text."""
        verdict = "holds" if self.sampling_ratio >= SAMPLING_RATIO else "violated"
        lines = [
            f"sampling            {self.sampling_frequency:g} Hz",
            f"dynamics            {self.f_dyn:.3g} Hz; f_s/f_dyn = {self.sampling_ratio:.0f}, "
            f"eq. 14 (at least {SAMPLING_RATIO:g}) {verdict}",
            f"measurements        Butterworth, order {self.order}, forward and backward, "
            f"cut-off {self.cutoff:.4g} Hz",
            f"Y and W             {self.decimation.value}; 1 row in {self.factor}, "
            f"up to {self.passband:.4g} Hz",
            f"dropped at the ends {self.drop[0]} and {self.drop[1]} samples",
            "amplitude distortion   position  velocity  acceleration",
        ]
        for name, frequency in (("f_dyn", self.f_dyn), ("f_bound", self.f_bound)):
            d = self.distortion(frequency)
            lines.append(
                f"  {name:<7} {frequency:8.3g} Hz {100 * d.position:9.3f} % "
                f"{100 * d.velocity:7.3f} % {100 * d.acceleration:9.3f} %"
            )
        x, v, a = self.noise_gains()
        lines.append(f"noise per unit         {x:.3g}, {v:.3g} 1/s, {a:.3g} 1/s²")
        return "\n".join(lines)


def plan_filters(
    sampling_frequency: float,
    f_dyn: float,
    *,
    bound: float = 0.01,
    order: int = 4,
    factor: int | None = None,
    decimation: Decimation = Decimation.CHEBYSHEV,
) -> FilterPlan:
    r"""Choose both cut-offs from the dynamics and a bound on the amplitude distortion.

    The parallel low-pass ends between 2 f_dyn (Gautier 1997) and 5 f_dyn: as high as two
    central differences use up no more than half of the bound. From
    :math:`1 - \mathrm{sinc}^2(2f/f_s) \approx (2\pi f/f_s)^2/3 \le` bound/2 that is

    .. math:: f = f_s \sqrt{1.5\,\mathrm{bound}}/(2\pi) \approx f_s/51 \text{ for 1 %},

    which is above 2 f_dyn when f_s ≥ 103 f_dyn: eq. 14 (with a bound of 1 %). The Butterworth
    cut-off is `SEPARATION` times the edge of the parallel low-pass, above which nothing enters
    the estimate, or the lowest that keeps the amplitude of an acceleration within the bound up
    to that edge, if this is higher.

    Parameters
    ----------
    sampling_frequency : float
        Of the record [Hz].
    f_dyn : float
        Bandwidth of the dynamics [Hz], see `power_bandwidth`.
    bound : float, optional
        Largest relative loss of an acceleration's amplitude in the useful band.
    order : int, optional
        Of one pass of the Butterworth filter.
    factor : int, optional
        Decimation, if you do not want the rule's.
    decimation : Decimation, optional
        Low-pass ahead of the resampling.

    Returns
    -------
    FilterPlan

    Warns
    -----
    SamplingWarning
        If eq. 14 is violated.

    Raises
    ------
    ModelError
        If no cut-off keeps the bound; the message says which bound can be kept.

    Examples
    --------
    >>> plan = plan_filters(5e3, f_dyn=2.5)
    >>> plan.factor, plan.passband, plan.cutoff
    (160, 12.5, 62.5)
    >>> abs(plan.distortion(12.5).acceleration) < 0.01
    True
    """
    if not 0 < f_dyn < sampling_frequency / 2:
        raise ModelError(
            f"f_dyn = {f_dyn:g} Hz must lie between 0 and half the sampling frequency of "
            f"{sampling_frequency:g} Hz"
        )
    if sampling_frequency < SAMPLING_RATIO * f_dyn:
        warnings.warn(
            f"sampled at {sampling_frequency:g} Hz, {sampling_frequency / f_dyn:.0f} times the "
            f"bandwidth of {f_dyn:g} Hz; eq. 14 asks for {SAMPLING_RATIO:g} times",
            SamplingWarning,
            stacklevel=2,
        )
    by_difference = sampling_frequency * np.sqrt(1.5 * bound) / (2 * np.pi)
    wanted = max(LEAST_PASSBAND_RATIO * f_dyn, min(PASSBAND_RATIO * f_dyn, by_difference))
    if factor is None:
        factor = max(1, round(0.8 * sampling_frequency / 2 / wanted))
    edge = passband_edge(factor, sampling_frequency) if factor > 1 else wanted
    cutoff = max(
        least_cutoff(edge, bound, sampling_frequency, order),
        min(SEPARATION * edge, 0.4 * sampling_frequency),
    )
    return FilterPlan(sampling_frequency, cutoff, order, factor, decimation, f_dyn, edge)
