r"""Transport delay by Padé approximants, regular where it vanishes: of flows and of commands.

A delay T is `SECTIONS` delays of τ = T/`SECTIONS`, each

.. math:: G(s) = \frac{1 + (d_1 - τ) s + (d_2 - d_1 τ + τ^2/2) s^2}{1 + d_1 s + d_2 s^2},
          \qquad d_1 = \frac{ϑ}{2}, \quad d_2 = \frac{ϑ^2}{12}, \quad ϑ = τ + \frac{τ_0^2}{τ_0 + τ}

It agrees with e^{-sτ} to second order in s, is 1 at T = 0, where poles and zeros cancel, and nearly
its (2, 2) Padé approximant, ϑ = τ, where τ is far above τ_0. The states are w and its rate g.
"""

from collections.abc import Sequence

from pneumo_casadi.model.effect import Scope, State
from pneumo_casadi.model.junctions import Expression, Pair

#: Sections of a delay: two follow 10 ms up to 60 Hz and 25 ms up to 30 Hz within 10° of phase.
SECTIONS = 2
#: Time of the denominator of a section without delay [s].
TAU_REGULAR = 2e-3


def delay_states(unit: str, rate_unit: str, scale: float) -> tuple[State, ...]:
    """Return the states of a pair of delayed values, of their units and scale."""
    kinds = (("w", unit, scale), ("g", rate_unit, 100 * scale))
    return tuple(
        State(f"{name}_{k}_{c}", of, size)
        for c in "PN"
        for k in range(1, SECTIONS + 1)
        for name, of, size in kinds
    )


def delay_rest(values: Pair) -> dict[str, Expression]:
    """Return the states of values that have long been what they are."""
    rest: dict[str, Expression] = {}
    for c, value in zip("PN", values, strict=True):
        for k in range(1, SECTIONS + 1):
            rest |= {f"w_{k}_{c}": value, f"g_{k}_{c}": 0.0}
    return rest


def delay_rates(values: Pair, T: Sequence[Expression], at: Scope) -> dict[str, Expression]:
    """Return the rates of the states of values, each delayed by its T [s]."""
    rates: dict[str, Expression] = {}
    for c, value, delay in zip("PN", values, T, strict=True):
        for k in range(1, SECTIONS + 1):
            rates |= {f"w_{k}_{c}": at[f"g_{k}_{c}"], f"g_{k}_{c}": _change(value, delay, at, k, c)}
            value = _passed(value, delay, at, k, c)
    return rates


def delayed(values: Pair, T: Sequence[Expression], at: Scope) -> Pair:
    """Return values, each delayed by its T [s]."""
    late = []
    for c, value, delay in zip("PN", values, T, strict=True):
        for k in range(1, SECTIONS + 1):
            value = _passed(value, delay, at, k, c)
        late.append(value)
    return Pair(*late)


def _change(value: Expression, T: Expression, at: Scope, k: int, c: str) -> Expression:
    """Return the rate of g of a section."""
    d_1, d_2 = _denominator(T / SECTIONS)
    return (value - at[f"w_{k}_{c}"] - d_1 * at[f"g_{k}_{c}"]) / d_2


def _passed(value: Expression, T: Expression, at: Scope, k: int, c: str) -> Expression:
    """Return what leaves a section."""
    tau = T / SECTIONS
    d_1, d_2 = _denominator(tau)
    n_2 = d_2 - d_1 * tau + tau**2 / 2
    return at[f"w_{k}_{c}"] + (d_1 - tau) * at[f"g_{k}_{c}"] + n_2 * _change(value, T, at, k, c)


def _denominator(tau: Expression) -> tuple[Expression, Expression]:
    whole = tau + TAU_REGULAR**2 / (TAU_REGULAR + tau)
    return whole / 2, whole**2 / 12
