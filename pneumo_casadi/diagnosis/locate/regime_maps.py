"""Residuals of the balances over command, velocity, position, pressures and time."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.locate.regime_conditions import balance_rows
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Bins of a quantity; more of the position, since what acts over it may repeat every few
#: millimetres.
BINS, BINS_X = 12, 60


@dataclass(frozen=True, eq=False)
class RegimeMap:
    """A balance's residual over one quantity.

    Parameters
    ----------
    name, unit : str
        Quantity: ``"u_P"``, ``"v"``, ``"x"``, ``"t"`` ... and its unit.
    balance : str
        Which.
    edges : (n + 1,) array
        Of the bins, each with as many rows.
    mean, band : (n,) array
        Mean residual, positive where the model has too much, and twice its standard deviation,
        windows' overlap counted.
    residual_unit : str
        Of both: ``"Pa/s"``, ``"N"``, and ``"m/s2"`` on the force-driven axis.
    """

    name: str
    unit: str
    balance: str
    edges: FloatArray
    mean: FloatArray
    band: FloatArray
    residual_unit: str = "N"


def map_regimes(study: Study, fit: FittedModel) -> tuple[RegimeMap, ...]:
    """Return every balance's residual over command, velocity, position, pressures and time."""
    units = {"u": "V", "v": "m/s", "x": "m", "p": "Pa", "t": "s", "F": "N"}
    units_of = {b.name: b.equation_error_unit for b in study.axis.kind.balances}
    maps = []
    for rows in balance_rows(study, fit):
        own = units_of[rows.balance]
        for name in _quantities(study.axis, rows.balance):
            values = rows.at[name]
            ends = np.linspace(0, 1, (BINS_X if name == "x" else BINS) + 1)
            edges = np.unique(np.quantile(values, ends))
            if edges.size < 3:
                continue
            bins = np.clip(np.searchsorted(edges, values, "right") - 1, 0, edges.size - 2)
            count = np.maximum(np.bincount(bins, minlength=edges.size - 1), 1)
            mean = np.bincount(bins, rows.r, edges.size - 1) / count
            square = np.bincount(bins, rows.r**2, edges.size - 1) / count
            # Windows are four rows long: that many rows share one measurement.
            band = 2 * np.sqrt(np.maximum(square - mean**2, 0.0) * 4 / count)
            maps.append(RegimeMap(name, units[name[0]], rows.balance, edges, mean, band, own))
    return tuple(maps)


def _quantities(axis: Axis, balance: str) -> tuple[str, ...]:
    if balance == "force":
        return ("v", "x", *(f"p_{c}" for c in "PN" if f"p_{c}" in axis.outputs), "t")
    chamber = balance[-1]
    return (f"u_{chamber}", f"p_{chamber}", "v", "x", "t")
