"""Quantities computed from parameters: written once, differentiated by CasADi."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """A scalar function of all parameters of an axis.

    Parameters
    ----------
    name, unit : str
        Symbol and SI unit.
    function : casadi.Function
        ``θ (n,) -> (value, gradient (1, n))``.
    """

    name: str
    unit: str
    function: ca.Function

    def __call__(self, theta: FloatArray) -> float:
        """Return the value at parameters of shape (n,)."""
        return float(self.function(theta)[0])

    def gradient(self, theta: FloatArray) -> FloatArray:
        """Return the derivatives to all parameters, shape (n,)."""
        return np.asarray(self.function(theta)[1].full(), dtype=float).ravel()


def find_quantity(axis: Axis, name: str) -> Quantity:
    """Return a parameter or derived quantity of an axis by its name.

    Raises
    ------
    ModelError
        If the axis has neither.
    """
    if name in axis.parameters:
        theta = ca.SX.sym("theta", len(axis.parameters))
        item = axis.parameters[name]
        return _quantity(name, item.unit, theta[axis.parameters.index(name)], theta)
    derived = derived_quantities(axis)
    if name not in derived:
        raise ModelError(
            f"no parameter and no derived quantity {name!r}; derived are {', '.join(derived)}"
        )
    return derived[name]


def derived_quantities(axis: Axis) -> dict[str, Quantity]:
    """Return all derived quantities of an axis.

    Of each chamber k = X_s3/X_s2, V(0) = X_s1 k r T, the area S = X_s3 r T, the dead length
    l_D = V_D/S = X_s1/X_s2 - l/2 and the dead volume V_D = S l_D (eq. 3, 10 and 11; chamber P
    named), and of the friction its mean F_c and its offset. k and l_D need nothing but the fit
    and the stroke l; areas and volumes need the temperature of the bench and share its error.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> axis = axis.with_parameters({"F_c_plus": 12.0, "F_c_minus": 17.0})
    >>> {name: item(axis.parameters.values) for name, item in derived_quantities(axis).items()}
    {'F_c': 14.5, 'F_offset': -2.5}
    """
    theta = ca.SX.sym("theta", len(axis.parameters))
    at = {name: theta[i] for i, name in enumerate(axis.parameters.names)}
    written = []
    if axis.kind.gas_chambers:
        constants = axis.constants
        rT, middle = constants["r"] * constants["T"], constants["stroke"] / 2
        for chamber, first in (("P", 1), ("N", 4)):
            a, b, c = (at[f"X_s{first + i}"] for i in range(3))
            S, l_D = rT * c, a / b - middle
            written += [
                (f"k_{chamber}", "1", c / b),
                (f"V_{chamber}(0)", "m3", S * a / b),
                (f"S_{chamber}", "m2", S),
                (f"V_D{chamber}", "m3", S * l_D),
                (f"l_D{chamber}", "m", l_D),
            ]
    plus, minus = at["F_c_plus"], at["F_c_minus"]
    written += [("F_c", "N", (plus + minus) / 2), ("F_offset", "N", (plus - minus) / 2)]
    return {name: _quantity(name, unit, value, theta) for name, unit, value in written}


def _quantity(name: str, unit: str, value: ca.SX, theta: ca.SX) -> Quantity:
    gradient = ca.densify(ca.jacobian(value, theta))
    return Quantity(name, unit, ca.Function("quantity", [theta], [value, gradient]))
