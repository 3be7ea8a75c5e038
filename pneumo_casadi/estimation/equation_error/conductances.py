"""Conductances of unmetered valves, from records and piston areas."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from pneumo_casadi.data import Bench, Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion, smooth_motions
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve.data_sheet import (
    CRITICAL_RATIO,
    SUBSONIC_INDEX,
    iso6358_from_data_sheet,
)
from pneumo_casadi.valve.orifice import orifice_flow


def estimate_conductances(bench: Bench, records: Sequence[Recording]) -> tuple[float, float]:
    """Estimate the conductance gains of both edges of two equal valves [m³/(s Pa V)].

    With X_s3 = S_P/(r T) and X_s6 = S_N/(r T) the mass balances of eq. 1 are linear in the gains
    and in X_s1, X_s2, X_s4, X_s5: the air that the piston displaces gives the flow its scale.
    The openings are proportional to the commands, b and m typical ones: a start, not a result.

    Parameters
    ----------
    bench : Bench
        Areas, pressures and temperature.
    records : sequence of Recording
        Moving, with both chambers filled and emptied.

    Returns
    -------
    tuple of float
        Of the supply edge and of the exhaust edge.

    Raises
    ------
    FitError
        If the records do not show the flow through one of the edges.
    """
    axis = Servosystem(bench, iso6358_from_data_sheet(bench, bench.valves.P, (1e-9, 1e-9)))
    systems = []
    for motion in smooth_motions(axis, records):
        u = dict(zip(axis.inputs, motion.u, strict=True))
        states = dict(zip(axis.motion_states, motion.x, strict=True))
        rates = dict(zip(axis.motion_states, motion.dx, strict=True))
        for chamber in ("P", "N"):
            systems.append(_chamber_rows(bench, motion, chamber, u, states, rates))
    A = np.concatenate([rows for rows, _ in systems])
    y = np.concatenate([displaced for _, displaced in systems])
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    gains = nnls(A / size, y)[0][:2] / size[:2]
    if not (gains > 0).all():
        edge = "supply" if gains[0] <= 0 else "exhaust"
        raise FitError(
            f"the records show no flow through the {edge} edge of the valves; record a motion "
            "in which both chambers are filled and emptied, or check the sign of u"
        )
    return float(gains[0]), float(gains[1])


def _chamber_rows(
    bench: Bench,
    motion: SmoothedMotion,
    chamber: str,
    u: dict[str, FloatArray],
    states: dict[str, FloatArray],
    rates: dict[str, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return the regressor of one mass balance and the displaced air S p ẋ/(r T), averaged."""
    b, m = CRITICAL_RATIO[0], SUBSONIC_INDEX[0]
    p, dp = states[f"p_{chamber}"], rates[f"p_{chamber}"]
    command = u[f"u_{chamber}"]
    supply = u.get("p_supply", bench.p_supply)
    inlet = np.maximum(command, 0) * orifice_flow(1.0, b, m, supply, p, bench.T)
    outlet = np.maximum(-command, 0) * orifice_flow(1.0, b, m, p, bench.p_ext, bench.T)
    sign = 1.0 if chamber == "P" else -1.0
    none = np.zeros_like(p)
    own = [-dp, -sign * states["x"] * dp]
    volumes = [*own, none, none] if chamber == "P" else [none, none, *own]
    S = bench.S_P if chamber == "P" else bench.S_N
    displaced = sign * S / (bench.r * bench.T) * p * states["v"]
    columns = motion.averaged(np.stack([inlet, -outlet, *volumes, displaced])).T
    return columns[:, :-1], columns[:, -1]
