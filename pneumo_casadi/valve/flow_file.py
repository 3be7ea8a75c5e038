"""Flow models as plain values: what result.json holds of them, and back."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.runtime.input_files import shown
from pneumo_casadi.runtime.json_input import Section, typed
from pneumo_casadi.valve.flow_model import FlowModel
from pneumo_casadi.valve.flow_pair import AnyFlowModel, FlowPair
from pneumo_casadi.valve.iso6358 import FlowISO6358
from pneumo_casadi.valve.opening import known_laws
from pneumo_casadi.valve.polynomials import FlowPolynomials
from pneumo_casadi.valve.spline import FlowSpline

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
#: A flow map of some hundred points bears no degree near the highest one.
Degree = Annotated[int, Meta(ge=0, le=30)]
Range = tuple[float, float]


class _Form(Section):
    """What all flow models have: names of their parameters, and covariance."""

    parameters: list[str]
    covariance: list[list[float | None]]


class _Polynomials(_Form):
    degrees: tuple[Degree, Degree, Degree]
    p_range: Range
    u_range: Range
    sigma: NotNegative
    dof: int


class _Spline(_Form):
    knots_u: list[float]
    knots_p: list[float]
    degree_u: Degree
    degree_p: Degree
    coefficients: list[list[float]]
    p_range: Range
    u_range: Range
    sigma: NotNegative
    dof: float


class _Iso6358(_Form):
    sigma: NotNegative
    p_range: Range
    u_range: Range
    p_supply: Positive
    p_ext: Positive
    T: Positive
    laminar_ratio: NotNegative


#: Forms of a flow model -> class, and what a file holds of it.
_FORMS: dict[str, tuple[type[Any], type[_Form]]] = {
    "polynomials": (FlowPolynomials, _Polynomials),
    "spline": (FlowSpline, _Spline),
    "iso6358": (FlowISO6358, _Iso6358),
}

#: Form of the flow of two valves that differ.
PAIR = "pair"


#: How names of flow parameters begin -> their unit, longer ones first.
_UNITS = {
    "flow_gain": "1",
    "supply_ratio": "1",
    "C_leak_": "m³/(s Pa)",
    "phi_": "kg/s",
    "psi_": "kg/(s V)",
    "u_0_": "V",
    "k_": "m³/(s Pa V)",
    "w_": "V",
    "h_": "1/V",
    "b_": "1",
    "m": "1",
}


class _NamedForm(Section):
    form: str


class _PairedForms(Section):
    P: dict[str, Any]
    N: dict[str, Any]


def flow_dict(flow: AnyFlowModel) -> dict[str, Any]:
    """Return a flow model as plain values that JSON can hold.

    Raises
    ------
    ModelError
        If it is your own.
    """
    if isinstance(flow, FlowPair):
        return {"form": PAIR, "P": flow_dict(flow.P), "N": flow_dict(flow.N)}
    form = next((name for name, (kind, _) in _FORMS.items() if type(flow) is kind), None)
    if form is None:
        raise ModelError(
            f"flow map {type(flow).__name__} is your own: a file cannot hold it; export "
            "functions, C or FMU, which hold the equations"
        )
    content: dict[str, Any] = {"form": form}
    common = _Form.__struct_fields__
    for name in (name for name in _FORMS[form][1].__struct_fields__ if name not in common):
        value = getattr(flow, name)
        content[name] = np.asarray(value).tolist() if not np.isscalar(value) else value
    content["parameters"] = list(flow.parameters.names)
    content["covariance"] = [[_finite(float(value)) for value in row] for row in flow.covariance]
    return content


def flow_from_dict(content: Any, items: Sequence[Parameter], where: str) -> AnyFlowModel:
    """Return the flow model that `flow_dict` has described.

    Parameters
    ----------
    content : object
        What the file holds.
    items : sequence of Parameter
        Parameters of the axis, those of the flow among them.
    where : str
        Name of the section in messages.

    Raises
    ------
    CaseError
        If something is missing, unknown or not plausible; the message names it.
    """
    form = typed(content, _NamedForm, where).form
    if form == PAIR:
        both = typed(content, _PairedForms, where)
        parts = (("P", both.P), ("N", both.N))
        return FlowPair(
            *(flow_from_dict(part, _of_valve(items, c), f"{where}.{c}") for c, part in parts)
        )
    if form not in _FORMS:
        raise CaseError(f"flow map of form {shown(form)}; known are {', '.join(_FORMS)}")
    make, model = _FORMS[form]
    section = typed(content, model, where)
    parameters = Parameters(items).select(section.parameters)
    _check_units(parameters, where)
    n = len(parameters)
    if [len(row) for row in section.covariance] != [n] * n:
        raise CaseError(f"`{where}.covariance`: expected {n} rows of {n} numbers; identify anew")
    covariance = np.array(
        [[np.inf if value is None else value for value in row] for row in section.covariance],
        dtype=float,
    ).reshape(n, n)
    values = {
        name: np.array(value, dtype=float) if isinstance(value, list) else value
        for name in model.__struct_fields__
        if name not in _Form.__struct_fields__
        for value in (getattr(section, name),)
    }
    for name in ("p_range", "u_range"):
        if not values[name][0] < values[name][1]:
            raise CaseError(f"`{where}.{name}`: got {values[name]}; the first must be the lower")
    if isinstance(section, _Spline):
        _check_spline(section, where)
    if isinstance(section, _Iso6358):
        _check_openings(section, where)
    flow: FlowModel = make(parameters=parameters, covariance=covariance, **values)
    return flow


def _check_units(parameters: Parameters, where: str) -> None:
    for item in parameters:
        expected = next((u for start, u in _UNITS.items() if item.name.startswith(start)), None)
        if item.unit != expected:
            raise CaseError(
                f"`{where}`: parameter {shown(item.name)} in {shown(item.unit)}, expected "
                f"{expected}; convert the value, or identify anew"
            )


def _check_openings(section: _Iso6358, where: str) -> None:
    """Check that the parameters are those of one of the laws of opening."""
    names = frozenset(section.parameters)
    nearest = min(known_laws(), key=lambda law: len(law ^ names))
    odd = sorted(nearest ^ names)
    if odd:
        raise CaseError(
            f"`{where}.parameters`: not those of an ISO 6358 valve, which differ in "
            f"{', '.join(map(shown, odd))}; identify anew"
        )


def _check_spline(section: _Spline, where: str) -> None:
    """Check what CasADi takes for granted of a B-spline."""
    for knots, name in ((section.knots_u, "knots_u"), (section.knots_p, "knots_p")):
        if len(knots) < 2 or any(b < a for a, b in pairwise(knots)):
            raise CaseError(f"`{where}.{name}`: no increasing numbers; no model of an axis")
    rows = len(section.knots_u) - section.degree_u - 1
    columns = len(section.knots_p) - section.degree_p - 1
    if min(rows, columns) < 1 or [len(row) for row in section.coefficients] != [columns] * rows:
        raise CaseError(
            f"`{where}.coefficients`: expected {rows} rows of {columns} numbers for these knots "
            "and degrees; no model of an axis"
        )


def _of_valve(items: Sequence[Parameter], chamber: str) -> list[Parameter]:
    """Return the coefficients of one of two valves that differ, as its own model names them."""
    end = f"_{chamber}"
    return [
        replace(item, name=item.name.removesuffix(end)) for item in items if item.name.endswith(end)
    ]


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
