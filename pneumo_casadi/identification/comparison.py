"""Comparison of results: which parameters moved, and how well each simulates the others' records.

Two units of one type, one axis before and after a repair, or one record identified in two ways.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import pandas as pd

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.identification.compared_model import Estimate
from pneumo_casadi.runtime.presentation import Presentable
from pneumo_casadi.validation import Error

#: Standard deviations of a difference that count as moved: for a dozen parameters that did not
#: move, one exceeds it by chance in three comparisons of a hundred.
MOVED = 3.0


@dataclass(frozen=True, slots=True)
class Difference:
    """A parameter in the first result and in another.

    Parameters
    ----------
    name, other : str
        Parameter, and result that is compared with the first.
    change_percent : float
        From the first to the other, of the first; infinite where that is zero.
    sigmas : float or None
        Change over the root of the sum of both robust variances; None without an interval.
    """

    name: str
    other: str
    change_percent: float
    sigmas: float | None

    @property
    def moved(self) -> bool:
        """Whether the parameter moved by more than chance explains."""
        return self.sigmas is not None and abs(self.sigmas) > MOVED

    @property
    def change(self) -> str:
        """The change in words: per cent of the first value, or from where there are none."""
        return f"{self.change_percent:+.2g} %" if isfinite(self.change_percent) else "from 0"


@dataclass(frozen=True, slots=True)
class CrossSimulation:
    """Errors of one result's parameters on another's records.

    Parameters
    ----------
    parameters, records : str
        Results that supply each.
    errors : mapping of str to Error
        By output, over windows of 2 s or the shortest record.
    """

    parameters: str
    records: str
    errors: Mapping[str, Error]

    @property
    def largest(self) -> tuple[str, float]:
        """Output with the largest gap, and the gap [% of the signal]."""
        name = max(self.errors, key=lambda channel: self.errors[channel].gap_percent)
        return name, self.errors[name].gap_percent


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Presentable):
    """Results side by side.

    Parameters
    ----------
    names : tuple of str
        Of the results; the others are compared with the first.
    estimates : mapping of str to tuple of (Estimate or None)
        By parameter, one for each result; None where a model does not have it.
    differences : tuple of Difference
        Parameters that both the first and another result have.
    simulations : tuple of CrossSimulation
        Every result's parameters on every result's records.
    notes : tuple of str
        What limits the comparison.
    curves : tuple of Curves, optional
        Outputs of every record over time, measured and as each result simulates them.
    provenance : mapping, optional
        What is needed to repeat it: date, versions, records, hashes of the data of each result.

    Examples
    --------
    With ``comparison = pc.compare(result, result)``, an identification compared with itself:

    >>> print(comparison.headline)
    table1 (A) and table1 (B): no parameter differs by more than 3 σ; ...
    >>> bool(comparison.to_frame().loc["M", "sigmas table1 (B)"] == 0)
    True
    """

    names: tuple[str, ...]
    estimates: Mapping[str, tuple[Estimate | None, ...]]
    differences: tuple[Difference, ...]
    simulations: tuple[CrossSimulation, ...]
    notes: tuple[str, ...]
    curves: tuple[Curves, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def headline(self) -> str:
        """How many parameters moved, which most, and how well the first simulates the others."""
        moved = [item for item in self.differences if item.moved]
        text = f"no parameter differs by more than {MOVED:g} σ"
        if moved:
            most = max(moved, key=lambda item: abs(item.sigmas or 0.0))
            count = len({item.name for item in moved})
            verb = "parameter differs" if count == 1 else "parameters differ"
            where = f" of {most.other}" if len(self.names) > 2 else ""
            text = (
                f"{count} {verb} by more than {MOVED:g} σ, most {most.name}{where} "
                f"({most.change}, {abs(most.sigmas or 0.0):.1f} σ)"
            )
        crossed = [
            f"{item.parameters} simulates {item.records} to {item.largest[1]:.1f} % of the signal"
            for item in self.simulations
            if item.parameters != item.records and self.names[0] in (item.parameters, item.records)
        ]
        return f"{' and '.join(self.names)}: {'; '.join([text, *crossed])}"

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: estimates with robust std [SI], change [%] and its σ."""
        rows = {}
        for name, estimates in self.estimates.items():
            row: dict[str, Any] = {}
            for label, item in zip(self.names, estimates, strict=True):
                row[label] = None if item is None else item.value
                row[f"std {label}"] = None if item is None else item.std
            for difference in self.differences:
                if difference.name == name:
                    row[f"change % {difference.other}"] = difference.change_percent
                    row[f"sigmas {difference.other}"] = difference.sigmas
            row["unit"] = next(item.unit for item in estimates if item is not None)
            rows[name] = row
        frame = pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")
        return frame[[*(c for c in frame.columns if c != "unit"), "unit"]]

    def simulations_frame(self) -> pd.DataFrame:
        """Return one row for each parameters, records and output: rms, percent, noise, gap."""
        rows = [
            (s.parameters, s.records, n, e.rms, e.percent, e.noise_percent, e.gap_percent, e.unit)
            for s in self.simulations
            for n, e in s.errors.items()
        ]
        keys = ["parameters", "records", "output"]
        columns = [*keys, "rms", "percent", "noise_percent", "gap_percent", "unit"]
        return pd.DataFrame(rows, columns=columns).set_index(keys)

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain data; an interval that does not exist is None."""
        return {
            "results": list(self.names),
            "parameters": {
                name: {
                    label: None
                    if item is None
                    else {
                        "value": item.value,
                        "std": item.std if isfinite(item.std) else None,
                        "unit": item.unit,
                    }
                    for label, item in zip(self.names, estimates, strict=True)
                }
                for name, estimates in self.estimates.items()
            },
            "differences": [
                {
                    "name": item.name,
                    "other": item.other,
                    "change_percent": item.change_percent
                    if isfinite(item.change_percent)
                    else None,
                    "sigmas": item.sigmas,
                    "moved": item.moved,
                }
                for item in self.differences
            ],
            "simulations": [
                {
                    "parameters": item.parameters,
                    "records": item.records,
                    "errors": {
                        name: {
                            "rms": error.rms,
                            "percent": error.percent,
                            "noise_percent": error.noise_percent,
                            "gap_percent": error.gap_percent,
                            "unit": error.unit,
                        }
                        for name, error in item.errors.items()
                    },
                }
                for item in self.simulations
            ],
            "notes": list(self.notes),
            "provenance": dict(self.provenance),
        }
