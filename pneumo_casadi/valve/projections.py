"""What figures 2 and 3 of the paper show, as arrays: projections of the map, residual map."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import FlowModel


@dataclass(frozen=True, slots=True, eq=False)
class ResidualMap:
    """Measured minus modelled flow over the map (Fig. 3).

    Parameters
    ----------
    u, p, residual : (n,) array
        Command [V], outlet pressure [Pa], residual [kg/s] of each point.
    q_max : float
        Greatest measured flow [kg/s].
    """

    u: FloatArray
    p: FloatArray
    residual: FloatArray
    q_max: float

    @property
    def rms_percent(self) -> float:
        """Root mean square of the residuals in per cent of the greatest flow."""
        return float(100 * np.sqrt(np.mean(self.residual**2)) / self.q_max)

    @property
    def max_percent(self) -> float:
        """Greatest residual in per cent of the greatest flow."""
        return float(100 * np.abs(self.residual).max() / self.q_max)


def map_residuals(table: FlowMap, model: FlowModel) -> ResidualMap:
    """Return the residuals of a model over a measured map (Fig. 3)."""
    return ResidualMap(table.u, table.p, model.residuals(table), table.q_max)


@dataclass(frozen=True, slots=True, eq=False)
class Projections:
    """The three projections of the static characteristics (Fig. 2).

    Parameters
    ----------
    u : (n_u,) array
        Commands [V].
    p : (n_p,) array
        Outlet pressures [Pa].
    q_m : (n_u, n_p) array
        Flow [kg/s]: row i over `p` is the flow characteristic at u[i], column j over `u` the
        flow gain characteristic at p[j].
    p_closed : (n_u,) array
        Pressure gain characteristic: the pressure [Pa] at which q_m = 0, that of a closed
        outlet. NaN where the flow does not vanish within the metered pressures.
    """

    u: FloatArray
    p: FloatArray
    q_m: FloatArray
    p_closed: FloatArray


def project_flow_map(table: FlowMap) -> Projections:
    """Return the three projections of a metered grid (Fig. 2).

    The zero of the flow is interpolated linearly between neighbouring pressures; where noise
    makes several, their mean is taken.

    Raises
    ------
    CaseError
        If the points are not a grid.

    Examples
    --------
    >>> table = FlowMap([-1, -1, 1, 1], [1e5, 7e5, 1e5, 7e5], [1e-4, -4e-3, 3e-3, -1e-3])
    >>> project_flow_map(table).p_closed.round(-3)
    array([115000., 550000.])
    """
    u, p, q_m = table.grid()
    p_closed = np.array([_zero(p, row) for row in q_m])
    return Projections(u, p, q_m, p_closed)


def _zero(p: FloatArray, q: FloatArray) -> float:
    exact = p[q == 0]
    change = np.flatnonzero(q[:-1] * q[1:] < 0)
    crossed = p[change] - q[change] * (p[change + 1] - p[change]) / (q[change + 1] - q[change])
    zeros = np.concatenate([exact, crossed])
    return float(zeros.mean()) if zeros.size else float("nan")
