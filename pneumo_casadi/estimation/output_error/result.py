"""What an output-error fit returns."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.output_error.derived import derived_quantities
from pneumo_casadi.estimation.output_error.shooting.segments import Segment
from pneumo_casadi.estimation.statistics import (
    EstimateStatus,
    ParameterUncertainty,
    delta_std,
    interval_factor,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Presentable

#: Status of a fit that has reached its optimum.
CONVERGED = "converged"


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
class DerivedQuantity:
    """A quantity computed from parameters, with its standard deviations.

    Parameters
    ----------
    value, std : float
        In `unit`; `std` takes residuals for white noise.
    std_robust : float
        The same where residuals may be correlated, see `ParameterUncertainty`.
    unit : str
        SI unit.
    status : EstimateStatus
        The worst of the parameters that it is computed from.
    """

    value: float
    std: float
    std_robust: float
    unit: str
    status: EstimateStatus


@dataclass(frozen=True, slots=True)
class FlowMapDeviation:
    """Distance of the fitted flow map from its measured points.

    Parameters
    ----------
    rms : float
        Residuals of the map over those of its own fit, in both without the common factor that the
        stated accuracy of the meter leaves open; 1 where the trajectories do not change it.
    scale : float
        Best common factor between the fitted and the measured map.
    """

    rms: float
    scale: float


def flow_map_deviation(anchor: Anchor, axis: Axis) -> FlowMapDeviation | None:
    """Return the distance of an axis' flow coefficients from the measured points of its map.

    None where no map was measured.
    """
    if anchor.scatter is None:
        return None
    c = axis.parameters.select(anchor.names).values
    at_points, nothing = (
        np.asarray(anchor.scatter(each)[0], dtype=float).ravel() for each in (c, np.zeros_like(c))
    )
    measured = -nothing
    scale = float((at_points + measured) @ measured / (measured @ measured))
    residual, own = (anchor(each)[: anchor.n_points] for each in (c, anchor.fitted))
    return FlowMapDeviation(float(np.sqrt(np.sum(residual**2) / np.sum(own**2))), scale)


@dataclass(frozen=True, eq=False, repr=False)
class OutputErrorResult(Presentable):
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
    uncertainty : ParameterUncertainty
        Covariance of the free parameters and what the data say nothing about.
    derived : dict of str to DerivedQuantity
        k, V(0), areas, dead volumes and dead lengths of both chambers, F_c; see
        `derived_quantities`.
    stages : tuple of Stage
        Every solve on the way.
    segments : tuple of Segment
        Data as used.
    fitted : tuple of (ny, K) arrays
        Mean outputs of the model, by segment.
    initial_states : tuple of (nx,) arrays
        By segment.
    flow_map_deviation : FlowMapDeviation or None
        None without an anchor.
    chosen_window : float or None
        Length of the windows with own initial states over which long records are fitted where no
        length was asked for [s]; None where the data were fitted as asked for.
    """

    axis: Axis
    status: str
    cost: float
    sigma: FloatArray
    rms: FloatArray
    uncertainty: ParameterUncertainty
    derived: Mapping[str, DerivedQuantity]
    stages: tuple[Stage, ...]
    segments: tuple[Segment, ...]
    fitted: tuple[FloatArray, ...]
    initial_states: tuple[FloatArray, ...]
    flow_map_deviation: FlowMapDeviation | None
    chosen_window: float | None = None

    @property
    def parameters(self) -> Parameters:
        """All parameters with their estimated values."""
        return self.axis.parameters

    @property
    def iterations(self) -> int:
        """Iterations over all stages."""
        return sum(stage.iterations for stage in self.stages)

    @property
    def headline(self) -> str:
        """Status, iterations, cost and what is estimated."""
        return (
            f"Output error: {self.status} after {self.iterations} iterations, cost "
            f"{self.cost:.5g}, {len(self.uncertainty.names)} parameters fitted"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter or derived quantity: estimate and standard deviations [SI].

        The coefficients of the flow map come last. A parameter that was held has std 0; ``status``
        tells an estimate without an interval (`EstimateStatus`).
        """
        flow = set(self.axis.flow_parameters)
        own = [item for item in self.parameters if item.name not in flow]
        coefficients = [item for item in self.parameters if item.name in flow]
        rows = [
            (
                item.name,
                item.value,
                self.std(item.name),
                self.std(item.name, True),
                item.unit,
                self.status_of(item.name).value,
            )
            for item in (*own, *coefficients)
        ]
        rows[len(own) : len(own)] = [
            (name, item.value, item.std, item.std_robust, item.unit, self.status_of(name).value)
            for name, item in self.derived.items()
        ]
        columns = ["parameter", "estimate", "std", "std_robust", "unit", "status"]
        return pd.DataFrame(rows, columns=columns).set_index("parameter")

    def overview(self) -> pd.DataFrame:
        """Return the table without the coefficients of the flow map."""
        return self.to_frame().drop(index=list(self.axis.flow_parameters))

    def status_of(self, name: str) -> EstimateStatus:
        """Return what the estimate of a parameter or derived quantity is worth.

        An unknown name raises `ModelError`.
        """
        if name in self.derived:
            status = self.derived[name].status
        else:
            self.parameters[name]
            status = self.uncertainty.status([name])
        if status is EstimateStatus.ESTIMATED and self.status != CONVERGED:
            return EstimateStatus.NOT_CONVERGED
        return status

    def std(self, name: str, robust: bool = False) -> float:
        """Return a parameter's standard deviation; 0 if it was held, infinite if uninformed.

        With `robust`, correlated residuals count (see `ParameterUncertainty`). Derived quantities
        go by their names too; an unknown name raises `ModelError`.
        """
        if name in self.derived:
            return self.derived[name].std_robust if robust else self.derived[name].std
        if name not in self.uncertainty.names:
            self.parameters[name]  # an unknown name is an error, not a certainty
            return 0.0
        std = self.uncertainty.std_robust if robust else self.uncertainty.std
        return float(std[self.uncertainty.names.index(name)])

    def std_of_sum(self, slopes: Mapping[str, float]) -> float:
        """Return the wider standard deviation of a sum of parameters times slopes.

        What they share, as the factor of a flow meter, adds up or cancels. Parameters that were
        held are known; infinite where one of the others has no interval.
        """
        known = self.uncertainty
        at = [i for i, name in enumerate(known.names) if name in slopes]
        g = np.array([slopes[known.names[i]] for i in at])
        matrices = [known.covariance, known.covariance_robust]
        variances = [g @ C[np.ix_(at, at)] @ g for C in matrices if C is not None]
        largest = max(0.0, *map(float, variances))
        return float(largest**0.5) if np.isfinite(largest) else float("inf")

    def interval(self, name: str, level: float = 0.95, robust: bool = False) -> tuple[float, float]:
        """Return the interval of a parameter at `level`, on request the robust one."""
        half = interval_factor(level) * self.std(name, robust)
        value = self.parameters[name].value
        return value - half, value + half


def evaluate_derived_quantities(
    axis: Axis, estimate: ParameterUncertainty
) -> dict[str, DerivedQuantity]:
    """Return `derived_quantities` an axis with standard deviations by the delta method."""
    theta = axis.parameters.values
    columns = [axis.parameters.index(name) for name in estimate.names]
    derived = {}
    for name, item in derived_quantities(axis).items():
        gradient = item.gradient(theta)[columns]
        std = delta_std(gradient, estimate.covariance)
        robust = estimate.covariance_robust
        wider = std if robust is None else delta_std(gradient, robust)
        used = [n for n, slope in zip(estimate.names, gradient, strict=True) if slope != 0]
        derived[name] = DerivedQuantity(item(theta), std, wider, item.unit, estimate.status(used))
    return derived
