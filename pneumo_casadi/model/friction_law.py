"""The nominal law of friction, eq. 4, which the balances and effects of other masses share."""

from collections.abc import Mapping

import casadi as ca

from pneumo_casadi.model.junctions import Expression


def friction_force(
    v: Expression, direction: Expression, theta: Mapping[str, Expression]
) -> Expression:
    """Return the friction force, positive against motion in +x [N].

    Eq. 4: F_f = f_v ẋ + F_c⁺ for ẋ > 0 and f_v ẋ - F_c⁻ for ẋ < 0, with `direction` in place of
    the sign of ẋ.
    """
    return (
        theta["f_v"] * v
        + theta["F_c_plus"] * (1 + direction) / 2
        - theta["F_c_minus"] * (1 - direction) / 2
    )


def smoothed_sign(v: Expression, v_s: Expression) -> Expression:
    """Return tanh(ẋ/v_s), between -1 and 1.

    A derivative is needed at ẋ = 0. Fits lower v_s in stages; WLS sets it almost to zero.
    """
    return ca.tanh(v / v_s)
