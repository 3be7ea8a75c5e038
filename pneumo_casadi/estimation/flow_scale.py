"""How well the scale of all flows is known, and what that adds to a covariance.

A metered map has the factor of its flow meter. A map that serves both valves has one meter, and
where two accuracies are stated of it, the worse one counts. Maps of two valves have a factor each,
independent of the other even where both accuracies are the same.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import FlowPair


def meter_accuracies(axis: Any) -> dict[str, float | None]:
    """Return the stated accuracy of each flow meter, by the chambers whose flow has its factor.

    Returns
    -------
    dict
        Of ``"PN"`` where one map serves both valves, of ``"P"`` and ``"N"`` otherwise; None where
        an accuracy is not stated. Empty without valves.
    """
    bench = getattr(axis, "bench", None)
    if not isinstance(bench, Bench):
        return {}
    P, N = (valve.accuracy for valve in bench.valves)
    if isinstance(axis.flow, FlowPair):
        return {"P": P, "N": N}
    return {"PN": max((stated for stated in (P, N) if stated is not None), default=None)}


def flow_factors(axis: Any) -> dict[str, float]:
    """Return the relative standard uncertainty of each factor of the flows, by its chambers.

    That of the flow meter where it is stated (`meter_accuracies`), zero where it is not. Where no
    valve was metered, that of the mean of X_s3 and X_s6 from both piston areas. Empty without
    valves.
    """
    bench = getattr(axis, "bench", None)
    if isinstance(bench, Bench) and not bench.valves.metered:
        return {"PN": bench.area_accuracy / 2**0.5}
    return {chambers: stated or 0.0 for chambers, stated in meter_accuracies(axis).items()}


def flow_scale_std(axis: Any) -> dict[str, float]:
    """Return the relative standard uncertainty of the scale of the flow of chambers P and N."""
    factors = flow_factors(axis)
    return {
        chamber: next((std for chambers, std in factors.items() if chamber in chambers), 0.0)
        for chamber in "PN"
    }


def flow_scale_covariance(names: Sequence[str], values: FloatArray, axis: Any) -> FloatArray:
    """Return what the unknown factors of the flows add to a covariance of parameters, (n, n).

    Parameters
    ----------
    names : sequence of str
        Parameters; X_s1 ... X_s3 have the factor of chamber P's flow, X_s4 ... X_s6 of chamber N's.
    values : (n,) array
        Their estimates [SI].
    axis : Axis
        Its bench states accuracies of valves and areas; its flow tells whether one map serves both.
    """
    numbers = {"P": "123", "N": "456"}
    added = np.zeros((len(names), len(names)))
    for chambers, std in flow_factors(axis).items():
        own = {f"X_s{number}" for chamber in chambers for number in numbers[chamber]}
        scaled = std * np.where([name in own for name in names], values, 0.0)
        added += np.outer(scaled, scaled)
    return added
