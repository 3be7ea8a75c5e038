"""A term as an effect: a formula over one driver, in one balance or in both mass flows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from pneumo_casadi.effects.term.formula import FORMULAS, Formula
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect, Scope, State
from pneumo_casadi.model.junctions import Expression, Pair, Supply
from pneumo_casadi.parameters import Parameter

#: Drivers of a term and their units. ``u`` and ``p`` are command and pressure of the chamber of a
#: mass flow, ``p_other`` the pressure of the other chamber, ``p_mean`` is (p_P + p_N)/2 and
#: ``p_difference`` p_P − p_N; ``t_reversal`` and ``s_reversal`` are time and travel since the last
#: reversal.
DRIVERS: Mapping[str, str] = {
    "x": "m",
    "v": "m/s",
    "t": "s",
    "u": "V",
    "p": "Pa",
    "p_other": "Pa",
    "p_P": "Pa",
    "p_N": "Pa",
    "p_mean": "Pa",
    "p_difference": "Pa",
    "F": "N",
    "t_reversal": "s",
    "s_reversal": "m",
}
#: What multiplies the formula in a force and in a mass flow, and the unit of the term there.
FORCE_FACTORS: Mapping[str, str] = {"1": "N", "sign(v)": "N", "v": "N s/m"}
#: With ``dq_m/du`` the formula is a shift of the command [V]; with ``±dq_m/du`` it is added for
#: valve P and taken from valve N, as one spool moves that feeds both.
FLOW_FACTORS: Mapping[str, str] = {
    "1": "kg/s",
    "p": "kg/(s Pa)",
    "q_m": "1",
    "p_supply": "1",
    "dq_m/du": "V",
    "±dq_m/du": "V",
}
#: Balances of a term, and what the sensors show.
PLACES: tuple[tuple[str, ...], ...] = (
    ("force",),
    ("mass_flow_P",),
    ("mass_flow_N",),
    ("mass_flow_P", "mass_flow_N"),
    ("measurement_x",),
    ("measurement_P", "measurement_N"),
)
#: Speed below which an axis reverses rather than moves, as in `smoothed_motion` [m/s], and the
#: time in which the memory of a reversal is cleared there [s].
REVERSAL_SPEED, REVERSAL_TIME = 2e-3, 2e-3
#: A fit may make a period or a width so many times smaller: at zero the formula has no value.
SMALLEST = 100.0


@dataclass(frozen=True)
class Term:
    """A term that a diagnosis discovered, complete with its values.

    Parameters
    ----------
    name : str
        Name of the effect, an identifier.
    balances : tuple of str
        Of `PLACES`: ``("force",)``, a mass flow or both, or what sensors show.
    factor : str
        What multiplies the formula: of `FORCE_FACTORS` or `FLOW_FACTORS`.
    driver : str
        Of `DRIVERS`.
    formula : str
        Of `FORMULAS`.
    parameters : mapping of str to float
        Of the formula [SI].

    Raises
    ------
    ModelError
        If one of them is unknown, or a parameter is missing.

    Examples
    --------
    >>> term = Term("cogging", ("force",), "1", "x", "sine",
    ...             {"amplitude": 28.0, "phase": 0.1, "period": 9.6e-3})
    >>> term.text
    'force + amplitude sin(2π x/period + phase)'
    >>> term.units["period"]
    'm'
    """

    name: str
    balances: tuple[str, ...]
    factor: str
    driver: str
    formula: str
    parameters: Mapping[str, float]

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise ModelError(f"term {self.name!r}: the name must be an identifier, as stick_slip")
        for what, value, options in (
            ("balances", tuple(self.balances), PLACES),
            ("factor", self.factor, self._factors),
            ("driver", self.driver, DRIVERS),
            ("formula", self.formula, FORMULAS),
        ):
            if value not in options:
                raise ModelError(
                    f"term {self.name}: no {what} {value!r}; there are "
                    f"{', '.join(map(str, options))}"
                )
        own = ("u", "p", "p_other")
        ports = self.factor == "p_supply" or self.shifts_command
        elsewhere = own if ports or self.balances[0] in ("force", "measurement_x") else ("F",)
        if self.driver in elsewhere:
            raise ModelError(
                f"term {self.name}: driver {self.driver!r} does not exist in "
                f"{' and '.join(self.balances)}; name another one"
            )
        wanted = set(self.shape_and_coefficients)
        if wanted != set(self.parameters):
            raise ModelError(
                f"term {self.name}: formula {self.formula!r} needs the parameters "
                f"{', '.join(self.shape_and_coefficients)}, not {', '.join(self.parameters)}"
            )

    @property
    def _factors(self) -> Mapping[str, str]:
        if self.balances[0].startswith("measurement"):
            return {"1": "m" if self.balances == ("measurement_x",) else "Pa"}
        return FORCE_FACTORS if "force" in self.balances else FLOW_FACTORS

    @property
    def shifts_command(self) -> bool:
        """Whether the formula is added to the command of valves [V]."""
        return self.factor.endswith("dq_m/du")

    @property
    def law(self) -> Formula:
        """The formula."""
        return FORMULAS[self.formula]

    @property
    def shape_and_coefficients(self) -> tuple[str, ...]:
        """Names of the parameters that the formula needs."""
        return self.law.parameters

    @property
    def unit(self) -> str:
        """Unit of the formula's value."""
        return self._factors[self.factor]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each parameter."""
        return self.law.units(self.unit, DRIVERS[self.driver])

    @property
    def expression(self) -> str:
        """The term as plain text, with the driver's name for d; what it adds to a command."""
        text = _in_words(self.law.text, self.driver)
        if self.factor == "1" or self.shifts_command:
            return text
        return f"{self.factor} ({text})" if " + " in text else f"{self.factor} {text}"

    @property
    def text(self) -> str:
        """The term with the balances that it is added to, or the commands that it shifts."""
        if self.shifts_command:
            signs = {"P": "+", "N": "−" if self.factor.startswith("±") else "+"}
            chambers = [name[-1] for name in self.balances]
            return " and ".join(f"u_{c} {signs[c]} ({self.expression})" for c in chambers)
        return f"{' and '.join(self.balances)} + {self.expression}"


def _in_words(text: str, driver: str) -> str:
    """Return a formula with the driver's name for d."""
    return "".join(driver if word == "d" else word for word in _split(text))


def _split(text: str) -> list[str]:
    """Split a formula so that the driver d stands alone, powers and factors left where they are."""
    words: list[str] = []
    for letter in text:
        if letter.isalpha() and words and words[-1].isalpha():
            words[-1] += letter
        else:
            words.append(letter)
    return words


def term_effect(term: Term) -> type[Effect]:
    """Return the class of effects that adds a term to its balance.

    Parameters
    ----------
    term : Term
        Its parameters are where a fit starts; the coefficients are zero where it vanishes.

    Returns
    -------
    type
        Subclass of `Effect`, which catalogues, `identify` and output error take like any other.

    Examples
    --------
    >>> spring = term_effect(Term("spring", ("force",), "1", "x", "line", {"slope": -150.0}))
    >>> spring().junctions, spring().parameters[0].start
    (('force',), -150.0)
    """
    members: dict[str, Any] = {
        "__doc__": f"{term.text}.",
        "__module__": __name__,
        "__reduce__": lambda self: (_made, (term,)),
        "name": term.name,
        "equation": term.text,
        "sensors": _sensors(term),
        "source": "discovered from the residuals of the balances",
        "parameters": _parameters(term),
        "states": _states(term),
        "needs_chambers": _needs_chambers(term),
    }
    if term.driver in _RATES:
        members["rates"] = lambda self, entering, at: {term.driver: _RATES[term.driver](at)}
    members |= _junction(term)
    return type(term.name, (Effect,), members)


def _needs_chambers(term: Term) -> bool:
    return term.balances not in (("force",), ("measurement_x",)) or term.driver.startswith("p")


def _made(term: Term) -> Effect:
    return term_effect(term)()


def _parameters(term: Term) -> tuple[Parameter, ...]:
    law, units = term.law, term.units
    coefficients = {name for name, _ in law.linear} - {"phase"}
    items = []
    for name in law.parameters:
        value = float(term.parameters[name])
        null = 0.0 if name in coefficients else value
        items.append(
            Parameter(
                name,
                null,
                units[name],
                lower=value / SMALLEST if name in ("period", "width") else -float("inf"),
                scale=abs(value) or 1.0,
                free=name not in (*law.held, *law.searched),
                null=null,
                start=value,
                description=f"{name} of {term.expression}",
                source="discovered",
            )
        )
    return tuple(items)


def _sensors(term: Term) -> tuple[str, ...]:
    if not term.balances[0].startswith("measurement"):
        return ()
    return ("x",) if term.balances == ("measurement_x",) else ("p_P", "p_N")


def _states(term: Term) -> tuple[State, ...]:
    if term.driver not in _RATES:
        return ()
    return (State(term.driver, DRIVERS[term.driver], clock=term.driver == "t"),)


def _forgotten(at: Scope, state: str) -> Expression:
    """Return the rate at which the memory of a reversal is cleared while the axis is slow."""
    return at[state] * ca.exp(-((at.v / REVERSAL_SPEED) ** 2)) / REVERSAL_TIME


#: Rates of drivers that are states: time, and time and travel since the last reversal.
_RATES: Mapping[str, Callable[[Scope], Expression]] = {
    "t": lambda at: 1.0,
    "t_reversal": lambda at: 1.0 - _forgotten(at, "t_reversal"),
    "s_reversal": lambda at: ca.fabs(at.v) - _forgotten(at, "s_reversal"),
}


def _driver(term: Term, at: Scope, chamber: str) -> Expression:
    other = {"P": "N", "N": "P"}.get(chamber, "")
    own = {"u": f"u_{chamber}", "p": f"p_{chamber}", "p_other": f"p_{other}"}
    name = own.get(term.driver, term.driver)
    if name in _RATES:
        return at[name]
    if name in at.inputs:
        return at.inputs[name]
    known = {"x": at.x, "v": at.v, "p_P": at.p.P, "p_N": at.p.N}
    known |= {"p_mean": (at.p.P + at.p.N) / 2, "p_difference": at.p.P - at.p.N}
    return known[name]


def _value(term: Term, at: Scope, chamber: str = "") -> Expression:
    parameters = {name: at[name] for name in term.law.parameters}
    return term.law.value(ca, _driver(term, at, chamber), parameters)


def _junction(term: Term) -> dict[str, Any]:
    """Return the junction method by which the term acts."""

    def force(self: Effect, F: Expression, at: Scope) -> Expression:
        factor = {"1": 1.0, "sign(v)": at.direction, "v": at.v}[term.factor]
        return F + factor * _value(term, at)

    def flow(self: Effect, q_m: Pair, at: Scope) -> Pair:
        def added(chamber: str, q: Expression) -> Expression:
            if f"mass_flow_{chamber}" not in term.balances:
                return q
            value = _value(term, at, chamber)
            if term.factor == "q_m":
                return q * (1 + value)
            return q + value * (1.0 if term.factor == "1" else getattr(at.p, chamber))

        return Pair(added("P", q_m.P), added("N", q_m.N))

    def supply(self: Effect, ports: Supply, at: Scope) -> Supply:
        return Supply(ports.p_supply * (1 + _value(term, at)), ports.p_ext)

    def spool(self: Effect, u: Pair, at: Scope) -> Pair:
        shift, side = _value(term, at), -1.0 if term.factor.startswith("±") else 1.0
        moved = {"P": u.P + shift, "N": u.N + side * shift}
        own = (moved[c] if f"mass_flow_{c}" in term.balances else getattr(u, c) for c in "PN")
        return Pair(*own)

    def output(self: Effect, y: Mapping[str, Expression], at: Scope) -> Mapping[str, Expression]:
        if term.balances == ("measurement_x",):
            return {**y, "x": y["x"] + _value(term, at)}
        return {**y, **{f"p_{c}": y[f"p_{c}"] + _value(term, at, c) for c in ("P", "N")}}

    if "force" in term.balances:
        return {"force": force}
    if term.balances[0].startswith("measurement"):
        return {"output": output}
    if term.factor == "p_supply":
        return {"supply": supply}
    if term.shifts_command:
        return {"spool": spool}
    return {"valve_flow" if term.factor == "q_m" else "chamber_flow": flow}
