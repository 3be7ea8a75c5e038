"""Two valves that differ, each with a map and a flow model of its own."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Brief
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import FlowModel


class FlowMapPair(NamedTuple):
    """The measured maps of the valves of chambers P and N."""

    P: FlowMap
    N: FlowMap

    @property
    def p_range(self) -> tuple[float, float]:
        """Outlet pressures that both maps cover [Pa]."""
        return _common(self.P.p_range, self.N.p_range)

    @property
    def u_range(self) -> tuple[float, float]:
        """Commands that both maps cover [V]."""
        return _common(self.P.u_range, self.N.u_range)

    @property
    def u(self) -> FloatArray:
        """Commands of all points [V]."""
        return np.concatenate([self.P.u, self.N.u])

    @property
    def q_max(self) -> float:
        """Greatest flow [kg/s]."""
        return max(self.P.q_max, self.N.q_max)


@dataclass(frozen=True, eq=False, repr=False)
class FlowPair(Brief):
    """The flow models of two valves that differ.

    Parameters
    ----------
    P, N : FlowModel
        Of the valves of chambers P and N. Their parameters stand one after the other in
        `parameters`, with ``_P`` and ``_N`` at the end of their names.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> flow = pc.valve.fit_polynomials(pc.valve.read_flow_map(case.flow_map_path), (1, 1, 1))
    >>> pair = FlowPair(flow, flow)
    >>> pair.parameters.names[0], len(pair.parameters) == 2 * len(flow.parameters)
    ('phi_0_P', True)
    """

    P: Any
    N: Any

    @property
    def u_range(self) -> tuple[float, float]:
        """Commands that one map or the other covers [V]."""
        (low, high), (low_N, high_N) = self.P.u_range, self.N.u_range
        return min(low, low_N), max(high, high_N)

    @property
    def symbol(self) -> str:
        """CasADi type in which both can be written."""
        return "MX" if "MX" in (self.P.symbol, self.N.symbol) else "SX"

    @property
    def parameters(self) -> Parameters:
        """Those of both models."""
        return Parameters(
            replace(item, name=f"{item.name}_{chamber}")
            for chamber in ("P", "N")
            for item in getattr(self, chamber).parameters
        )

    @property
    def covariance(self) -> FloatArray:
        """Covariance of all parameters, (n, n)."""
        matrix: FloatArray = block_diag(self.P.covariance, self.N.covariance)
        return matrix

    @property
    def sigma(self) -> float:
        """The larger of both standard deviations of the residuals [kg/s]."""
        return max(float(self.P.sigma), float(self.N.sigma))

    @property
    def p_range(self) -> tuple[float, float]:
        """Outlet pressures that both models cover [Pa]."""
        return _common(self.P.p_range, self.N.p_range)

    def rows(self, chamber: str) -> slice:
        """Return where the parameters of a chamber's valve stand."""
        first = len(self.P.parameters)
        return slice(0, first) if chamber == "P" else slice(first, None)


#: One measured map for both valves, or one for each.
AnyFlowMap = FlowMap | FlowMapPair
#: One form of the flow for both valves, or one for each.
AnyFlowModel = FlowModel | FlowPair


def valve_of(flow: Any, chamber: str) -> tuple[Any, slice]:
    """Return the flow model of a chamber's valve, and where its parameters stand."""
    if isinstance(flow, FlowPair):
        return getattr(flow, chamber), flow.rows(chamber)
    return flow, slice(None)


def each_valve(table: AnyFlowMap, flow: AnyFlowModel) -> dict[str, tuple[FlowMap, FlowModel]]:
    """Return map and model of each valve that was metered.

    Parameters
    ----------
    table : FlowMap or FlowMapPair
        The measured map, or both.
    flow : FlowModel or FlowPair
        The model fitted to it, or both.

    Returns
    -------
    dict
        By what a title adds to name the valve: nothing where one map serves both.
    """
    if isinstance(table, FlowMapPair) and isinstance(flow, FlowPair):
        return {
            f" of chamber {chamber}'s valve": (getattr(table, chamber), getattr(flow, chamber))
            for chamber in ("P", "N")
        }
    assert isinstance(table, FlowMap) and not isinstance(flow, FlowPair)
    return {"": (table, flow)}


def _common(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return max(a[0], b[0]), min(a[1], b[1])
