"""The curves behind a diagnosis as plain data, thinned and rounded, and read back."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pneumo_casadi.data.recording.curves import curves_of, rounded
from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.diagnosis.locate.regime_maps import RegimeMap
from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.json_files import without_infinities

#: Nodes of the unknown inputs that are stored: as many as a figure of one column resolves twice.
NODES = 1000


def evidence_dict(evidence: Evidence) -> dict[str, Any]:
    """Return curves as plain data; a number that is not finite is None.

    Parameters
    ----------
    evidence : Evidence
        Unknown inputs with more than `NODES` nodes are thinned, time plots as by
        `Curves.as_dict`.

    Examples
    --------
    >>> evidence_dict(Evidence((), ()))
    {'records': [], 'unknown_inputs': [], 'residuals': {'before': [], 'after': []}}
    """
    content = {
        "records": [curves.as_dict() for curves in evidence.simulations],
        "unknown_inputs": [_inputs(inputs) for inputs in evidence.inputs],
        "residuals": {
            "before": [_map(each) for each in evidence.before],
            "after": [_map(each) for each in evidence.after],
        },
    }
    plain: dict[str, Any] = without_infinities(content)
    return plain


def evidence_of(plain: Mapping[str, Any]) -> Evidence:
    """Return curves from the plain data of `evidence_dict`.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is not complete.
    """
    residuals = plain["residuals"]
    return Evidence(
        tuple(_inputs_of(each) for each in plain["unknown_inputs"]),
        tuple(_map_of(each) for each in residuals["before"]),
        tuple(_map_of(each) for each in residuals["after"]),
        tuple(curves_of(each) for each in plain["records"]),
    )


def _inputs(inputs: UnknownInputs) -> dict[str, Any]:
    step = max(1, int(np.ceil(inputs.t.size / NODES)))
    return {
        "t": rounded(inputs.t[::step]),
        "w": [rounded(row[::step]) for row in inputs.w],
        "std": [rounded(row[::step]) for row in inputs.std],
        "states": [rounded(row[::step]) for row in inputs.states],
        "counts": inputs.counts[:, ::step].tolist(),
        "signal": inputs.signal.tolist(),
        "walk_std": inputs.walk_std.tolist(),
        "equations": list(inputs.equations),
    }


def _inputs_of(plain: Mapping[str, Any]) -> UnknownInputs:
    array = _arrays(plain)
    counts = np.asarray(plain["counts"], dtype=bool)
    shown = ("t", "w", "std", "states")
    t, w, std, states = (array(name) for name in shown)
    equations = tuple(map(str, plain["equations"]))
    if not w.shape == std.shape == counts.shape == (len(equations), t.size):
        raise ValueError(f"unknown inputs of shape {w.shape} over {t.size} nodes")
    return UnknownInputs(t, w, std, states, counts, array("signal"), array("walk_std"), equations)


def _map(regime_map: RegimeMap) -> dict[str, Any]:
    return {
        "name": regime_map.name,
        "unit": regime_map.unit,
        "balance": regime_map.balance,
        "edges": rounded(regime_map.edges),
        "mean": rounded(regime_map.mean),
        "band": rounded(regime_map.band),
        "residual_unit": regime_map.residual_unit,
    }


def _map_of(plain: Mapping[str, Any]) -> RegimeMap:
    array = _arrays(plain)
    edges, mean, band = (array(name) for name in ("edges", "mean", "band"))
    if not mean.shape == band.shape == (edges.size - 1,):
        raise ValueError(f"residuals over {plain['name']}: {edges.size} edges, {mean.size} means")
    names = (plain["name"], plain["unit"], plain["balance"])
    return RegimeMap(*names, edges, mean, band, plain["residual_unit"])


def _arrays(plain: Mapping[str, Any]) -> Callable[[str], FloatArray]:
    """Return entries as arrays; None is a number that was not finite."""
    return lambda name: np.asarray(plain[name], dtype=float)
