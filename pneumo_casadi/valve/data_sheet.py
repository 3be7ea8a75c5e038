"""A valve that nobody metered: ISO 6358 with what a data sheet states, or with nothing."""

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.valve_source import FlowSource, ValveData
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.valve.iso6358 import FlowISO6358
from pneumo_casadi.valve.opening import SOURCE

#: Standard uncertainty of C where nothing is known, over the value that the records suggest.
UNKNOWN_CONDUCTANCE = 1.0
#: Critical pressure ratio and subsonic index of spool valves: (mean, standard deviation). ISO 6358
#: gives b = 0.2 to 0.5 and m near 0.5 for most of them.
CRITICAL_RATIO, SUBSONIC_INDEX = (0.3, 0.12), (0.5, 0.05)
#: Shape of the opening over the command at which C holds: (mean, standard deviation) of overlap
#: or underlap, rounding of the edges, and curvature. Proportional spool valves are lapped to a few
#: per cent of the stroke.
LAP, ROUNDING, CURVATURE = (0.0, 0.05), (0.02, 0.02), (0.0, 0.3)
#: Leakage over C: (mean, standard deviation). Data sheets of spool valves state 0.1 to 2 %.
LEAKAGE = (0.01, 0.01)


def iso6358_from_data_sheet(
    bench: Bench, valve: ValveData, conductance: tuple[float, float] | None = None
) -> FlowISO6358:
    """Return the flow model of an unmetered valve, with what is known of it as its covariance.

    The opening is proportional to the command as a first guess; all parameters can be refined.

    Parameters
    ----------
    bench : Bench
        Pressures and temperature.
    valve : ValveData
        The data sheet, or source ``none``.
    conductance : tuple of float, optional
        Conductance gains k of the supply and exhaust edge [m³/(s Pa V)] where the valve states
        none, for example from `estimate_conductances`.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> bench = pc.example_case().bench
    >>> valve = ValveData(FlowSource.DATA_SHEET, None, 2e-8, 2e-8, 0.3, u_full=5.0)
    >>> flow = iso6358_from_data_sheet(bench, valve)
    >>> bool(flow(5.0, 1e5) > 0)
    True
    """
    if valve.source is FlowSource.DATA_SHEET:
        assert valve.C_fill and valve.C_exhaust and valve.u_full and valve.accuracy
        u_full, accuracy = valve.u_full, valve.accuracy
        gains = (valve.C_fill / u_full, valve.C_exhaust / u_full)
    else:
        assert conductance is not None
        u_full, accuracy = valve.u_full or _largest_command(bench), UNKNOWN_CONDUCTANCE
        gains = conductance
    b = (CRITICAL_RATIO[0] if valve.b is None else valve.b, CRITICAL_RATIO[1])
    m = (SUBSONIC_INDEX[0] if valve.m is None else valve.m, SUBSONIC_INDEX[1])
    items: list[tuple[Parameter, float]] = []
    for side, k in zip(("supply", "exhaust"), gains, strict=True):
        C = k * u_full
        items += [
            _known(f"k_{side}", (k, accuracy * k), "m³/(s Pa V)", (0.0, np.inf), k),
            _known(f"u_0_{side}", LAP, "V", (-1.0, 1.0), 0.02, u_full),
            _known(f"w_{side}", ROUNDING, "V", (1e-4, 1.0), 0.02, u_full),
            _known(f"h_{side}", CURVATURE, "1/V", (0.0, 1e3), 0.1, 1 / u_full),
            _known(f"C_leak_{side}", LEAKAGE, "m³/(s Pa)", (0.0, np.inf), 0.01, C),
            _known(f"b_{side}", b, "1", (0.0, 0.95), 0.1),
        ]
    items.append(_known("m", m, "1", (0.1, 2.0), 0.1))
    variances = np.array([std**2 for _, std in items])
    return FlowISO6358(
        Parameters([item for item, _ in items]),
        np.diag(variances),
        0.0,
        (bench.p_ext, bench.p_supply),
        (-u_full, u_full),
        bench.p_supply,
        bench.p_ext,
        bench.T,
    )


def _largest_command(bench: Bench) -> float:
    return float(getattr(bench.controller, "u_max", None) or 10.0)


def _known(
    name: str,
    known: tuple[float, float],
    unit: str,
    bounds: tuple[float, float],
    scale: float,
    size: float = 1.0,
) -> tuple[Parameter, float]:
    """Return a parameter and its standard uncertainty, all given in multiples of `size`."""
    mean, std = known[0] * size, known[1] * size
    lower, upper = bounds[0] * size, bounds[1] * size
    text = "as known before any record"
    item = Parameter(
        name, mean, unit, lower, upper, scale=scale * size, description=text, source=SOURCE
    )
    return item, std
