"""What an output-error fit returns."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.axis import Axis
from pneumo_casadi.output_error.segments import Segment
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.statistics import Estimate, delta_std, interval_factor


@dataclass(frozen=True, slots=True)
class Stage:
    """One solve on the way: every start's cost stays on record.

    Parameters
    ----------
    name : str
        What was solved.
    v_s : float
        Width of the smoothed sign of the velocity [m/s].
    cost : float
        ½ Σ (residual/σ)² where it ended, with the σ that the bench states or the records show:
        the same for all stages, so that their costs can be compared.
    iterations : int
        Of the nonlinear solver.
    status : str
        As the solver names it.
    seconds : float
        Time it took.
    """

    name: str
    v_s: float
    cost: float
    iterations: int
    status: str
    seconds: float


@dataclass(frozen=True, slots=True)
class Derived:
    """A quantity computed from parameters, with its standard deviations.

    Parameters
    ----------
    value, std : float
        In `unit`; `std` takes residuals for white noise.
    std_robust : float
        The same where residuals may be correlated, see `Estimate`.
    unit : str
        SI unit.
    """

    value: float
    std: float
    std_robust: float
    unit: str


@dataclass(frozen=True, slots=True)
class MapPull:
    """How far the trajectories have pulled the flow map from its measured points.

    Parameters
    ----------
    rms : float
        Residuals of the map over those of its own fit; 1 where the data leave it alone.
    scale : float
        Best common factor between the fitted and the measured map.
    """

    rms: float
    scale: float


@dataclass(frozen=True, eq=False)
class OutputErrorResult:
    """Parameters that minimise the output error, with their intervals.

    Parameters
    ----------
    axis : Axis
        The model with the estimated parameters.
    status : str
        ``"converged"``, or why not (only in the partial result of a `FitError`).
    cost : float
        ½ Σ (residual/σ)² with the final σ; near n/2 by itself where σ comes from the residuals.
    sigma : (ny,) array
        Standard deviation of one sample of each output, as estimated [Pa, Pa, m].
    rms : (ny,) array
        Root mean square of the residuals of block means [Pa, Pa, m].
    estimate : Estimate
        Covariance of the free parameters and what the data say nothing about.
    derived : dict of str to Derived
        k_P, k_N and, with the bench's geometry, V_P(0), V_N(0), areas and F_c.
    stages : tuple of Stage
        Every solve on the way.
    segments : tuple of Segment
        Data as used.
    fitted : tuple of (ny, K) arrays
        Mean outputs of the model, by segment.
    initial_states : tuple of (nx,) arrays
        By segment.
    map_pull : MapPull or None
        None without an anchor.
    """

    axis: Axis
    status: str
    cost: float
    sigma: FloatArray
    rms: FloatArray
    estimate: Estimate
    derived: Mapping[str, Derived]
    stages: tuple[Stage, ...]
    segments: tuple[Segment, ...]
    fitted: tuple[FloatArray, ...]
    initial_states: tuple[FloatArray, ...]
    map_pull: MapPull | None

    @property
    def parameters(self) -> Parameters:
        """All parameters with their estimated values."""
        return self.axis.parameters

    @property
    def iterations(self) -> int:
        """Iterations over all stages."""
        return sum(stage.iterations for stage in self.stages)

    def std(self, name: str, robust: bool = False) -> float:
        """Return a parameter's standard deviation; 0 if it was held, infinite if uninformed.

        With `robust`, correlated residuals count (see `Estimate`).
        """
        if name not in self.estimate.names:
            return 0.0
        std = self.estimate.std_robust if robust else self.estimate.std
        return float(std[self.estimate.names.index(name)])

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the interval of a parameter at `level`."""
        half = interval_factor(level) * self.std(name)
        value = self.parameters[name].value
        return value - half, value + half


def derived_quantities(axis: Axis, estimate: Estimate) -> dict[str, Derived]:
    """Return k, V(0) and areas of both chambers, or F_c and offset, with standard deviations.

    k_P = X_s3/X_s2 and k_N = X_s6/X_s5 need nothing but the fit; areas S = X_s3 r T and volumes
    V(0) = X_s1 k r T need the gas temperature of the bench and share its error.
    """
    values = axis.parameters.as_dict()
    found: dict[str, Derived] = {}

    def add(name: str, value: float, slopes: Mapping[str, float], unit: str) -> None:
        gradient = np.array([slopes.get(n, 0.0) for n in estimate.names])
        std = delta_std(gradient, estimate.covariance)
        robust = estimate.covariance_robust
        wider = std if robust is None else delta_std(gradient, robust)
        found[name] = Derived(value, std, wider, unit)

    if axis.flow is not None:
        constants = axis.constants
        rT = constants["r"] * constants["T"]
        for chamber, (first, second, third) in {
            "P": ("X_s1", "X_s2", "X_s3"),
            "N": ("X_s4", "X_s5", "X_s6"),
        }.items():
            a, b, c = values[first], values[second], values[third]
            add(f"k_{chamber}", c / b, {third: 1 / b, second: -c / b**2}, "1")
            volume = rT * a * c / b
            slopes = {first: volume / a, third: volume / c, second: -volume / b}
            add(f"V_{chamber}(0)", volume, slopes, "m3")
            add(f"S_{chamber}", rT * c, {third: rT}, "m2")
    plus, minus = values["F_c_plus"], values["F_c_minus"]
    add("F_c", (plus + minus) / 2, {"F_c_plus": 0.5, "F_c_minus": 0.5}, "N")
    add("F_offset", (plus - minus) / 2, {"F_c_plus": 0.5, "F_c_minus": -0.5}, "N")
    return found
