"""Fits of a three-way valve of two ISO 6358 restrictions to a metered map."""

import logging
from dataclasses import replace

import numpy as np

from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.iso6358 import FlowISO6358
from pneumo_casadi.valve.opening import (
    SIDES,
    curve_parameters,
    hyperbola_parameters,
    known_before,
    reach_of,
    subsonic_index,
    supply_ratio,
)
from pneumo_casadi.valve.orifice import LAMINAR_RATIO, RHO_ANR, T_ANR, bounded_least_squares

logger = logging.getLogger(__name__)

#: What a message adds where the openings are curves.
CURVED = " with curved openings (form iso6358 has fewer)"


def fit_iso6358(
    table: FlowMap,
    *,
    T: float = T_ANR,
    laminar_ratio: float = LAMINAR_RATIO,
    start: Parameters | None = None,
) -> FlowISO6358:
    """Fit the two edges of a three-way valve to a measured map by bounded least squares.

    Parameters
    ----------
    table : FlowMap
        Measured points on both sides of u = 0, with `p_supply` (one or one per point) and
        `p_ext`.
    T : float, optional
        Supply temperature [K].
    laminar_ratio : float, optional
        See `orifice_expression`.
    start : Parameters, optional
        Start, bounds and scales; by default from the greatest flows of the map.

    Raises
    ------
    CaseError
        If a pressure is unknown, one side of the valve was not metered, or there are no more
        points than parameters.
    FitError
        If the iteration stalls.
    """
    _check(table)
    return _fitted(table, _start(table, T) if start is None else start, T, laminar_ratio)


def fit_iso6358_curve(
    table: FlowMap,
    *,
    T: float = T_ANR,
    laminar_ratio: float = LAMINAR_RATIO,
    start: Parameters | None = None,
) -> FlowISO6358:
    """Fit two edges whose conductances are curves of five slopes over the command.

    The fit of `fit_iso6358` is where this one starts; errors are the same.

    Parameters
    ----------
    table : FlowMap
        Measured points on both sides of u = 0, with `p_supply` and `p_ext`.
    T : float, optional
        Supply temperature [K].
    laminar_ratio : float, optional
        See `orifice_expression`.
    start : Parameters, optional
        Start of the hyperbolas.

    Notes
    -----
    One hyperbola describes straight ports and the saturation of a stroke. Round and notched ports
    open along other curves: a hyperbola through the whole map misses them by half a per cent of
    the largest flow, which near null, where an axis works, may be a tenth of the flow. Where the
    map tells no slope, because too few commands were metered, that of the hyperbola stands: each
    is known beforehand to be like it, within `LIKE_HYPERBOLA`. The supply pressure may differ from
    the stated one by as much as manometers do.
    """
    hyperbola = fit_iso6358(table, T=T, laminar_ratio=laminar_ratio, start=start)
    at, reaches = hyperbola.parameters.as_dict(), reach_of(table.u_range)
    edges = [
        item
        for side, reach in zip(SIDES, reaches, strict=True)
        for item in curve_parameters(at, side, reach)
    ]
    guess = Parameters([*edges, subsonic_index(at["m"]), supply_ratio()])
    known = known_before(guess)
    spread = np.array([known.get(name, np.inf) for name in guess.names])
    return _fitted(table, guess, T, laminar_ratio, hyperbola.sigma / spread)


def _check(table: FlowMap) -> None:
    """Check that a map tells both edges."""
    if table.p_supply is None or table.p_ext is None:
        name = "p_supply" if table.p_supply is None else "p_ext"
        raise CaseError(
            f"{table.source}: `{name}` is unknown; ISO 6358 needs absolute supply and exhaust "
            "pressures [Pa]: give them to the flow map"
        )
    if not (np.any(table.u > 0) and np.any(table.u < 0)):
        raise CaseError(
            f"{table.source}: commands from {table.u.min():g} to {table.u.max():g} V; both signs "
            "are needed for both edges, use `fit_orifice` for one opening"
        )


def _fitted(
    table: FlowMap,
    guess: Parameters,
    T: float,
    laminar_ratio: float,
    known: FloatArray | None = None,
) -> FlowISO6358:
    """Fit from a guess that is known beforehand by these weights, residuals over deviations."""
    assert table.p_supply is not None and table.p_ext is not None
    if table.u.size <= len(guess):
        raise CaseError(
            f"{table.source}: {table.u.size} points for the {len(guess)} parameters of ISO 6358"
            f"{CURVED if known is not None else ''}; meter more commands and pressures"
        )
    shape = np.zeros((len(guess), len(guess)))
    supply = float(np.mean(table.p_supply))
    valve = FlowISO6358(
        guess, shape, 0.0, table.p_range, table.u_range, supply, table.p_ext, T, laminar_ratio
    )
    points = np.broadcast_arrays(table.u, table.p, np.asarray(table.p_supply))

    weights = np.zeros(len(guess)) if known is None else known
    prior = np.diag(weights)[weights > 0]

    def evaluate(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        q_m, jacobian = valve.flow_and_slopes(theta, points)
        deviations = prior @ (theta - guess.values)
        return np.concatenate([q_m - table.q_m, deviations]), np.vstack([jacobian.T, prior])

    fitted, covariance, sigma = bounded_least_squares(evaluate, guess, table.q_max)
    result = replace(valve, parameters=fitted, covariance=covariance, sigma=sigma)
    if len(prior):  # σ is that of the map alone
        dof = table.n - int(np.isfinite(np.diag(covariance)).sum())
        of_map = float(np.sqrt(np.sum(result.residuals(table) ** 2) / dof))
        result = replace(result, covariance=covariance * (of_map / sigma) ** 2, sigma=of_map)
    if result.at_bound:
        logger.info("%s: at a bound: %s", table.source, ", ".join(result.at_bound))
    return result


def _start(table: FlowMap, T: float) -> Parameters:
    supply = np.asarray(table.p_supply)
    unit_flow = RHO_ANR * np.sqrt(T_ANR / T)
    gains = {
        "supply": np.max(table.q_m / supply) / (unit_flow * table.u_range[1]),
        "exhaust": np.max(-table.q_m / table.p) / (unit_flow * -table.u_range[0]),
    }
    reach = max(np.abs(table.u_range))
    items = []
    for side, k in gains.items():
        if not k > 0:
            raise ModelError(
                f"{table.source}: no flow through the {side} edge; is the sign of u reversed?"
            )
        items += hyperbola_parameters(side, k, reach)
    return Parameters([*items, subsonic_index(0.5)])
