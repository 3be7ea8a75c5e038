r"""Second-order lag that is regular where it vanishes: valves' spools, sensors behind a tube.

.. math:: G(s) = \frac{(1 + n s)^2}{(1 + n s)^2 + τ s + (τ/2ζ)^2 s^2},
          \qquad n = \frac{τ_0^2}{τ_0 + τ}

At τ = 0 poles and zeros cancel, and the derivative to τ is that of a true lag. n vanishes as τ
grows, and what is left has the natural frequency ω_n = 2ζ/τ and the damping ζ. The states are w,
which follows the value, and its rate g.
"""

from pneumo_casadi.effects.lags.regular_lag import numerator
from pneumo_casadi.model.junctions import Expression


def second_order_lagged(
    value: Expression, w: Expression, g: Expression, tau: Expression, zeta: Expression
) -> Expression:
    """Return the output (1 + n s)² w of the lag.

    Parameters
    ----------
    value : Expression
        What goes in.
    w, g : Expression
        The states; ẇ = g, unless something limits it.
    tau : Expression
        Delay τ of a slow value [s].
    zeta : Expression
        Damping ζ.
    """
    n = numerator(tau)
    return w + 2 * n * g + n**2 * second_order_rate(value, w, g, tau, zeta)


def second_order_rate(
    value: Expression, w: Expression, g: Expression, tau: Expression, zeta: Expression
) -> Expression:
    """Return the rate of g."""
    n = numerator(tau)
    inertia = n**2 + (tau / (2 * zeta)) ** 2
    return (value - w - (2 * n + tau) * g) / inertia
