"""A three-way valve of two ISO 6358 restrictions: supply to outlet and outlet to exhaust."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.presentation import Brief
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import KEPT, Symbol, scale_sigma, whole
from pneumo_casadi.valve.opening import (
    SIDES,
    SUPPLY_RATIO,
    conductance,
    known_before,
    reach_of,
)
from pneumo_casadi.valve.orifice import (
    LAMINAR_RATIO,
    T_ANR,
    orifice_expression,
)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FlowISO6358(Brief):
    r"""Mass flow of a spool valve whose two edges are ISO 6358 restrictions.

    q_m = q(C_s(u), b_s, m; p_supply → p) − q(C_e(−u), b_e, m; p → p_ext), with the opening law

    .. math:: C(u) = C_{leak} + k s / (1 + h s), \quad
              s = (u - u_0 + \sqrt{(u - u_0)^2 + w^2}) / 2

    or, where an edge has ports of another shape, with a curve of five slopes,

    .. math:: C(u) = C_{leak} + \int_0^s k(s') ds'

    Parameters
    ----------
    parameters : Parameters
        For each edge, ``_supply`` and ``_exhaust``: conductance gain k [m³/(s Pa V)], command
        at which the edge opens u_0 [V] (positive: overlap, negative: underlap), clearance
        rounding w [V], saturation h [1/V], leakage C_leak [m³/(s Pa)], critical ratio b [1];
        and the subsonic index m [1] of both. A curve has in place of k and h the gains
        k_1 … k_5 at openings of 0, 5, 15, 40 and 100 % of the largest command of its sign, between
        which its slope is linear; and the ratio of the supply pressure to the stated one,
        ``supply_ratio``.
    covariance : (n, n) array
        Covariance; infinite variance where a parameter stands at its bound (`at_bound`).
    sigma : float
        Standard deviation of the residuals [kg/s].
    p_range, u_range : tuple of float
        Outlet pressures [Pa] and commands [V] that were metered.
    p_supply, p_ext : float
        Absolute supply and exhaust pressures that `expression` assumes unless told otherwise
        [Pa].
    T : float
        Temperature upstream of either edge [K].
    laminar_ratio : float
        Pressure ratio above which the flow gets a finite slope, see `orifice_expression`.

    Notes
    -----
    C grows with u everywhere, so that q_m does; on the closed side s falls off as w²/4|u − u_0|,
    as clearance leakage does along the overlap. Being physics, the map needs no continuation:
    it holds beyond the supply pressure and below the exhaust pressure, and at other supplies.
    """

    symbol: ClassVar[Symbol] = "SX"

    parameters: Parameters
    covariance: FloatArray
    sigma: float
    p_range: tuple[float, float]
    u_range: tuple[float, float]
    p_supply: float
    p_ext: float
    T: float = T_ANR
    laminar_ratio: float = LAMINAR_RATIO

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, dtype=float)
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)

    def expression(
        self, u: Any, p: Any, theta: Any, p_supply: Any = None, p_ext: Any = None
    ) -> Any:
        """Return q_m [kg/s] for CasADi scalars u [V], p [Pa] and the vector theta (n,).

        `p_supply` and `p_ext` [Pa] may be expressions too; by default those of the map.
        """
        p_supply = self.p_supply if p_supply is None else p_supply
        p_ext = self.p_ext if p_ext is None else p_ext
        return _law(self._kind)(u, p, whole(theta, len(self.parameters)), p_supply, p_ext)

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        """Return q_m [kg/s] with supply and exhaust at these ratios to the map's pressures."""
        return self.expression(u, p, theta, self.p_supply * filling, self.p_ext * emptying)

    def __call__(self, u: ArrayLike, p: ArrayLike, p_supply: ArrayLike | None = None) -> FloatArray:
        """Return q_m [kg/s] at the fitted parameters; u [V], p [Pa], p_supply [Pa] broadcast."""
        supply = self.p_supply if p_supply is None else p_supply
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (u, p, supply)))
        if not arrays[0].size:
            return np.zeros(arrays[0].shape)
        q = self.flow_and_slopes(self.parameters.values, arrays)[0]
        return q.reshape(arrays[0].shape)

    def flow_and_slopes(self, theta: FloatArray, points: Any) -> tuple[FloatArray, FloatArray]:
        """Return q_m [kg/s] and ∂q_m/∂θ at points (u, p, p_supply) of n values each."""
        u, p, p_supply = (np.asarray(a, dtype=float).reshape(1, -1) for a in points)
        # What is that of each point is given once: CasADi repeats it.
        q, jacobian = _with_slopes(self._kind)(u, p, theta, p_supply, self.p_ext)
        return np.asarray(q)[0], np.asarray(jacobian)

    def residuals(self, table: FlowMap) -> FloatArray:
        """Return measured minus modelled flow [kg/s], shape (n,), at the table's supply."""
        return table.q_m - self(table.u, table.p, table.p_supply)

    def with_theta(self, theta: ArrayLike) -> "FlowISO6358":
        """Return a copy with other parameters, shape (n,)."""
        return replace(self, parameters=self.parameters.with_values(theta))

    @property
    def _kind(self) -> "_Kind":
        reach = reach_of(self.u_range)
        return _Kind(self.parameters.names, reach, self.T, self.laminar_ratio)

    @property
    def scale_sigma(self) -> float:
        """Relative standard deviation of the flow scale: of all conductances together."""
        conductance = [name.startswith(("k_", "C_leak_")) for name in self.parameters.names]
        direction = np.where(conductance, self.parameters.values, 0.0)
        return scale_sigma(direction, self.covariance, self.parameters.scales)

    @property
    def prior_std(self) -> dict[str, float]:
        """Standard deviations of what is known of parameters beside the map, about their values.

        Of the slopes of a curve, which are like those of the hyperbola where few commands tell
        them, and of the supply pressure. A recorded supply is taken to be shown by the same gauge.
        """
        return known_before(self.parameters)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of the parameters that the fit left at a bound: their variance is infinite."""
        infinite = np.isinf(np.diag(self.covariance))
        return tuple(name for name, bad in zip(self.parameters.names, infinite, strict=True) if bad)


class _Kind(NamedTuple):
    """What tells the function of one valve from that of another."""

    names: tuple[str, ...]
    reach: tuple[float, float]
    T: float
    laminar_ratio: float


@lru_cache(maxsize=KEPT)
def _law(kind: _Kind) -> ca.Function:
    """Return ``(u, p, θ, p_supply, p_ext) -> q_m``."""
    u, p, p_supply, p_ext = (ca.SX.sym(name) for name in ("u", "p", "p_supply", "p_ext"))
    theta = ca.SX.sym("theta", len(kind.names))
    at = dict(zip(kind.names, ca.vertsplit(theta), strict=True))
    C_s, C_e = (
        conductance(at, side, command, reach)
        for side, reach, command in zip(SIDES, kind.reach, (u, -u), strict=True)
    )
    law = {"T": kind.T, "laminar_ratio": kind.laminar_ratio}
    supply = p_supply * at[SUPPLY_RATIO] if SUPPLY_RATIO in at else p_supply
    inlet = orifice_expression(C_s, at["b_supply"], at["m"], supply, p, **law)
    outlet = orifice_expression(C_e, at["b_exhaust"], at["m"], p, p_ext, **law)
    return ca.Function("q_m", [u, p, theta, p_supply, p_ext], [inlet - outlet])


@lru_cache(maxsize=KEPT)
def _with_slopes(kind: _Kind) -> ca.Function:
    """Return ``(u, p, θ, p_supply, p_ext) -> (q_m, ∂q_m/∂θ (n, 1))``."""
    law = _law(kind)
    given = law.sx_in()
    q_m = law(*given)
    return ca.Function("q_m_slopes", given, [q_m, ca.jacobian(q_m, given[2]).T])
