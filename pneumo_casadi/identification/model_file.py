"""An axis as plain values: bench, flow map, effects and parameters, and back.

What `result.json` and exported models hold, so that a model is whole without its case folder.
Reading builds numbers and names into an axis; nothing that a file says is executed.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pneumo_casadi.data.bench.bench_file import bench_content, bench_from_content
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.identification.starting_axis import catalogue_effect
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.servosystem import nominal_axis
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters
from pneumo_casadi.valve import (
    AnyFlowModel,
    FlowISO6358,
    FlowModel,
    FlowPair,
    FlowPolynomials,
    FlowSpline,
)

_FORMS: dict[str, type[Any]] = {
    "polynomials": FlowPolynomials,
    "spline": FlowSpline,
    "iso6358": FlowISO6358,
}
#: What each form consists of beside parameters and covariance, and how it is read.
_PARTS: dict[str, dict[str, Callable[[Any], Any]]] = {
    "polynomials": {
        "degrees": lambda value: tuple(map(int, value)),
        "p_range": lambda value: _pair(value),
        "u_range": lambda value: _pair(value),
        "sigma": float,
        "dof": int,
    },
    "spline": {
        "knots_u": lambda value: _array(value),
        "knots_p": lambda value: _array(value),
        "degree_u": int,
        "degree_p": int,
        "coefficients": lambda value: _array(value),
        "p_range": lambda value: _pair(value),
        "u_range": lambda value: _pair(value),
        "sigma": float,
        "dof": float,
    },
    "iso6358": {
        "sigma": float,
        "p_range": lambda value: _pair(value),
        "u_range": lambda value: _pair(value),
        "p_supply": float,
        "p_ext": float,
        "T": float,
        "laminar_ratio": float,
    },
}


#: Form of the flow of two valves that differ.
PAIR = "pair"


def axis_dict(axis: Axis) -> dict[str, Any]:
    """Return an axis as plain values that JSON can hold.

    Parameters
    ----------
    axis : Axis
        With a flow map of this package (or none) and effects of the catalogue.

    Returns
    -------
    dict
        ``bench`` as in bench.json, ``flow`` (form and constants, or None), ``effects`` (names)
        and ``parameters`` (value, unit, bounds, scale, free), SI units; a bound or a variance
        that is infinite is None.

    Raises
    ------
    ModelError
        If flow map or an effect are your own: a file could name them, but not hold them.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> axis_from_dict(axis_dict(axis)).parameters == axis.parameters
    True
    """
    for effect in axis.effects:
        if not _held_by_file(effect, axis.flow):
            raise ModelError(
                f"effect {effect.name} is not of the catalogue: a file cannot hold it; export "
                "functions, C or FMU, which hold the equations"
            )
    return {
        "bench": bench_content(axis.bench),
        "flow": _flow_dict(axis.flow) if axis.kind.needs_flow_map else None,
        "effects": [effect.name for effect in axis.effects],
        "parameters": {
            item.name: {
                "value": item.value,
                "unit": item.unit,
                "lower": _finite(item.lower),
                "upper": _finite(item.upper),
                "scale": item.scale,
                "free": item.free,
            }
            for item in axis.parameters
        },
    }


def axis_from_dict(content: Any) -> Axis:
    """Return the axis that `axis_dict` has described.

    Raises
    ------
    CaseError
        If something is missing, unknown or not plausible; the message names it.
    """
    try:
        bench = bench_from_content(content["bench"])
        items = [_parameter(name, item) for name, item in content["parameters"].items()]
        flow = None if content["flow"] is None else _flow(content["flow"], items)
        effects = [_effect(name, flow, content["parameters"]) for name in content["effects"]]
        axis = nominal_axis(bench, flow, effects)
        given = {item.name: item for item in items}
        odd = sorted(given.keys() ^ set(axis.parameters.names))
        if odd:
            raise CaseError(f"parameters do not match the axis: {', '.join(odd)}")
        return axis.with_parameters(
            Parameters(
                replace(
                    item,
                    value=given[item.name].value,
                    lower=given[item.name].lower,
                    upper=given[item.name].upper,
                    scale=given[item.name].scale,
                    free=given[item.name].free,
                )
                for item in axis.parameters
            )
        )
    except CaseError:
        raise
    except KeyError as error:
        raise CaseError(f"no model of an axis: {error} is missing") from None
    except (TypeError, ValueError, AttributeError, RuntimeError) as error:
        # ModelError is a ValueError; CasADi, given a spline that is none, raises RuntimeError.
        raise CaseError(f"no model of an axis ({error})") from None


def _flow_dict(flow: AnyFlowModel) -> dict[str, Any]:
    if isinstance(flow, FlowPair):
        return {"form": PAIR, "P": _flow_dict(flow.P), "N": _flow_dict(flow.N)}
    form = next((name for name, kind in _FORMS.items() if type(flow) is kind), None)
    if form is None:
        raise ModelError(
            f"flow map {type(flow).__name__} is your own: a file cannot hold it; export "
            "functions, C or FMU, which hold the equations"
        )
    content: dict[str, Any] = {"form": form}
    for name in _PARTS[form]:
        value = getattr(flow, name)
        content[name] = np.asarray(value).tolist() if not np.isscalar(value) else value
    content["parameters"] = list(flow.parameters.names)
    content["covariance"] = [[_finite(float(value)) for value in row] for row in flow.covariance]
    return content


def _flow(content: Mapping[str, Any], items: list[Parameter]) -> AnyFlowModel:
    form = content["form"]
    if form == PAIR:
        return FlowPair(*(_flow(content[c], _of_valve(items, c)) for c in ("P", "N")))
    if form not in _FORMS:
        raise CaseError(f"flow map of form {form!r}; known are {', '.join(_FORMS)}")
    parts = {name: read(content[name]) for name, read in _PARTS[form].items()}
    parameters = Parameters(items).select(content["parameters"])
    covariance = np.array(
        [[np.inf if value is None else value for value in row] for row in content["covariance"]],
        dtype=float,
    )
    flow: FlowModel = _FORMS[form](parameters=parameters, covariance=covariance, **parts)
    return flow


def _of_valve(items: list[Parameter], chamber: str) -> list[Parameter]:
    """Return the coefficients of one of two valves that differ, as its own model names them."""
    end = f"_{chamber}"
    return [
        replace(item, name=item.name.removesuffix(end)) for item in items if item.name.endswith(end)
    ]


def _effect(name: Any, flow: AnyFlowModel | None, names: Collection[str]) -> Effect:
    """Return the effect whose parameters are among the names: a shape may be local or not."""
    if name not in EFFECTS:
        raise CaseError(f"effect {name!r} is not of the catalogue; known are {', '.join(EFFECTS)}")
    local, general = _forms(name, flow)
    fits = all(f"{name}.{item.name}" in names for item in local.parameters)
    return local if fits else general


def _forms(name: str, flow: AnyFlowModel | None) -> tuple[Effect, Effect]:
    """Return an effect for a valve with this flow map, and as it is without one."""
    return catalogue_effect(name, flow), EFFECTS[name]()


def _held_by_file(effect: Effect, flow: AnyFlowModel | None) -> bool:
    """Tell whether the name of an effect is enough to make it again."""
    return effect.name in EFFECTS and any(
        type(effect) is type(known) and vars(effect) == vars(known)
        for known in _forms(effect.name, flow)
    )


def _parameter(name: str, item: Mapping[str, Any]) -> Parameter:
    lower, upper = item["lower"], item["upper"]
    return Parameter(
        str(name),
        float(item["value"]),
        str(item["unit"]),
        lower=-np.inf if lower is None else float(lower),
        upper=np.inf if upper is None else float(upper),
        scale=float(item["scale"]),
        free=bool(item["free"]),
    )


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _pair(value: Any) -> tuple[float, float]:
    first, second = value
    return float(first), float(second)


def _array(value: Any) -> FloatArray:
    return np.array(value, dtype=float)
