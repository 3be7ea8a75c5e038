"""Fitted parameters compared with geometry and data sheet.

A refit may absorb an effect completely. Trajectories then show no gap, but a piston area, a mass or
a friction is implausible.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, sqrt

from pneumo_casadi.data import Bench
from pneumo_casadi.diagnosis.checks.static_map import map_deviation, map_misfit
from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.diagnosis.metrics.residual_size import MASS
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.wording import check_texts as texts
from pneumo_casadi.estimation.flow_scale import flow_factors, flow_scale_std
from pneumo_casadi.estimation.output_error.result import FlowMapDeviation, OutputErrorResult
from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.warnings.grading import K_RANGE, LIMITS
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect

#: Piston areas: tolerance H11 of the bore and f7 of the rod give 0.5 to 1 %.
GEOMETRY = 0.01
#: Flow metering: 1 to 2 % of the reading; a stated accuracy counts where it is larger.
METERING = 0.02
#: S_N/S_P: errors of the bore cancel except for the rod's share, those of one flow meter cancel
#: entirely; a fit to either chamber alone is within some tenths of a per cent.
RATIO = 0.01
#: Largest dead length over the stroke: end cushion, ports and half a metre of hose.
DEAD_LENGTH = 0.25
#: k_P against k_N: both chambers change volume at the same rate between similar walls.
UNEQUAL_K = 0.25
#: Error of a fitted k, allowed beyond isothermal and adiabatic.
K_MARGIN = 0.02
#: Largest ratio of the Coulomb frictions in both directions, from differing seals (the paper's
#: axis without an effect: 23.8 N and 10.3 N).
FRICTION_RATIO = 4.0
#: Largest residual of the flow map over that of its own fit, less one. Trajectories may move the
#: map that far, since its form fits it to some tenths of a per cent only.
MAX_EXCESS_RESIDUAL = 0.5
#: Largest part of the flow map that its form cannot follow, smooth in pressure, over the greatest
#: flow: twice the scatter of good metering.
MAP_FORM = 2e-3
#: Multiple of a fit's standard deviations, which are too small: rows overlap, and misfit is
#: correlated.
SIGMAS = 6.0


@dataclass(frozen=True, slots=True)
class _Known:
    """A parameter vector by name, with its standard deviations.

    X_s1 ... X_s6 have the unknown factors of the flows, whose standard deviations `scales` are
    relative, by parameter. Estimates are told without them: they belong to the bench, not to the
    fit, and count in the tolerance of what they move.
    """

    values: Mapping[str, float]
    std: Mapping[str, float]
    scales: Mapping[str, float]

    def ratio(self, above: str, below: str) -> tuple[float, float]:
        value = self.values[above] / self.values[below]
        return value, abs(value) * hypot(self.relative(above), self.relative(below))

    def relative(self, name: str) -> float:
        """Return what a fit does not tell of a parameter, relative to it."""
        whole = self.std.get(name, 0.0) / abs(self.values[name] or 1.0)
        return sqrt(max(whole**2 - self.scales.get(name, 0.0) ** 2, 0.0))


def check_fit(study: Study, fit: FittedModel, effects: Sequence[Effect] = ()) -> tuple[Check, ...]:
    """Check the parameters of a fit, how it changed the flow map, and the map's own fit."""
    deviation, misfit = map_deviation(study, fit.values, effects), map_misfit(study)
    parts = [f"{effect.name}.{name}" for effect in effects for name in effect.masses]
    values = dict(fit.values) | {"M": sum(fit.values[name] for name in ("M", *parts))}
    std = dict(fit.std) | {"M": hypot(*(fit.std.get(name, 0.0) for name in ("M", *parts)))}
    return check_parameters(study.axis, values, std, deviation, misfit)


def check_output_error(
    result: OutputErrorResult, flow_map_misfit: float | None = None
) -> tuple[Check, ...]:
    """Check the parameters of a fit by output error, and how it changed the flow map.

    Standard deviations are the wider of those for white residuals and the robust ones; a parameter
    without one counts as held.

    Parameters
    ----------
    result : OutputErrorResult
        The fit, with or without effects.
    flow_map_misfit : float, optional
        Part of the flow map that its form cannot follow; see `static_map.map_misfit`.
    """
    values = {item.name: item.value for item in result.parameters}
    std = {
        name: max(result.std(name), result.std(name, robust=True))
        for name in values
        if result.status_of(name) is EstimateStatus.ESTIMATED
    }
    parts = [f"{each.name}.{name}" for each in result.axis.effects for name in each.masses]
    values |= {"M": sum(values[name] for name in ("M", *parts))}
    std |= {"M": result.std_of_sum({name: 1.0 for name in ("M", *parts) if name in std})}
    return check_parameters(result.axis, values, std, result.flow_map_deviation, flow_map_misfit)


def check_parameters(
    axis: Axis,
    values: Mapping[str, float],
    std: Mapping[str, float],
    flow_map_deviation: FlowMapDeviation | None = None,
    flow_map_misfit: float | None = None,
) -> tuple[Check, ...]:
    """Compare fitted parameters with bench, data sheet and physical limits.

    Parameters
    ----------
    axis : Axis
        Axis with its bench, with or without effects.
    values, std : mapping of str to float
        Parameters (eq. 9), and standard deviations of the free ones; the others were held.
    flow_map_deviation : FlowMapDeviation, optional
        How the fit changed the flow map; see `map_deviation`.
    flow_map_misfit : float, optional
        Part of the flow map that its form cannot follow; see `static_map.map_misfit`.

    Returns
    -------
    tuple of Check
        Those that apply to this axis; a value agrees within its tolerance plus six standard
        deviations.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> checks = check_parameters(axis, {"M": 95.0, "F_c_plus": 2.0, "F_c_minus": 22.0}, {})
    >>> [(check.name, check.agrees) for check in checks]
    [('F_c', False)]
    >>> checks[0].text
    'F_c⁺ − F_c⁻ = -20.0 N, a factor of 11 between the directions: seals hardly differ by more
    than 4; a load or tilt of 10.0 N in +x would look the same.'
    """
    scale_std = flow_scale_std(axis)
    scales = {f"X_s{i}": scale_std["P" if i <= 3 else "N"] for i in range(1, 7)}
    known = _Known(values, std, scales)
    checks: list[Check] = []
    if isinstance(axis.bench, Bench):  # its areas and volumes are checked
        factors = flow_factors(axis)
        between = hypot(*factors.values()) if len(factors) > 1 else 0.0  # one meter cancels
        checks += _areas(axis.bench, known, between)
        checks += _polytropic(known)
        checks += _volumes(axis.bench, known)
    checks += _mass(axis, known)
    checks += _friction(known)
    checks += _flow_map(flow_map_deviation)
    checks += _map_form(flow_map_misfit)
    return tuple(checks)


def _within(
    name: str,
    estimate: tuple[float, float],
    expected: float,
    tolerance: float,
    unit: str,
    either: texts.Texts,
    gross: bool = False,
) -> Check:
    """Return a check with the text for agreement or for the opposite.

    `gross` marks a range that excludes gross errors only. Neither decides anything by agreeing:
    such a range, and an estimate with more allowed for its error than the range is wide.
    """
    value, std = estimate
    agrees = abs(value - expected) <= tolerance + SIGMAS * std
    text = either[0] if agrees else either[1]
    decisive = not gross and SIGMAS * std <= tolerance
    return Check(name, value, std, expected, tolerance, unit, bool(agrees), text, bool(decisive))


def _areas(bench: Bench, known: _Known, between: float) -> Iterator[Check]:
    """Yield the areas and their ratio; two meters differ by `between`, relative."""
    rT = bench.r * bench.T
    for chamber, name in (("P", "X_s3"), ("N", "X_s6")):
        S = getattr(bench, f"S_{chamber}")
        value = known.values[name] * rT
        yield _within(
            f"S_{chamber}",
            (value, value * known.relative(name)),
            S,
            hypot(GEOMETRY, max(METERING, known.scales[name])) * S,
            "m2",
            texts.area_texts(chamber, value / S - 1),
        )
    ratio = known.ratio("X_s6", "X_s3")
    expected = bench.S_N / bench.S_P
    deviation = ratio[0] / expected - 1
    allowed = hypot(RATIO, between) * expected
    yield _within("S_N/S_P", ratio, expected, allowed, "1", texts.area_ratio_texts(deviation))


def _polytropic(known: _Known) -> Iterator[Check]:
    low, high = K_RANGE
    k = {}
    for chamber, (below, above) in {"P": ("X_s2", "X_s3"), "N": ("X_s5", "X_s6")}.items():
        k[chamber] = known.ratio(above, below)
        yield _within(
            f"k_{chamber}",
            k[chamber],
            (low + high) / 2,
            (high - low) / 2 + K_MARGIN,
            "1",
            texts.polytropic_texts(chamber, k[chamber][0], K_RANGE),
        )
    difference = k["P"][0] - k["N"][0]
    yield _within(
        "k_P-k_N",
        (difference, hypot(k["P"][1], k["N"][1])),
        0.0,
        UNEQUAL_K,
        "1",
        texts.polytropic_difference_texts(difference),
        gross=True,
    )


def _volumes(bench: Bench, known: _Known) -> Iterator[Check]:
    for chamber, (below, above) in {"P": ("X_s2", "X_s1"), "N": ("X_s5", "X_s4")}.items():
        length, std = known.ratio(above, below)
        dead = length - bench.stroke / 2
        V = dead * getattr(bench, f"S_{chamber}")
        yield _within(
            f"V_{chamber}(0)",
            (dead, std),
            DEAD_LENGTH * bench.stroke / 2,
            DEAD_LENGTH * bench.stroke / 2,
            "m",
            texts.volume_texts(chamber, V, dead, bench.stroke),
            gross=True,
        )


def _mass(axis: Axis, known: _Known) -> Iterator[Check]:
    sheet = axis.bench.datasheet.get("M_kg")
    if not sheet or "M" not in known.values:
        return
    estimate = known.values["M"], known.std.get("M", 0.0)
    yield _within("M", estimate, sheet, MASS * sheet, "kg", texts.mass_texts(estimate[0], sheet))


def _friction(known: _Known) -> Iterator[Check]:
    plus, minus = known.values["F_c_plus"], known.values["F_c_minus"]
    if plus == minus == 0:
        return
    std = hypot(known.std.get("F_c_plus", 0.0), known.std.get("F_c_minus", 0.0))
    mean = max((plus + minus) / 2, 0.0)
    yield _within(
        "F_c",
        (plus - minus, std),
        0.0,
        2 * mean * (FRICTION_RATIO - 1) / (FRICTION_RATIO + 1),
        "N",
        texts.friction_texts(plus, minus, FRICTION_RATIO),
        gross=True,
    )


def _flow_map(deviation: FlowMapDeviation | None) -> Iterator[Check]:
    if deviation is None:
        return
    rms, scale = deviation.rms, deviation.scale
    yield _within("flow map", (rms, 0.0), 1.0, MAX_EXCESS_RESIDUAL, "1", texts.flow_map_texts(rms))
    limit = LIMITS["map scale"].caution
    if abs(scale - 1) > limit:
        text = texts.flow_scale_text(scale)
        yield Check("flow scale", scale, 0.0, 1.0, limit, "1", False, text)


def _map_form(misfit: float | None) -> Iterator[Check]:
    if misfit is not None:
        estimate = misfit, 0.0
        yield _within("map form", estimate, 0.0, MAP_FORM, "1", texts.map_form_texts(misfit))
