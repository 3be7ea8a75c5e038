"""The axis to identify: effects added, parameters held, and where the fit starts."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.data import Bench, Case, Recording
from pneumo_casadi.data.bench.driven_bench import is_metered
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.equation_error import fit_equation_error
from pneumo_casadi.estimation.wls import WLSResult
from pneumo_casadi.estimation.wls.fit import POLYTROPIC
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.servosystem import nominal_axis
from pneumo_casadi.parameters import Parameters
from pneumo_casadi.valve import AnyFlowModel

#: X_s1 and X_s4, V(0)/(k r T): with k they change as X_s2 and X_s5 do, S/(k r T).
_VOLUME_OF = {"X_s2": "X_s1", "X_s5": "X_s4"}


def make_axis(case: Case, flow: AnyFlowModel | None) -> Axis:
    """Make the nominal axis of a case, of the kind that its bench says."""
    try:
        return nominal_axis(case.bench, flow)
    except ModelError as error:
        raise ModelError(f"{case.folder}: {error}") from None


def catalogue_effect(name: str, flow: AnyFlowModel | None, metered: bool = True) -> Effect:
    """Return an effect of the catalogue, as a valve with this flow map shows it if it was metered.

    Raises
    ------
    ModelError
        If there is no such effect; the message lists those of the catalogue.
    """
    if name not in EFFECTS:
        raise ModelError(f"no effect {name!r}; there are {', '.join(EFFECTS)}")
    effect = EFFECTS[name]
    # A flow model of one's own need not state it.
    reach = getattr(flow, "u_range", None) if metered else None
    return effect() if reach is None else effect.on_metered(*reach)()


def axis_of_options(case: Case, flow: AnyFlowModel | None, options: IdentifyOptions) -> Axis:
    """Return the axis to identify: nominal, with the effects added and the parameters held.

    Raises
    ------
    ModelError
        If an effect or a parameter is unknown, does not suit the axis, or cannot be held.
    """
    axis = make_axis(case, flow)
    metered = is_metered(case.bench)
    axis = axis.with_effects(*(catalogue_effect(name, flow, metered) for name in options.effects))
    if not options.refine_flow:
        if axis.flow_parameters and not metered:
            raise ModelError(
                "refine_flow=False (--fixed-map): no valve was metered, and a flow of the data "
                "sheet or of the records is only a start; leave the option out"
            )
        axis = axis.with_parameters(axis.parameters.fix(*axis.flow_parameters))
    _refuse_unknown(axis, options)
    held = axis.parameters.with_values(options.fixed).fix(*options.fixed)
    kept = set() if options.refine_flow else set(axis.flow_parameters)
    released = [name for name in options.start_values if name not in {*POLYTROPIC, *kept}]
    return axis.with_parameters(held.release(*released))


def with_flow_from_records(axis: Axis, records: Sequence[Recording]) -> Axis:
    """Return the axis with the flow of unmetered valves refined by its records.

    Weighted least squares takes the flow as known. Where nobody metered it, the equation error
    along the smoothed motion estimates it first, with the scale from the piston areas.
    """
    if not isinstance(axis.bench, Bench) or axis.bench.valves.metered:
        return axis
    return fit_equation_error(axis, records).axis


def axis_for_wls(axis: Axis, options: IdentifyOptions) -> Axis:
    """Return the axis whose regressor weighted least squares takes.

    An effect with a column of its own stands at its starting values, which give the column its
    shape; any other effect is left out of the balances, at its null values.
    """
    columns = {name.split(".")[0] for name in axis.regressor_names}
    shaped = [effect.name for effect in axis.effects if effect.name in columns]
    at = axis.at_null_values()
    at = at.at_starting_values(*shaped) if shaped else at
    given = {n: v for n, v in options.start_values.items() if n.split(".")[0] in shaped}
    return at.with_parameters({**given, **options.fixed})


def start_of_output_error(axis: Axis, wls: WLSResult, options: IdentifyOptions) -> Axis:
    """Return the axis at which output error starts.

    The estimates of weighted least squares; effects that it does not see, or whose estimate physics
    excludes, at their starting values; then `start_values` and `fixed`.
    """
    excluded = [name for name in wls.out_of_bounds if "." in name]
    known = Parameters(item for item in wls.parameters if item.name not in excluded)
    start = axis.at_starting_values() if axis.effects else axis
    start = start.started_at(known)
    given = {n: v for n, v in options.start_values.items() if n not in POLYTROPIC}
    start = start.with_parameters({**given, **options.fixed})
    return start.with_parameters(_at_polytropic(start.parameters, options.start_values))


def _at_polytropic(parameters: Parameters, values: Mapping[str, float]) -> dict[str, float]:
    """Return the chambers' parameters at k = X_s3/X_s2, with area and dead length as they are."""
    changed: dict[str, float] = {}
    for name, (area, slope) in POLYTROPIC.items():
        if name in values:
            volume = _VOLUME_OF[slope]
            factor = parameters[area].value / values[name] / parameters[slope].value
            changed |= {n: factor * parameters[n].value for n in (slope, volume)}
    return changed


def refuse_unscanned(axis: Axis, fixed: Collection[str]) -> None:
    """Refuse effects with parameters that only a diagnosis finds and nobody has given.

    Raises
    ------
    ModelError
        Naming them.
    """
    unknown = [
        name
        for effect in axis.effects
        for name in (f"{effect.name}.{short}" for short in effect.staircase)
        if name not in fixed
    ]
    if unknown:
        raise ModelError(
            f"{', '.join(unknown)}: found by scans of the diagnosis alone; identify what it found "
            f"with `diagnose --refine`, or hold them at known values, as in --fix {unknown[-1]}=0.1"
        )


def _refuse_unknown(axis: Axis, options: IdentifyOptions) -> None:
    names = [name for name in axis.parameters.names if name != "v_s"]
    own = [name for name in names if name not in axis.flow_parameters]
    derived = [name for name in POLYTROPIC if axis.kind.gas_chambers]
    for name in (*options.fixed, *options.start_values):
        if name not in names and name not in derived:
            reason = "its width is an option of output error" if name == "v_s" else "unknown"
            raise ModelError(
                f"parameter {name!r}: {reason}; there are {', '.join(own)}; to start from only "
                f"{', '.join(derived)}; and {len(axis.flow_parameters)} flow coefficients"
            )
    for name, (area, slope) in POLYTROPIC.items():
        if name in options.fixed:
            raise ModelError(
                f"{name} cannot be held: it is the ratio {area}/{slope} of two parameters; hold "
                f"{slope} and {area}, or only start from it"
            )
        moved = {slope, _VOLUME_OF[slope]} & {*options.fixed, *options.start_values}
        if name in options.start_values and moved:
            raise ModelError(
                f"start from {name} or give {' and '.join(sorted(moved))}, not both: {name} is "
                f"{area}/{slope}, and sets {_VOLUME_OF[slope]} with {slope}"
            )
    both = sorted({*options.fixed} & {*options.start_values})
    if both:
        raise ModelError(f"{', '.join(both)}: held and started from another value; give one")


def started_from(
    options: IdentifyOptions, axis: Axis, values: Mapping[str, float], held: Collection[str]
) -> IdentifyOptions:
    """Return options that start from known values, moved into the bounds of the axis.

    Parameters
    ----------
    options : IdentifyOptions
        What else is chosen, effects included.
    axis : Axis
        That of the options.
    values : mapping of str to float
        Parameters of axis, effects and flow map [SI]; the width v_s is passed over.
    held : collection of str
        Those to hold at their value. Flow coefficients that the axis holds are passed over.
    """
    start: dict[str, float] = {}
    fixed: dict[str, float] = {}
    for item in axis.parameters:
        if item.name not in values or item.name == "v_s":
            continue
        value = float(np.clip(values[item.name], item.lower, item.upper))
        if item.name in held:
            fixed[item.name] = value
        elif item.free or item.name not in axis.flow_parameters:
            start[item.name] = value
    return replace(options, start_values=start, fixed=fixed)
