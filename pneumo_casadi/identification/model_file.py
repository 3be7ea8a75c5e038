"""An axis as plain values: bench, flow map, effects and parameters, and back.

What `result.json` and exported models hold, so that a model is whole without its case folder.
Reading builds numbers and names into an axis; nothing that a file says is executed.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, field

from pneumo_casadi.data.bench.bench_file import bench_content, bench_from_content
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.identification.starting_axis import catalogue_effect
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.servosystem import nominal_axis
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.runtime.input_files import one_line, shown
from pneumo_casadi.runtime.json_input import Section, typed
from pneumo_casadi.valve import AnyFlowModel
from pneumo_casadi.valve.flow_file import flow_dict, flow_from_dict


class ParameterSection(Section):
    """A parameter of an axis; a bound that is None is infinite."""

    value: float
    unit: str
    lower: float | None
    upper: float | None
    scale: Annotated[float, Meta(gt=0)]
    free: bool


class AxisSection(Section):
    """An axis in `result.json` and `axis.json`."""

    bench: dict[str, Any]
    flow: dict[str, Any] | None
    effects: list[str]
    parameters: dict[str, ParameterSection]
    signals: list[str] = field(default_factory=list)


#: By how much piston area and X_s3 r T of one axis may differ. X_s3 has the scale of the flow map,
#: and no map is wrong by a factor of ten unnoticed.
AREA_RATIO = 10.0


def axis_dict(axis: Axis) -> dict[str, Any]:
    """Return an axis as plain values that JSON can hold.

    Parameters
    ----------
    axis : Axis
        With a flow map of this package (or none) and effects of the catalogue.

    Returns
    -------
    dict
        ``bench`` as in bench.json, ``flow`` (form and constants, or None), ``effects`` (names),
        ``parameters`` (value, unit, bounds, scale, free) and ``signals`` (further inputs and
        outputs, see `AxisKind.with_signals`), SI units; a bound or a variance that is infinite is
        None.

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
        "flow": flow_dict(axis.flow) if axis.kind.needs_flow_map else None,
        "effects": [effect.name for effect in axis.effects],
        "parameters": {
            item.name: {
                "value": float(item.value),
                "unit": item.unit,
                "lower": _finite(item.lower),
                "upper": _finite(item.upper),
                "scale": float(item.scale),
                "free": item.free,
            }
            for item in axis.parameters
        },
        "signals": sorted(axis.bench.signals),
    }


def axis_from_dict(content: Any) -> Axis:
    """Return the axis that `axis_dict` has described.

    Raises
    ------
    CaseError
        If something is missing, unknown or not plausible; the message names it.
    """
    return axis_of_section(typed(content, AxisSection, "model"))


def axis_of_section(section: AxisSection) -> Axis:
    """Return the axis of a section that is typed already; errors as in `axis_from_dict`."""
    bench = bench_from_content(section.bench)
    if section.signals:
        bench = replace(bench, signals=frozenset(section.signals))
    try:
        items = [_parameter(name, item) for name, item in section.parameters.items()]
        flow = None if section.flow is None else flow_from_dict(section.flow, items, "model.flow")
        effects = [_effect(name, flow, section.parameters) for name in section.effects]
        axis = nominal_axis(bench, flow, effects)
    except CaseError:
        raise
    except (TypeError, ValueError, RuntimeError) as error:
        # ModelError is a ValueError; CasADi, given a spline that is none, raises RuntimeError.
        raise CaseError(f"no model of an axis ({one_line(error)})") from None
    given = {item.name: item for item in items}
    odd = sorted(given.keys() ^ set(axis.parameters.names))
    if odd:
        raise CaseError(
            f"parameters do not match the axis: {', '.join(odd)}; if another version has written "
            "the file, identify anew"
        )
    for item in axis.parameters:
        check_unit(item, given[item.name].unit)
    _check_areas(axis, given)
    try:
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
    except ModelError as error:
        raise CaseError(f"no model of an axis ({error})") from None


def check_unit(item: Parameter, unit: str) -> None:
    """Check that a file gives a parameter in the unit of the axis.

    Raises
    ------
    CaseError
        Naming the parameter and both units.
    """
    if unit != item.unit:
        raise CaseError(
            f"`{item.name}`: in {shown(unit)}, expected {item.unit!r}; convert the value, or "
            "identify anew"
        )


def _check_areas(axis: Axis, given: Mapping[str, Parameter]) -> None:
    """Check that piston areas and the coefficients X_s3, X_s6 = S/(r T) belong to one axis."""
    constants = axis.constants
    for chamber, name in (("P", "X_s3"), ("N", "X_s6")):
        if chamber not in axis.kind.gas_chambers or name not in given:
            continue
        area = given[name].value * constants["r"] * constants["T"]
        stated = constants[f"S_{chamber}"]
        if not stated / AREA_RATIO < area < stated * AREA_RATIO:
            raise CaseError(
                f"`bench.S_{chamber}_m2` is {stated:.3g} m², but {name} r T is {area:.3g} m²: they "
                "belong to different axes; identify anew"
            )


def _effect(name: str, flow: AnyFlowModel | None, names: Collection[str]) -> Effect:
    """Return the effect whose parameters are among the names: a shape may be local or not."""
    if name not in EFFECTS:
        raise CaseError(
            f"effect {shown(name)} is not of the catalogue; known are {', '.join(EFFECTS)}"
        )
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


def _parameter(name: str, item: ParameterSection) -> Parameter:
    return Parameter(
        name,
        item.value,
        item.unit,
        lower=-np.inf if item.lower is None else item.lower,
        upper=np.inf if item.upper is None else item.upper,
        scale=item.scale,
        free=item.free,
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
