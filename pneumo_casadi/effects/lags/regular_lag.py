"""Lags and swings that are regular where they vanish, for all effects that hold one."""

from pneumo_casadi.model.junctions import Expression

#: Time constant of the numerator [s]. It keeps the null value regular: at tau = 0 pole and
#: zero cancel, the axis is the nominal one, and the derivative to tau is that of a true lag.
TAU_REGULAR = 1e-3


def lagged(value: Expression, state: Expression, tau: Expression) -> Expression:
    """Return the output of (1 + τ₀ s) / (1 + (τ₀ + τ) s), a lag of τ below 1/τ₀.

    Parameters
    ----------
    value, state : Expression
        What goes in, and the state whose rate is `lag_rate`.
    tau : Expression
        Time constant τ [s].
    """
    return value - tau / (TAU_REGULAR + tau) * (value - state)


def lag_rate(value: Expression, state: Expression, tau: Expression) -> Expression:
    """Return the rate of the state of `lagged`: it follows with time constant τ₀ + τ."""
    return (value - state) / (TAU_REGULAR + tau)


def numerator(tau: Expression) -> Expression:
    """Return n = τ₀²/(τ₀ + τ), the time constant of a numerator that vanishes as τ grows.

    Beside a denominator of n and τ, poles and zeros cancel at τ = 0, and nothing but the
    denominator is left of a τ far above τ₀.
    """
    return TAU_REGULAR**2 / (TAU_REGULAR + tau)
