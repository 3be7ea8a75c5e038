"""Signals of a record as measured and as simulated, with few enough points to draw and to store."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.json_input import read_json
from pneumo_casadi.runtime.presentation import Brief

#: Points of a stored curve: four for each pixel of a figure over half of a wide screen, and some
#: 150 kB of JSON for a record of three outputs.
POINTS = 2000
#: Significant digits of a stored value: a sensor of 20 bits resolves less.
DIGITS = 6
#: Decimals with which times are stored [s]: a clock may count from 1970.
TIME_DECIMALS = 9
#: The curve of the record itself; all others are simulations.
MEASURED = "measured"


@dataclass(frozen=True, eq=False, repr=False)
class Curves(Brief):
    """Outputs of one record over time: measured, and simulated in one or more ways.

    Parameters
    ----------
    record : str
        Name of the record.
    t : (K,) array
        Time [s].
    units : mapping of str to str
        SI unit by output.
    noise : mapping of str to float
        Standard deviation of one sensor sample by output [SI]; 0 where it is unknown.
    values : mapping of str to mapping of str to (K,) array
        By output, then by curve: ``measured`` first, then the simulations [SI].

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> x = {"measured": t, "open loop": t + 0.1 * (t > 0.75)}
    >>> curves = Curves("run", t, {"x": "m"}, {"x": 0.0}, {"x": x})
    >>> curves.simulations
    ('open loop',)
    >>> [float(round(edge, 2)) for edge in curves.largest_difference(0.2)]
    [0.8, 1.0]
    """

    record: str
    t: FloatArray
    units: Mapping[str, str]
    noise: Mapping[str, float]
    values: Mapping[str, Mapping[str, FloatArray]]

    @property
    def simulations(self) -> tuple[str, ...]:
        """Names of the simulations."""
        first = next(iter(self.values.values()))
        return tuple(name for name in first if name != MEASURED)

    def residual(self, output: str, simulation: str) -> FloatArray:
        """Return measured minus simulated [SI], shape (K,)."""
        return self.values[output][MEASURED] - self.values[output][simulation]

    def largest_difference(self, seconds: float) -> tuple[float, float]:
        """Return the interval of that length [s] in which the first simulation is farthest off.

        By the squared residuals of all outputs, each relative to the variance of its signal.
        """
        size = np.zeros(self.t.size)
        for output, curves in self.values.items():
            variance = float(np.var(curves[MEASURED])) or 1.0
            size += self.residual(output, self.simulations[0]) ** 2 / variance
        dt = float(np.median(np.diff(self.t)))
        n = min(max(round(seconds / dt), 1), self.t.size - 1)
        totals = np.cumsum(np.concatenate([[0.0], size]))
        sums = totals[n + 1 :] - totals[: -n - 1]
        first = int(np.argmax(sums))
        return float(self.t[first]), float(self.t[first + n])

    def thinned(self, points: int = POINTS) -> "Curves":
        """Return every n-th sample, so that no curve has more points than that."""
        step = max(1, int(np.ceil(self.t.size / points)))
        return replace(
            self,
            t=self.t[::step],
            values={
                output: {name: curve[::step] for name, curve in curves.items()}
                for output, curves in self.values.items()
            },
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, thinned and rounded."""
        few = self.thinned()
        return {
            "record": self.record,
            "t": [round(float(t), TIME_DECIMALS) for t in few.t],
            "units": dict(self.units),
            "noise": dict(self.noise),
            "values": {
                output: {name: rounded(curve) for name, curve in curves.items()}
                for output, curves in few.values.items()
            },
        }


def curves_of(plain: Mapping[str, Any]) -> Curves:
    """Return curves from the plain data of `Curves.as_dict`."""
    return Curves(
        plain["record"],
        np.asarray(plain["t"], dtype=float),
        dict(plain["units"]),
        dict(plain["noise"]),
        {
            output: {name: np.asarray(curve, dtype=float) for name, curve in curves.items()}
            for output, curves in plain["values"].items()
        },
    )


def read_curves(path: Path, remedy: str) -> tuple[Curves, ...]:
    """Return the curves of a file of records; none where there is no file.

    Raises
    ------
    CaseError
        If it holds something else; the message ends with the remedy.
    """
    if not path.exists():
        return ()
    try:
        return tuple(map(curves_of, read_json(path, remedy)["records"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CaseError(
            f"{path}: no curves of records ({type(error).__name__}: {error}); {remedy}"
        ) from None


def rounded(values: FloatArray) -> list[float]:
    """Return numbers as they are stored, to `DIGITS`."""
    return [float(f"{value:.{DIGITS}g}") for value in values]
