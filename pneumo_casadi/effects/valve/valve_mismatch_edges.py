"""Valve mismatch of which a part differs from one control edge to the other."""

from types import MappingProxyType

import casadi as ca

from pneumo_casadi.effects.valve.valve_mismatch import SEPARATED_BY, SOURCE
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.parameters import Parameter


class ValveMismatchEdges(Effect):
    """Valve N opens (1 + δ/2) times as far as valve P to the supply, (1 − δ/2) to the exhaust.

    What both edges have in common is absorbed by X_s4 to X_s6 of chamber N, see `ValveMismatch`:
    this is what trajectories show of it.
    """

    name = "valve_mismatch_edges"
    cause = "valve_mismatch"
    equation = "u_N −→ u_N + δ |u_N|/2"
    source = SOURCE
    shows = "mass flow balance of chamber N, in proportion to the opening; X_s6 against S_N/(r T)"
    confused_with = ("valve_null_shift", "pressure_sensor_bias", "flow_map_shape", "leakage_N")
    separated_by = SEPARATED_BY
    # Edges of one spool differ less than two valves do.
    credible = MappingProxyType({"delta": (-0.3, 0.3)})
    parameters = (
        Parameter(
            "delta",
            0.0,
            "1",
            lower=-0.5,
            upper=0.5,
            scale=0.02,
            null=0.0,
            start=0.02,
            description="relative excess of the supply edge of valve N over its exhaust edge",
            source="a part of the 2-10 % between valves of one type, engineering judgement",
        ),
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Open valve N further one way than the other."""
        return Pair(u.P, u.N + at["delta"] / 2 * ca.fabs(u.N))
