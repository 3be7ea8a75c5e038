"""Sonic conductances of the identified valve, with their standard deviations."""

from typing import Any

import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.estimation.flow_scale import flow_scale_std
from pneumo_casadi.estimation.output_error.result import OutputErrorResult
from pneumo_casadi.estimation.statistics import ParameterUncertainty
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import AnyFlowMap, AnyFlowModel, each_valve, sonic_conductances

#: Relative step of the derivatives of a conductance to the coefficients of a map.
STEP = 1e-6


def conductances(
    result: OutputErrorResult, table: AnyFlowMap | None, flow: AnyFlowModel | None
) -> dict[str, dict[str, float | None]]:
    """Return the sonic conductances at the largest metered commands, by valve (P, N or both).

    Each has its standard deviation, propagated from the coefficients of the map: the wider of that
    for white residuals and the robust one, as for parameters; None where a coefficient has none.

    Parameters
    ----------
    result : OutputErrorResult
        The fit.
    table, flow : FlowMap and FlowModel, or None
        The metered map, and the form fitted to it alone; without them there are no conductances.
    """
    bench = result.axis.bench
    if table is None or flow is None or not isinstance(bench, Bench):
        return {}
    valves = each_valve(table, flow)
    keys = ("P", "N") if len(valves) > 1 else ("both",)
    scale_std = flow_scale_std(result.axis)
    entries: dict[str, dict[str, float | None]] = {}
    for key, (metered, model) in zip(keys, valves.values(), strict=True):
        end = "" if key == "both" else f"_{key}"
        names = [f"{name}{end}" for name in model.parameters.names]
        theta = result.parameters.select(names).values
        u = (float(metered.u.min()), float(metered.u.max()))

        def both(at: FloatArray, model: Any = model, u: tuple[float, float] = u) -> FloatArray:
            C = sonic_conductances(model, u, (bench.p_ext, bench.p_supply), bench.T, at)
            return np.array([C.fill, C.exhaust])

        C = both(theta)
        step = STEP * np.maximum(np.abs(theta), 1e-3 * model.parameters.scales)
        slopes = np.array([(both(theta + e) - C) / e.sum() for e in np.diag(step)])
        if set(names) & set(result.parameters.free_names):
            stds = propagated(slopes, names, result.uncertainty)
        else:  # held at the map's own fit
            variance = np.einsum("ik,ij,jk->k", slopes, model.covariance, slopes)
            stds = np.hypot(np.sqrt(variance), C * scale_std["P" if end == "" else key])
        fill, exhaust = (float(std) if np.isfinite(std) else None for std in stds)
        entries[key] = {
            "C_fill_m3_per_s_Pa": float(C[0]),
            "C_fill_std": fill,
            "C_exhaust_m3_per_s_Pa": float(C[1]),
            "C_exhaust_std": exhaust,
            "u_fill_V": u[1],
            "u_exhaust_V": u[0],
        }
    return entries


def propagated(slopes: FloatArray, names: list[str], known: ParameterUncertainty) -> FloatArray:
    """Return standard deviations of quantities that depend on some parameters.

    Parameters
    ----------
    slopes : (n, k) array
        Derivatives of k quantities to n parameters.
    names : list of str
        Those parameters; one that was held adds nothing, and one at a bound neither.
    known : ParameterUncertainty
        Of all free parameters.

    Returns
    -------
    (k,) array
        Infinite where a parameter that matters has no variance.
    """
    rows = [i for i, name in enumerate(names) if name in known.names]
    rows = [i for i in rows if names[i] not in known.at_bound]
    at = [known.names.index(names[i]) for i in rows]
    covariances = (known.covariance, known.covariance_robust)
    stds = []
    for covariance in (each for each in covariances if each is not None):
        own = covariance[np.ix_(at, at)]
        if not np.all(np.isfinite(np.diag(own))):
            return np.full(slopes.shape[1], np.inf)
        stds.append(np.sqrt(np.einsum("ik,ij,jk->k", slopes[rows], own, slopes[rows])))
    widest: FloatArray = np.max(stds, axis=0)
    return widest
