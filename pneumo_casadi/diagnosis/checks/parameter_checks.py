"""Parameters held against geometry and data sheet: what a refit may hide shows there.

A refit takes up some effects whole. Trajectories then show no gap, but a piston area, a mass or
a friction comes out that the axis cannot have.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import hypot

from pneumo_casadi.data import Bench
from pneumo_casadi.diagnosis.checks.static_map import map_misfit_of
from pneumo_casadi.diagnosis.checks.static_map import map_pull_of as map_pull_of
from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.diagnosis.prepare.study import FittedModel, Study
from pneumo_casadi.estimation.output_error.result import FlowMapDeviation
from pneumo_casadi.identification.warnings import K_RANGE, MAP_SCALE
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect

#: Piston areas: bores of class H11 and rods of class f7 leave 0.5 to 1 %.
GEOMETRY = 0.01
#: Flow metering: 1 to 2 % of the reading.
METERING = 0.02
#: S_N/S_P: what the bore is wrong by cancels but for the rod's share, so does the flow meter, and
#: a fit to either chamber alone is within some tenths of a per cent.
RATIO = 0.01
#: Mass against the data sheet: screws, cables and sensors are rarely in it.
MASS = 0.05
#: Dead length over the stroke, up to: end cushion, ports and half a metre of hose.
DEAD_LENGTH = 0.25
#: k_P against k_N: both chambers breathe at the same pace through walls alike.
UNEQUAL_K = 0.25
#: k beyond isothermal and adiabatic, as a fit may miss it.
K_MARGIN = 0.02
#: Larger over smaller Coulomb friction, up to: seals differ between the directions (the paper's
#: axis, with nothing wrong: 23.8 N against 10.3 N).
FRICTION_RATIO = 4.0
#: Residuals of the flow map over those of its own fit, less one: forms that fit a map to some
#: tenths of a per cent leave a trajectory's weight that much freedom.
PULL = 0.5
#: Part of the flow map that its form cannot follow, smooth in pressure, over the greatest flow:
#: twice the scatter of good metering.
MAP_FORM = 2e-3
#: A fit's standard deviations count this often: rows overlap, and misfit is correlated.
SIGMAS = 6.0


@dataclass(frozen=True, slots=True)
class _Known:
    """A parameter vector by name, with its standard deviations."""

    values: Mapping[str, float]
    std: Mapping[str, float]

    def ratio(self, above: str, below: str) -> tuple[float, float]:
        value = self.values[above] / self.values[below]
        return value, abs(value) * hypot(self.relative(above), self.relative(below))

    def relative(self, name: str) -> float:
        return self.std.get(name, 0.0) / abs(self.values[name] or 1.0)


def check_fit(study: Study, fit: FittedModel, effects: Sequence[Effect] = ()) -> tuple[Check, ...]:
    """Check a fit with some effects: its parameters, what it did to the flow map, and the map."""
    pull, misfit = map_pull_of(study, fit.values, effects), map_misfit_of(study)
    parts = [f"{effect.name}.{name}" for effect in effects for name in effect.masses]
    values = dict(fit.values) | {"M": sum(fit.values[name] for name in ("M", *parts))}
    std = dict(fit.std) | {"M": hypot(*(fit.std.get(name, 0.0) for name in ("M", *parts)))}
    return check_parameters(study.axis, values, std, pull, misfit)


def check_parameters(
    axis: Axis,
    values: Mapping[str, float],
    std: Mapping[str, float],
    flow_map_deviation: FlowMapDeviation | None = None,
    map_misfit: float | None = None,
) -> tuple[Check, ...]:
    """Hold fitted parameters against what the bench and physics say of them.

    Parameters
    ----------
    axis : Axis
        Whose bench, with or without effects.
    values, std : mapping of str to float
        Parameters (eq. 9) and the standard deviations of the free ones; one that is not named
        was held.
    flow_map_deviation : FlowMapDeviation, optional
        What the fit did to the flow map; see `map_pull_of`.
    map_misfit : float, optional
        What the form of the flow map leaves; see `map_misfit_of`.

    Returns
    -------
    tuple of Check
        Those that make sense for this axis; ``agrees`` counts the tolerance and six standard
        deviations.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> found = check_parameters(axis, {"M": 95.0, "F_c_plus": 2.0, "F_c_minus": 22.0}, {})
    >>> [(check.name, check.agrees) for check in found]
    [('F_c', False)]
    >>> found[0].text
    'F_c⁺ − F_c⁻ = -20.0 N, a factor of 11 between the directions: seals hardly differ by more
    than 4; a load or tilt of 10.0 N in +x would look the same.'
    """
    known = _Known(values, std)
    checks: list[Check] = []
    if isinstance(axis.bench, Bench):  # its areas and volumes are checked
        checks += _areas(axis.bench, known)
        checks += _polytropic(known)
        checks += _volumes(axis.bench, known)
    checks += _mass(axis, known)
    checks += _friction(known)
    checks += _flow_map(flow_map_deviation)
    checks += _map_form(map_misfit)
    return tuple(checks)


def _within(
    name: str,
    estimate: tuple[float, float],
    expected: float,
    tolerance: float,
    unit: str,
    texts: tuple[str, str],
) -> Check:
    """Return a check with the text for agreement or for the opposite."""
    value, std = estimate
    agrees = abs(value - expected) <= tolerance + SIGMAS * std
    text = texts[0] if agrees else texts[1]
    return Check(name, value, std, expected, tolerance, unit, bool(agrees), text)


def _areas(bench: Bench, known: _Known) -> Iterator[Check]:
    rT = bench.r * bench.T
    off = {}
    for chamber, name in (("P", "X_s3"), ("N", "X_s6")):
        S = getattr(bench, f"S_{chamber}")
        value = known.values[name] * rT
        off[chamber] = value / S - 1
        text = f"S_{chamber} comes out {_percent(off[chamber])} against the bench"
        yield _within(
            f"S_{chamber}",
            (value, value * known.relative(name)),
            S,
            hypot(GEOMETRY, METERING) * S,
            "m2",
            (
                f"{text}: within metering and geometry.",
                f"{text}, more than flow metering (2 %) and geometry (1 %) allow: the valve "
                "passes another flow than it was metered to, its supply, the temperature or the "
                "area is another one, or a leak hides there.",
            ),
        )
    ratio = known.ratio("X_s6", "X_s3")
    expected = bench.S_N / bench.S_P
    relative = ratio[0] / expected - 1
    less = "less" if relative > 0 else "more"
    text = f"S_N/S_P comes out {_percent(relative)} against the bench"
    yield _within(
        "S_N/S_P",
        ratio,
        expected,
        RATIO * expected,
        "1",
        (
            f"{text}: both valves pass the same.",
            f"{text}, while the metering cancels in it: valve N passes "
            f"{100 * abs(1 / (1 + relative) - 1):.1f} % {less} than valve P at the same command "
            "and pressure, or one chamber leaks or has another supply.",
        ),
    )


def _polytropic(known: _Known) -> Iterator[Check]:
    low, high = K_RANGE
    k = {}
    for chamber, (below, above) in {"P": ("X_s2", "X_s3"), "N": ("X_s5", "X_s6")}.items():
        k[chamber] = value, _ = known.ratio(above, below)
        text = f"k_{chamber} = {value:.3f}"
        yield _within(
            f"k_{chamber}",
            k[chamber],
            (low + high) / 2,
            (high - low) / 2 + K_MARGIN,
            "1",
            (
                f"{text}: isothermal (1) to adiabatic (1.4), give or take what a fit misses.",
                f"{text} is outside {low:g} (isothermal) to {high:g} (adiabatic): a leak, heat "
                "or a sensor's lag hides in the chamber's parameters.",
            ),
        )
    difference = k["P"][0] - k["N"][0]
    text = f"k_P − k_N = {difference:+.3f}"
    yield _within(
        "k_P-k_N",
        (difference, hypot(k["P"][1], k["N"][1])),
        0.0,
        UNEQUAL_K,
        "1",
        (
            f"{text}: both chambers breathe alike.",
            f"{text}: the chambers should exchange heat alike; what differs between them hides "
            "in one of the two.",
        ),
    )


def _volumes(bench: Bench, known: _Known) -> Iterator[Check]:
    for chamber, (below, above) in {"P": ("X_s2", "X_s1"), "N": ("X_s5", "X_s4")}.items():
        length, std = known.ratio(above, below)
        dead = length - bench.stroke / 2
        V = dead * getattr(bench, f"S_{chamber}")
        text = (
            f"V_{chamber}(0) = S l/2 {'+' if V >= 0 else '−'} {abs(V) * 1e6:.0f} ml, a dead length "
            f"of {1e3 * dead:.0f} mm"
        )
        yield _within(
            f"V_{chamber}(0)",
            (dead, std),
            DEAD_LENGTH * bench.stroke / 2,
            DEAD_LENGTH * bench.stroke / 2,
            "m",
            (
                f"{text}: plausible.",
                f"{text} of {1e3 * bench.stroke:.0f} mm stroke: "
                + (
                    "hoses or a vessel add volume."
                    if dead > 0
                    else "the chamber cannot be smaller than its swept half."
                ),
            ),
        )


def _mass(axis: Axis, known: _Known) -> Iterator[Check]:
    sheet = axis.bench.datasheet.get("M_kg")
    if not sheet or "M" not in known.values:
        return
    M = known.values["M"]
    text = f"M = {M:.4g} kg, {_percent(M / sheet - 1)} against the data sheet"
    yield _within(
        "M",
        (M, known.std.get("M", 0.0)),
        sheet,
        MASS * sheet,
        "kg",
        (
            f"{text}.",
            f"{text}: a load that is fixed elastically, a spring, or late sensors hide there; or "
            "weigh the mass.",
        ),
    )


def _friction(known: _Known) -> Iterator[Check]:
    plus, minus = known.values["F_c_plus"], known.values["F_c_minus"]
    size = abs(plus) + abs(minus)
    if size == 0:
        return
    difference = plus - minus
    std = hypot(known.std.get("F_c_plus", 0.0), known.std.get("F_c_minus", 0.0))
    mean = max((plus + minus) / 2, 0.0)
    allowed = 2 * mean * (FRICTION_RATIO - 1) / (FRICTION_RATIO + 1)
    smaller, larger = min(plus, minus), max(plus, minus)
    load = (
        f"a load or tilt of {abs(difference) / 2:.1f} N in {'−' if difference > 0 else '+'}x would "
        "look the same"
    )
    how = (
        f"a factor of {larger / smaller:.0f} between the directions"
        if smaller > 0
        else "and one of them pushes along the motion"
    )
    text = f"F_c⁺ − F_c⁻ = {difference:.1f} N"
    yield _within(
        "F_c",
        (difference, std),
        0.0,
        allowed,
        "N",
        (
            f"{text}, as seals may differ; {load}, and no record of motion tells them apart.",
            f"{text}, {how}: seals hardly differ by more than {FRICTION_RATIO:g}; {load}.",
        ),
    )


def _flow_map(pull: FlowMapDeviation | None) -> Iterator[Check]:
    if pull is None:
        return
    text = f"The fit leaves {pull.rms:.2f} times the residual of the flow map's own fit"
    yield _within(
        "flow map",
        (pull.rms, 0.0),
        1.0,
        PULL,
        "1",
        (f"{text}.", f"{text}: trajectories and metered map disagree."),
    )
    if abs(pull.scale - 1) > MAP_SCALE:
        text = f"The fit moves the scale of the flow map by {_percent(pull.scale - 1)}"
        yield Check("flow scale", pull.scale, 0.0, 1.0, MAP_SCALE, "1", False, f"{text}.")


def _map_form(misfit: float | None) -> Iterator[Check]:
    if misfit is None:
        return
    text = f"The form of the flow map leaves {100 * misfit:.2f} % of the greatest flow"
    yield _within(
        "map form",
        (misfit, 0.0),
        0.0,
        MAP_FORM,
        "1",
        (
            f"{text} that is smooth in pressure.",
            f"{text} that is smooth in pressure: the opening is not in proportion to the command "
            "(a notched or rounded edge); take a spline for the map.",
        ),
    )


def _percent(share: float) -> str:
    return f"{100 * share:+.1f} %"
