"""Warnings about estimates that geometry, data sheet or physics contradict."""

from collections.abc import Iterator

from pneumo_casadi.data import Case
from pneumo_casadi.data.bench.load import GRAVITY
from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.identification.warnings.grading import (
    K_RANGE,
    SIGMAS,
    ResultWarning,
    limited,
    met,
)


def physics_warnings(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    """Yield what mass, areas, polytropic coefficients and friction contradict."""
    sheet = case.bench.datasheet.get("M_kg")
    if sheet:
        own = [f"{each.name}.{name}" for each in result.axis.effects for name in each.masses]
        parts = ("M", *own)  # the data sheet states all that moves
        M = sum(result.parameters[name].value for name in parts)
        yield from limited(
            "mass",
            (abs(M - sheet) - SIGMAS * result.std_of_sum(dict.fromkeys(parts, 1.0))) / sheet,
            "physics",
            f"{' + '.join(parts)} = {M:.4g} kg is {100 * (M / sheet - 1):+.0f} % off the data "
            "sheet.",
        )
    if case.bench.kind.gas_chambers:
        yield from _of_chambers(case, result)
    else:
        yield from _of_estimated_areas(case, result)
    yield from _of_friction(case, result)


def _half(result: OutputErrorResult, name: str) -> float:
    """Return the half width of an interval; 0 where the parameter was held."""
    return SIGMAS * max(result.std(name), result.std(name, robust=True))


def _of_chambers(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    areas = []
    for chamber in case.bench.kind.gas_chambers:
        geometric = getattr(case.bench, f"S_{chamber}")
        areas.append(result.derived[f"S_{chamber}"].value / geometric)
        yield from limited(
            "area",
            abs(areas[-1] - 1) - _half(result, f"S_{chamber}") / geometric,
            "physics",
            f"The area S_{chamber} computed from the fit is {100 * (areas[-1] - 1):+.0f} % off "
            "that of the bench: look for gauge pressures, a wrong temperature, flow scale or leak.",
        )
    ratio = areas[1] / areas[0]
    X_s3, X_s6 = (result.parameters[name].value for name in ("X_s3", "X_s6"))
    relative = {"X_s3": -1 / X_s3, "X_s6": 1 / X_s6}  # S = X R T: one meter cancels in the ratio
    yield from limited(
        "area ratio",
        abs(ratio - 1) - ratio * SIGMAS * result.std_of_sum(relative),
        "physics",
        f"The ratio of the areas S_N/S_P computed from the fit is {100 * (ratio - 1):+.0f} % off "
        "that of the bench: look for exchanged chambers, unequal valves or a leak.",
    )
    yield from _of_dead_volumes(case, result)
    low, high = K_RANGE
    for name in ("k_P", "k_N"):
        k = result.derived[name].value
        yield from limited(
            "polytropic",
            max(low - k, k - high) - _half(result, name),
            "physics",
            f"{name} = {k:.3f} is not between {low:g} (isothermal) and {high:g} (adiabatic): the "
            "parameters may have absorbed an unmodelled effect; `diagnose` looks for it.",
        )


def _of_estimated_areas(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    """Yield where the areas that a measured force gives are not those of the bench."""
    for name in ("S_P", "S_N"):
        if name not in result.parameters.free_names:
            continue
        geometric = getattr(case.bench, name)
        area = result.parameters[name].value
        yield from limited(
            "area",
            (abs(area - geometric) - _half(result, name)) / geometric,
            "physics",
            f"The estimated area {name} is {100 * (area / geometric - 1):+.0f} % off that of the "
            "bench: look at scale and sign of the measured force, and for gauge pressures.",
        )


def _of_dead_volumes(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    for chamber in case.bench.kind.gas_chambers:
        name = f"l_D{chamber}"
        length, half_stroke = result.derived[name].value, result.axis.constants["stroke"] / 2
        yield from limited(
            "large dead volume",
            (length - _half(result, name)) / half_stroke,
            "physics",
            f"The dead volume of chamber {chamber} computed from the fit is {1e3 * length:.0f} mm "
            f"of the stroke, of which half is {1e3 * half_stroke:.0f} mm: are there hoses of that "
            "volume, and is the stroke right?",
        )
        yield from limited(
            "dead volume",
            (-length - _half(result, name)) / half_stroke,
            "physics",
            f"The dead volume of chamber {chamber} computed from the fit is negative, "
            f"{1e3 * length:.1f} mm of the stroke: is x = 0 at mid-stroke, and the stroke right?",
        )


def _of_friction(case: Case, result: OutputErrorResult) -> Iterator[ResultWarning]:
    sides = {name: result.parameters[name].value for name in ("F_c_plus", "F_c_minus")}
    mean = result.derived["F_c"].value
    if mean < -_half(result, "F_c"):
        yield met(
            "friction drives",
            "physics",
            f"The Coulomb friction is negative, {mean:.3g} N: it would drive the motion. Check the "
            "sign of the position, the chambers and the areas.",
        )
        return
    load = case.bench.load
    remedy = (
        f"bench.json states {load.angle_deg:g}° and {load.force:g} N: are they right, sign of x "
        "included?"
        if load.angle_deg or load.force
        else "State it in bench.json: `load.angle_deg` of an inclined axis, or `load.force_N`."
    )
    force, weight = -result.derived["F_offset"].value, GRAVITY * result.parameters["M"].value
    for name, value in sides.items():
        if value < -_half(result, name):
            yield met(
                "friction has a force",
                "physics",
                f"{name} = {value:.3g} N is negative: "
                "the friction parameters contain a constant force, "
                f"of {force:+.4g} N in +x if friction is equal in both directions (weight of the "
                f"moving mass: {weight:.4g} N). {remedy}",
            )
