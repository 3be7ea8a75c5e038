"""What every flow model offers: the interface that the servosystem is written against."""

import logging
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.orifice import RHO_ANR, T_ANR, orifice_expression

Symbol = Literal["SX", "MX"]

#: Critical pressure ratio of the edges of a closed valve.
B_LEAKAGE = 0.3

#: Laws of flow that a process keeps. Written down once and called, a law costs a fiftieth of what
#: writing it into every model would: hundreds are made where forms and effects compete.
KEPT = 64

logger = logging.getLogger(__name__)


class FlowModel(Protocol):
    """Mass flow q_m(u, p) [kg/s] of a valve as a function of parameters theta.

    Attributes
    ----------
    symbol : {"SX", "MX"}
        CasADi type that `expression` can be written in; "SX" serves both.
    parameters : Parameters
        The fitted theta, in the order in which `expression` takes it.
    covariance : (n, n) array
        Covariance of theta.
    sigma : float
        Standard deviation of the residuals of the fit [kg/s].
    p_range : tuple of float
        Outlet pressures that were metered [Pa]; outside, the map is continued.
    """

    symbol: ClassVar[Symbol]

    @property
    def parameters(self) -> Parameters: ...  # noqa: D102

    @property
    def covariance(self) -> FloatArray: ...  # noqa: D102

    @property
    def sigma(self) -> float: ...  # noqa: D102

    @property
    def p_range(self) -> tuple[float, float]: ...  # noqa: D102

    @property
    def scale_sigma(self) -> float:
        """Relative standard deviation of the overall flow scale (the gauge), from the scatter."""
        ...

    def expression(self, u: Any, p: Any, theta: Any) -> Any:
        """Return q_m [kg/s] for CasADi scalars u [V], p [Pa] and a vector theta."""
        ...

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        """Return q_m [kg/s] where the ports are not at the pressures that the map was metered at.

        `filling` and `emptying` are supply and exhaust pressure over those of the map [1]. At
        (1, 1) it is `expression`, and it is continuous in u, as every valve is.
        """
        ...

    def __call__(self, u: ArrayLike, p: ArrayLike) -> FloatArray:
        """Return q_m [kg/s] at the fitted parameters; u and p broadcast."""
        ...

    def residuals(self, table: FlowMap) -> FloatArray:
        """Return measured minus modelled flow [kg/s], shape (n,)."""
        ...


def whole(theta: Any, size: int) -> Any:
    """Return the parameters of a law; those of another size CasADi might repeat, or leave out.

    Raises
    ------
    ModelError
        If they are not of this size.
    """
    if theta.shape[0] != size:
        raise ModelError(f"theta has shape {theta.shape}, expected {size} parameters")
    return theta


def leakage_change(
    leakage: tuple[Any, Any], p: Any, p_range: tuple[float, float], filling: Any, emptying: Any
) -> Any:
    """Return what other port pressures add to the flow of a closed valve [kg/s].

    It comes in past the supply edge and goes out past the exhaust edge, but a map shows only the
    sum. Where the outlet is at the exhaust pressure nothing goes out, where it is at the supply
    pressure nothing comes in: these two flows give the two edges, which are taken to follow
    ISO 6358 from there.

    Parameters
    ----------
    leakage : tuple of expression
        Metered flow at u = 0 at either end of `p_range` [kg/s].
    p : expression
        Outlet pressure [Pa].
    p_range : tuple of float
        Metered outlet pressures, from exhaust to supply [Pa].
    filling, emptying : expression
        Supply and exhaust pressure over those of the map [1].
    """
    p_ext, p_supply = p_range
    supply_edge, exhaust_edge = leakage[0] / p_supply, -leakage[1] / p_supply

    def through(p_1: Any, p_2: Any) -> Any:
        return orifice_expression(1 / RHO_ANR, B_LEAKAGE, 0.5, p_1, p_2)

    inlet = through(filling * p_supply, p) - through(p_supply, p)
    exhaust = through(p, emptying * p_ext) - through(p, p_ext)
    return supply_edge * inlet - exhaust_edge * exhaust


def scale_sigma(direction: FloatArray, covariance: FloatArray, scales: FloatArray) -> float:
    """Return the relative standard deviation of the flow scale, (gᵀ C⁻¹ g)^(-1/2).

    Parameters
    ----------
    direction : (n,) array
        g = dθ/d ln(scale): the parameters that a common factor of all flows multiplies, zero
        for the others.
    covariance : (n, n) array
        C; parameters of infinite variance (at a bound) are left out.
    scales : (n,) array
        Sizes of the parameters, for conditioning.
    """
    known = np.isfinite(np.diag(covariance))
    size = scales[known]
    C = covariance[np.ix_(known, known)] / np.outer(size, size)
    if not np.any(C):  # a map met exactly
        return 0.0
    g = direction[known] / size
    return float(1.0 / np.sqrt(g @ np.linalg.solve(C, g)))


def flow_function(model: FlowModel) -> ca.Function:
    """Return the CasADi function (u, p, theta) -> q_m of a flow model.

    Parameters
    ----------
    model : FlowModel
        Any flow model.

    Returns
    -------
    casadi.Function
        Takes scalars u [V] and p [Pa] (rows of numbers are mapped) and theta (n,).
    """
    symbols: Any = ca.SX if model.symbol == "SX" else ca.MX
    u, p = symbols.sym("u"), symbols.sym("p")
    theta = symbols.sym("theta", len(model.parameters))
    return ca.Function(
        "q_m", [u, p, theta], [model.expression(u, p, theta)], ["u", "p", "theta"], ["q_m"]
    )


def evaluate(function: ca.Function, u: ArrayLike, p: ArrayLike, theta: FloatArray) -> FloatArray:
    """Evaluate a function of `flow_function` on arrays u [V] and p [Pa] that broadcast."""
    u_all, p_all = np.broadcast_arrays(np.asarray(u, dtype=float), np.asarray(p, dtype=float))
    if not u_all.size:
        return np.zeros(u_all.shape)
    columns = np.repeat(theta.reshape(-1, 1), u_all.size, axis=1)
    flows = function(u_all.reshape(1, -1), p_all.reshape(1, -1), columns)
    return np.asarray(flows, dtype=float).reshape(u_all.shape)


@dataclass(frozen=True, slots=True)
class SonicConductances:
    """Sonic conductances of the two edges of a valve (ISO 6358-1), ANR [m³/(s Pa)].

    Parameters
    ----------
    fill, exhaust : float
        Of the edge from the supply, and of the edge to the exhaust.
    u_fill, u_exhaust : float
        Commands at which they hold [V].
    """

    fill: float
    exhaust: float
    u_fill: float
    u_exhaust: float


def sonic_conductances(
    flow: FlowModel,
    u: tuple[float, float],
    ports: tuple[float, float],
    T: float = T_ANR,
    theta: FloatArray | None = None,
) -> SonicConductances:
    """Return C = q_m/(ρ_0 p_1) √(T/T_0) of both edges where the flow is choked.

    The supply edge is evaluated against the exhaust pressure, the other from the supply pressure.

    Parameters
    ----------
    flow : FlowModel
        Any form of the flow map.
    u : tuple of float
        Lowest and highest command [V]; the valve fills at the highest.
    ports : tuple of float
        Exhaust and supply pressure, absolute [Pa].
    T : float, optional
        Temperature upstream [K].
    theta : (n,) array, optional
        Parameters of the flow; by default those of `flow`.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> table = pc.valve.read_flow_map(pc.example_case().flow_map_path)
    >>> C = sonic_conductances(pc.valve.fit_polynomials(table), (-3.0, 3.0), (1e5, 7e5))
    >>> f"{1e8 * C.fill:.2f} l/(s bar) at {C.u_fill:g} V"
    '0.95 l/(s bar) at 3 V'
    """
    p_ext, p_supply = ports
    values = flow.parameters.values if theta is None else theta
    q_m = flow_function(flow)
    fill, exhaust = (float(q_m(*at, values)) for at in ((u[1], p_ext), (u[0], p_supply)))
    scale = float(np.sqrt(T / T_ANR)) / (RHO_ANR * p_supply)
    return SonicConductances(fill * scale, -exhaust * scale, u[1], u[0])


def edge_slopes(model: FlowModel, u: ArrayLike) -> FloatArray:
    """Return the slopes with which a map is continued beyond its pressures.

    Parameters
    ----------
    model : FlowModel
        A model continued along its tangents: polynomials or spline.
    u : (n,) array
        Commands [V].

    Returns
    -------
    (n, 2) array
        ∂q_m/∂p [kg/(s Pa)] below the lower and above the upper edge of `p_range`. In a real
        valve the flow falls with the outlet pressure: both are at most zero.
    """
    commands = np.atleast_1d(np.asarray(u, dtype=float))
    low, high = model.p_range
    width = high - low  # the continuation is straight: any step gives its slope
    return np.column_stack(
        [
            (model(commands, low) - model(commands, low - width)) / width,
            (model(commands, high + width) - model(commands, high)) / width,
        ]
    )


def warn_of_rising_edges(model: FlowModel, table: FlowMap) -> None:
    """Log a warning where the continued flow would rise with pressure."""
    commands = np.linspace(*table.u_range, 21)
    # A tenth of the mean slope of the map: below it the sign is a matter of noise.
    tolerance = 0.1 * table.q_max / (model.p_range[1] - model.p_range[0])
    rising = edge_slopes(model, commands) > tolerance
    for edge, p, rises in zip(("lower", "upper"), model.p_range, rising.T, strict=True):
        if rises.any():
            logger.warning(
                "%s: at the %s edge (p = %.4g Pa) the fitted flow rises with pressure for u from "
                "%.2g to %.2g V; keep chamber pressures inside the map or change the fit",
                table.source,
                edge,
                p,
                commands[rises].min(),
                commands[rises].max(),
            )
