"""Formulas of one driver: a few linear coefficients, at most two parameters of shape.

Every formula is written once, for numbers (`numpy`) and for symbols (`casadi`): both modules have
the functions used here under the same names.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any

from pneumo_casadi.model.junctions import Expression

#: Width of a step over the range of its driver: no sensor resolves less of a stroke.
STEP_WIDTH = 0.005

#: ``columns(functions, d, shape)``: what the linear coefficients multiply.
Columns = Callable[[Any, Expression, Mapping[str, Any]], Sequence[Expression]]


@dataclass(frozen=True)
class Formula:
    """A function of one driver d.

    Parameters
    ----------
    name : str
        In results.
    text : str
        The formula as plain text, with ``d`` for the driver.
    linear : tuple of (str, int)
        Coefficients in which the formula is linear, each with the power of the driver's unit by
        which the term's unit is divided: a slope in N over the position is (``"slope"``, 1) in
        N/m.
    shape : tuple of str
        Parameters of shape, in the driver's unit.
    columns : callable
        What the coefficients multiply.
    periodic : bool
        Whether the two coefficients are those of sine and cosine, told as amplitude and phase.
    held : tuple of str
        Parameters of shape that no fit frees.
    searched : tuple of str
        Parameters of shape that are found by search alone: a jump has no derivative to its place.
    """

    name: str
    text: str
    linear: tuple[tuple[str, int], ...]
    shape: tuple[str, ...]
    columns: Columns
    periodic: bool = False
    held: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[str, ...]:
        """All parameters, the linear coefficients first."""
        return (*(name for name, _ in self.linear), *self.shape)

    def value(self, functions: Any, d: Expression, parameters: Mapping[str, Any]) -> Expression:
        """Return the formula at a driver.

        Parameters
        ----------
        functions : module
            ``numpy`` for numbers, ``casadi`` for symbols.
        d : Expression or array
            Driver [SI].
        parameters : mapping of str to float or Expression
            By the names of `parameters`.
        """
        if self.periodic:
            angle = 2 * pi * d / parameters["period"] + parameters["phase"]
            return parameters["amplitude"] * functions.sin(angle) + parameters.get("level", 0.0)
        columns = self.columns(functions, d, parameters)
        names = [name for name, _ in self.linear]
        return sum(parameters[name] * column for name, column in zip(names, columns, strict=True))

    def units(self, term: str, driver: str) -> dict[str, str]:
        """Return the unit of each parameter, from those of term and driver.

        Examples
        --------
        >>> FORMULAS["line"].units("N", "m")
        {'slope': 'N/m'}
        >>> FORMULAS["sine"].units("1", "s")
        {'amplitude': '1', 'phase': 'rad', 'period': 's'}
        """
        units = {
            name: "rad" if name == "phase" else _quotient(term, driver, power)
            for name, power in self.linear
        }
        return units | dict.fromkeys(self.shape, driver)


def _quotient(term: str, driver: str, power: int) -> str:
    if not power:
        return term
    factors = [part + (str(power) if power > 1 else "") for part in driver.split("/")]
    # N over m/s is N s/m.
    if len(factors) == 2:
        return f"{term} {factors[1]}/{factors[0]}" if term != "1" else f"{factors[1]}/{factors[0]}"
    return f"{term}/{factors[0]}"


def _powers(degree: int) -> Columns:
    return lambda functions, d, shape: [d**power for power in range(1, degree + 1)]


def _step(functions: Any, d: Expression, shape: Mapping[str, Any]) -> Sequence[Expression]:
    return [(1 + functions.tanh((d - shape["edge"]) / shape["width"])) / 2]


def _bump(functions: Any, d: Expression, shape: Mapping[str, Any]) -> Sequence[Expression]:
    return [functions.exp(-(((d - shape["centre"]) / shape["width"]) ** 2))]


def _sine(functions: Any, d: Expression, shape: Mapping[str, Any]) -> Sequence[Expression]:
    angle = 2 * pi * d / shape["period"]
    return [functions.sin(angle), functions.cos(angle)]


def with_level(formula: Formula) -> Formula:
    """Return a formula with a constant besides."""
    return replace(
        formula,
        name=f"{formula.name} with level",
        text=f"level + {formula.text}",
        linear=(*formula.linear, ("level", 0)),
        columns=lambda f, d, s: [*formula.columns(f, d, s), 1.0 + 0.0 * d],
    )


_SIMPLE = (
    Formula("constant", "level", (("level", 0),), (), lambda f, d, s: [1.0 + 0.0 * d]),
    Formula("line", "slope d", (("slope", 1),), (), _powers(1)),
    Formula("square", "square d²", (("square", 2),), (), lambda f, d, s: [d**2]),
    Formula("quadratic", "slope d + square d²", (("slope", 1), ("square", 2)), (), _powers(2)),
    Formula(
        "absolute value",
        "slope |d − vertex|",
        (("slope", 1),),
        ("vertex",),
        lambda f, d, s: [f.fabs(d - s["vertex"])],
    ),
    Formula(
        "exponential",
        "height exp(−d/decay)",
        (("height", 0),),
        ("decay",),
        lambda f, d, s: [f.exp(-d / s["decay"])],
    ),
    Formula(
        "step",
        "height (1 + tanh((d − edge)/width))/2",
        (("height", 0),),
        ("edge", "width"),
        _step,
        held=("width",),
    ),
    Formula(
        "ramp from",
        "slope max(d − edge, 0)",
        (("slope", 1),),
        ("edge",),
        lambda f, d, s: [f.fmax(d - s["edge"], 0)],
    ),
    Formula(
        "ramp to",
        "slope max(edge − d, 0)",
        (("slope", 1),),
        ("edge",),
        lambda f, d, s: [f.fmax(s["edge"] - d, 0)],
    ),
    Formula(
        "bump",
        "height exp(−((d − centre)/width)²)",
        (("height", 0),),
        ("centre", "width"),
        _bump,
    ),
    Formula(
        "sine",
        "amplitude sin(2π d/period + phase)",
        (("amplitude", 0), ("phase", 0)),
        ("period",),
        _sine,
        periodic=True,
    ),
    Formula(
        "odd cubic",
        "slope d + cube d³",
        (("slope", 1), ("cube", 3)),
        (),
        lambda f, d, s: [d, d**3],
    ),
    Formula(
        "cubic",
        "slope d + square d² + cube d³",
        (("slope", 1), ("square", 2), ("cube", 3)),
        (),
        _powers(3),
    ),
)

#: Formulas that are tried with a constant besides, where no parameter takes it up.
_WITH_LEVEL = ("line", "quadratic", "absolute value", "exponential", "bump", "sine")
#: By name.
FORMULAS: Mapping[str, Formula] = {
    formula.name: formula
    for formula in (
        *_SIMPLE,
        *(with_level(formula) for formula in _SIMPLE if formula.name in _WITH_LEVEL),
    )
}
