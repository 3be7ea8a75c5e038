"""What a design returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pneumo_casadi.design.criterion import Criterion
from pneumo_casadi.design.experiment import SimulatedExperiment
from pneumo_casadi.design.options import DesignOptions
from pneumo_casadi.design.reference import Part, Reference
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Presentable


@dataclass(frozen=True, slots=True)
class Precision:
    """Predicted standard errors of the parameters of interest [SI].

    Parameters
    ----------
    names, units : tuple of str
        Parameters.
    values : (n,) array
        Where they were predicted.
    now, designed, together : (n,) array
        Standard errors of a fit to the recorded reference, to the designed one, and to both.
    criterion : Criterion
        What was made small.
    before, after, both : float
        Its value for each of the three: a relative standard deviation [1].
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    now: FloatArray
    designed: FloatArray
    together: FloatArray
    criterion: Criterion
    before: float
    after: float
    both: float

    def ratio(self, name: str) -> float:
        """Return the predicted standard error of a parameter over that of now."""
        at = self.names.index(name)
        return float(self.designed[at] / self.now[at])

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; None for an error that is infinite."""
        columns = {"std_now": self.now, "std_designed": self.designed, "std_both": self.together}
        return {
            "criterion": self.criterion.value,
            "now": _number(self.before),
            "designed": _number(self.after),
            "both": _number(self.both),
            "parameters": {
                name: {
                    "value": float(self.values[i]),
                    "unit": self.units[i],
                    **{key: _number(float(column[i])) for key, column in columns.items()},
                }
                for i, name in enumerate(self.names)
            },
        }


@dataclass(frozen=True, slots=True)
class Distance:
    """How far apart two effects are once the second has been fitted to the first.

    Parameters
    ----------
    truth, fitted : str
        The effect that is there, and the one that is fitted instead.
    before, after : float
        Refitted distance with the recorded reference and with the designed one, in standard
        deviations of one sample.
    samples : int
        Over so many samples of outputs: √samples is what noise alone leaves of the designed one.
    hidden : bool
        Whether the nominal parameters absorb the first effect, whatever the axis does: no
        experiment of these kinds can show it, and the search left the pair alone.
    """

    truth: str
    fitted: str
    before: float
    after: float
    samples: int
    hidden: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "truth": self.truth,
            "fitted": self.fitted,
            "before": _number(self.before),
            "after": _number(self.after),
            "samples": self.samples,
            "hidden": self.hidden,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Design(Presentable):
    """A designed experiment and what is predicted of it.

    Parameters
    ----------
    reference : Reference
        At the bench's sampling frequency.
    parts : tuple of Part
        What it is made of.
    options : DesignOptions
        What was chosen, limits included.
    runs : mapping of str to SimulatedExperiment
        What the model does under it; several where several effects are told apart.
    history : tuple of float
        Best value of the search after each evaluation: the logarithm of the criterion, or minus
        that of the smallest distance; infinite until limits were kept.
    precision : Precision or None
        Where it was designed for the parameters' covariance.
    distances : tuple of Distance
        Where it was designed to tell effects apart.
    seconds : float
        Time that it took.
    notes : tuple of str
        What its reader must know.
    """

    reference: Reference
    parts: tuple[Part, ...]
    options: DesignOptions
    runs: Mapping[str, SimulatedExperiment]
    history: tuple[float, ...]
    precision: Precision | None
    distances: tuple[Distance, ...]
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def headline(self) -> str:
        """Length of the reference and its predicted gain."""
        what = "standard errors" if self.precision is not None else "distance of the effects"
        return (
            f"Design of {self.reference.duration:g} s: {what} {self.gain:.3g} times better than "
            "with the recorded reference"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the prediction: standard errors [SI] by parameter, or distances by pair."""
        if self.precision is None:
            pairs = [item.as_dict() for item in self.distances]
            return pd.DataFrame(pairs).set_index(["truth", "fitted"])
        predicted = self.precision
        columns = {
            "value": predicted.values,
            "std_now": predicted.now,
            "std_designed": predicted.designed,
            "std_both": predicted.together,
            "unit": list(predicted.units),
        }
        return pd.DataFrame(columns, index=pd.Index(predicted.names, name="parameter"))

    @property
    def smallest(self) -> tuple[float, float]:
        """Smallest refitted distance before and after, of the pairs that can be told apart."""
        shown = [distance for distance in self.distances if not distance.hidden]
        return min(distance.before for distance in shown), min(distance.after for distance in shown)

    @property
    def gain(self) -> float:
        """How many times better than the recorded reference; below one it is worse."""
        if self.precision is not None:
            return self.precision.before / self.precision.after
        before, after = self.smallest
        return after / max(before, 1e-300)

    @property
    def extremes(self) -> dict[str, float]:
        """The extremes of all runs: largest position, speed, command, and pressures [SI]."""
        runs = [run.extremes for run in self.runs.values()]
        return {
            name: (min if name == "p_min" else max)(run[name] for run in runs) for name in runs[0]
        }

    def as_dict(self) -> dict[str, Any]:
        """Return plain data: no NaN, no infinity."""
        finite = [value for value in self.history if np.isfinite(value)]
        return {
            "duration_s": self.reference.duration,
            "sampling_period_s": self.reference.dt,
            "parts": [part.as_dict() for part in self.parts],
            "limits": self.options.limits.as_dict(),
            "extremes": self.extremes,
            "gain": _number(self.gain),
            "precision": None if self.precision is None else self.precision.as_dict(),
            "distances": [distance.as_dict() for distance in self.distances],
            "evaluations": len(self.history),
            "evaluations_within_limits_from": len(self.history) - len(finite) + 1,
            "seed": self.options.seed,
            "seconds": self.seconds,
            "notes": list(self.notes),
        }


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
