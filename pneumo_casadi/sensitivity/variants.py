"""One variant of an identification: what was varied, and what came of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from pneumo_casadi.sensitivity.metering import MeteringErrors


class Treatment(Enum):
    """What the output-error fit makes of the flow map."""

    ANCHORED = "anchored"
    """Coefficients free, held by the residuals of all metered points."""
    FIXED = "fixed"
    """Coefficients as fitted to the map alone."""
    LEFT_OUT = "left out"
    """Coefficients free and no metered point used: trajectories alone shape the flow."""


@dataclass(frozen=True, slots=True)
class Variant:
    """What distinguishes one identification from the others.

    Parameters
    ----------
    form : str
        Name of the form of the flow map.
    metering : Metering
        Errors put on the map.
    treatment : Treatment
        Of the map in output error; weighted least squares always takes it as fitted.
    """

    form: str
    metering: MeteringErrors
    treatment: Treatment


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate with the standard deviation that allows for correlated residuals, both SI.

    Parameters
    ----------
    value, std : float
        Estimate and standard deviation, in the parameter's SI unit.
    """

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one variant.

    Parameters
    ----------
    variant : Variant
        What was varied.
    status : str
        ``"converged"``, or why there is no output-error estimate.
    wls, output_error : dict of str to Estimate
        X_s, M, friction, k_P and k_N; empty where that estimator failed.
    map_error, map_error_used : float or None
        Root mean square of the residuals that the form leaves of its own map, over all metered
        points and over those whose command and pressure the records visit, as a share of the
        largest flow [1]; None if the form could not be fitted, or no point is visited.
    rms : dict of str to float
        Output-error residuals of block means [Pa, Pa, m].
    held_out : dict of str to float
        Open-loop error on the held-out records, per cent of the signal's standard deviation.
    iterations : int
        Of the output-error fit.
    seconds : float
        Time of the output-error fit and its validation.
    """

    variant: Variant
    status: str
    wls: Mapping[str, Estimate]
    output_error: Mapping[str, Estimate]
    map_error: float | None = None
    map_error_used: float | None = None
    rms: Mapping[str, float] | None = None
    held_out: Mapping[str, float] | None = None
    iterations: int = 0
    seconds: float = 0.0

    @property
    def converged(self) -> bool:
        """Whether there is an output-error estimate."""
        return self.status == "converged"
