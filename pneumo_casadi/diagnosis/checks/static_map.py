"""The static flow map: how a fit changed it, and which part of it its form cannot follow."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.output_error.result import FlowMapDeviation, flow_map_deviation
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.valve import FlowMap, FlowModel, each_valve


def map_deviation(
    study: Study, values: Mapping[str, float], effects: Sequence[Effect] = ()
) -> FlowMapDeviation | None:
    """Return how far the flow coefficients among `values` leave the metered points.

    None without a map.
    """
    anchor = study.anchor_with(effects)
    if anchor is None or not all(name in values for name in anchor.names):
        return None
    return flow_map_deviation(
        anchor, study.axis.with_effects(*effects).with_parameters(dict(values))
    )


def map_misfit(study: Study) -> float | None:
    """Return the part of the flow map that its form cannot follow, over the greatest flow.

    The root mean square of the part of the map's own residuals that is a cubic polynomial in
    pressure at each command. Polynomials that are affine in the command (eq. 12) leave such a part
    only if the opening is not proportional to the command. None if no command was metered at six
    pressures or more.
    """
    anchor, table = study.anchor, study.flow_map
    if anchor is None or anchor.scatter is None or table is None:
        return None
    shares = [_misfit(*parts) for parts in each_valve(table, study.axis.flow).values()]
    return max((share for share in shares if share is not None), default=None)


def _misfit(table: FlowMap, flow: FlowModel) -> float | None:
    e = -flow.residuals(table)
    explained, count = 0.0, 0
    middle, half = (table.p.max() + table.p.min()) / 2, max(np.ptp(table.p) / 2, 1.0)
    for u in np.unique(table.u):
        rows = table.u == u
        if rows.sum() >= 6:
            X = np.polynomial.chebyshev.chebvander((table.p[rows] - middle) / half, 3)
            Q, _ = np.linalg.qr(X)
            explained += float(np.sum((Q.T @ e[rows]) ** 2))
            count += int(rows.sum())
    return float(np.sqrt(explained / count)) / table.q_max if count else None
