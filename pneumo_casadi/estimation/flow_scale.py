"""How well the scale of all flows is known, and what that adds to a covariance."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pneumo_casadi.data import Bench
from pneumo_casadi.parameters import FloatArray


def shared_accuracy(bench: Any) -> float | None:
    """Return the stated accuracy of the meter of a map that serves both valves.

    None where none is stated, and without valves.

    One map has one meter: where two accuracies are stated of it, the worse one counts.
    """
    if not isinstance(bench, Bench):
        return None
    return max((v.accuracy for v in bench.valves if v.accuracy is not None), default=None)


def flow_scale_std(bench: Any) -> tuple[float, float]:
    """Return the relative standard uncertainty of the scale of the flows of chambers P and N.

    That of each valve's flow meter where it is stated. Where no valve was metered, that of the
    mean of X_s3 and X_s6 from both piston areas. Zero for a map that states none, and without
    valves. Equal values mean one factor for both chambers.
    """
    if not isinstance(bench, Bench):
        return 0.0, 0.0
    if bench.valves.metered:
        P, N = (valve.accuracy or 0.0 for valve in bench.valves)
        return P, N
    common = bench.area_accuracy / 2**0.5
    return common, common


def flow_scale_covariance(names: Sequence[str], values: FloatArray, bench: Any) -> FloatArray:
    """Return what the unknown factors of the flows add to a covariance of parameters, (n, n).

    Equal factors of both chambers are one: see `flow_scale_std`.

    Parameters
    ----------
    names : sequence of str
        Parameters; X_s1 ... X_s3 have the factor of chamber P's flow, X_s4 ... X_s6 of chamber N's.
    values : (n,) array
        Their estimates [SI].
    bench : Bench
        What is stated of valves and areas.
    """
    P, N = flow_scale_std(bench)
    chambers = ((P, "123456"),) if P == N else ((P, "123"), (N, "456"))
    added = np.zeros((len(names), len(names)))
    for std, numbers in chambers:
        own = {f"X_s{number}" for number in numbers}
        scaled = std * np.where([name in own for name in names], values, 0.0)
        added += np.outer(scaled, scaled)
    return added
