"""Valve mismatch: the two valves are not identical."""

from types import MappingProxyType

from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.effect import Effect, Scope
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.parameters import Parameter

SOURCE = "scatter of spool amplifiers and port windows, data sheets"
SEPARATED_BY = "geometry: X_s6 = S_N/(r T); or meter both valves, or swap them"


class ValveMismatch(Effect):
    """Valve N opens (1 + ε) times as far as valve P at the same command.

    The flow map is metered on one valve. All but the leakage φ of the other is absorbed by that
    chamber's X_s4 to X_s6, all by the factor 1/(1 + ε): trajectories hardly show it, X_s6
    against S_N/(r T) does. Hold X_s6 (or X_s4 to X_s6) to see it in a fit.
    """

    name = "valve_mismatch"
    absorbed_by = Absorption(("S_N/S_P",))
    equation = "u_N −→ (1 + ε) u_N"
    source = SOURCE
    shows = "not in trajectories: X_s4 to X_s6 move together, X_s6 departs from S_N/(r T)"
    confused_with = ("X_s4", "X_s5", "X_s6", "flow_map_shape")
    separated_by = SEPARATED_BY
    # Twins of one type: half the flow is no mismatch, but a fit that runs to its bound.
    credible = MappingProxyType({"epsilon": (-0.4, 0.6)})
    one_form = True
    parameters = (
        Parameter(
            "epsilon",
            0.0,
            "1",
            lower=-0.5,
            upper=1.0,
            scale=0.05,
            null=0.0,
            start=0.05,
            description="relative excess of the opening of valve N",
            source="2-10 % between valves of one type",
        ),
    )

    def spool(self, u: Pair, at: Scope) -> Pair:
        """Open valve N further."""
        return Pair(u.P, (1 + at["epsilon"]) * u.N)
