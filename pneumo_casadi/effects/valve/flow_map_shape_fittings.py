"""Flow map shape that fittings change: other critical ratios than on the metering bench."""

import casadi as ca

from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Expression, Pair
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve.orifice import LAMINAR_RATIO, orifice_expression

#: Critical ratio from which β counts, and subsonic index: those of small spool valves with their
#: fittings, about.
CRITICAL, INDEX = 0.3, 0.5


class FlowMapShapeFittings(Effect):
    """Supply edges whose flow falls off later, or sooner, than on the bench that metered them.

    Fittings and tubes in series with an edge lower the ratio of pressures b up to which it is
    choked. After ISO 6358,

    q −→ q ω(r, b + β)/ω(r, b), ω² = 1 − (max(r − b, 0)/(1 − b))², r = p/p_supply, b = 0.3,

    where a chamber fills. Flow that is choked with either ratio stays as it was metered. The
    ratio of the metered valve itself is not known here: if it is 0.2 or 0.4 in place of 0.3, β
    comes out a quarter too small or hardly changed. The droop of a supply and the pressure drop
    along a hose are not followed. Exhaust edges are choked above 2.5 to 5 bar; what restricts them
    at less is `ExhaustRestriction`.
    """

    name = "flow_map_shape_fittings"
    cause = "flow_map_shape"
    equation = "q_m −→ q_m ω(p/p_supply, b + β)/ω(p/p_supply, b) for q_m > 0"
    source = "subsonic flow of ISO 6358-1:2013"
    shows = "both mass flow balances where chambers fill at little pressure across the edge"
    confused_with = (
        "supply_droop",
        "pressure_sensor_bias",
        "valve_mismatch",
        "valve_null_shift",
        "flow coefficients",
    )
    separated_by = "meter the valve with the fittings and tubes of the axis"
    parameters = (
        Parameter(
            "beta",
            0.0,
            "1",
            lower=-0.3,
            upper=0.5,
            scale=0.05,
            null=0.0,
            start=0.05,
            description="excess of the critical ratio of supply edges over that metered, if 0.3",
            source="b = 0.2 with fittings to 0.5 without, data sheets of small spool valves",
        ),
    )

    def valve_flow(self, q_m: Pair, at: Scope) -> Pair:
        """Let subsonic flow fall off at another ratio."""
        return Pair(*(_other_ratio(q, p, at) for q, p in zip(q_m, at.p, strict=True)))


def _other_ratio(q: Expression, p: Expression, at: Scope) -> Expression:
    r = ca.fmin(p / at.axis["p_supply"], LAMINAR_RATIO)  # beyond it, ω tends to zero
    metered, fitted = (
        orifice_expression(1.0, b, INDEX, 1.0, r) for b in (CRITICAL, CRITICAL + at["beta"])
    )
    return q + (fitted / metered - 1) * ca.fmax(q, 0.0)
