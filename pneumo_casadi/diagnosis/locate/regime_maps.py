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
#: Rows that a bin of the position holds at least: two windows that share no measurement.
FEWEST = 8


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
        Of the bins: of the position about as wide, of the others with as many rows.
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
            edges = _even_edges(values) if name == "x" else _quantiles(values)
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


def _quantiles(values: FloatArray) -> FloatArray:
    """Return edges of bins that hold as many rows."""
    return np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))


def _even_edges(values: FloatArray) -> FloatArray:
    """Return edges of even bins, joined where they hold too few rows.

    Where the axis turns there are few rows; bins of as many rows would be wide there and average
    what repeats every few millimetres.
    """
    even = np.unique(np.linspace(values.min(), values.max(), BINS_X + 1))
    if even.size < 3:
        return even
    kept, held = [even[0]], 0
    for count, edge in zip(np.histogram(values, even)[0], even[1:], strict=True):
        held += count
        if held >= FEWEST:
            kept.append(edge)
            held = 0
    kept[-1] = even[-1]  # what is left over belongs to the last bin
    return np.array(kept)


def _quantities(axis: Axis, balance: str) -> tuple[str, ...]:
    if balance == "force":
        return ("v", "x", *(f"p_{c}" for c in "PN" if f"p_{c}" in axis.outputs), "t")
    chamber = balance[-1]
    return (f"u_{chamber}", f"p_{chamber}", "v", "x", "t")
