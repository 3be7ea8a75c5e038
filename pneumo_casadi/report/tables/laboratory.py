"""The axis in the terms of a laboratory: areas, volumes, friction; its parameters; a legend.

The tables are made from the plain values of `result.json`, so that a report can be written again
from the file alone.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pneumo_casadi.diagnosis import Value
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.report.tables.quantities import quantity
from pneumo_casadi.report.tables.table import (
    Table,
    exponent_of,
    interval_text,
    scaled_unit,
    with_symbols,
)

#: Quantities of one chamber: words, symbol, and what the symbol becomes for chamber P or N.
_CHAMBER = (
    ("Piston area", "S"),
    ("Volume at mid-stroke", "V(0)"),
    ("Dead volume", "V_D"),
    ("Dead length", "l_D"),
    ("Polytropic coefficient", "k"),
)
_MOTION = {
    "M": "Moving mass",
    "f_v": "Viscous friction",
    "F_c_plus": "Coulomb friction forward",
    "F_c_minus": "Coulomb friction backward",
}
#: Meaning of every symbol of the reports.
LEGEND = {
    "P, N": "chambers: pressure in P pushes towards +x, pressure in N towards -x",
    "x, v": "position from the middle of the stroke, velocity",
    "u": "command of a valve; u > 0 fills its chamber",
    "p_P, p_N": "absolute pressures of the chambers",
    "p_ext, p_supply": "ambient and supply pressure",
    "q_mP, q_mN": "mass flows into the chambers",
    "S, S_P, S_N": "piston areas",
    "w": "unknown input: what must be added to a balance to explain the record",
    "V(0)": "volume of a chamber at x = 0, its tubes and ports included",
    "V_D, l_D": "dead volume: what is left at the end of the stroke; l_D = V_D/S",
    "k_P, k_N": "polytropic coefficients: 1 isothermal, 1.4 adiabatic",
    "r, T": "gas constant related to unit mass, temperature of the gas",
    "X_s1, X_s4": "V(0)/(k r T) of chambers P and N",
    "X_s2, X_s5": "S/(k r T) of chambers P and N",
    "X_s3, X_s6": "S/(r T) of chambers P and N",
    "M": "moving mass",
    "f_v": "viscous friction coefficient",
    "F_c⁺, F_c⁻": "Coulomb friction of forward and backward motion",
    "φ, ψ⁺, ψ⁻": "coefficients of the flow map (eq. 12): q_m = φ(p) + ψ(p, sign u) u",
    "k_supply, k_exhaust": "sonic conductance per volt of the edge that fills, that empties",
    "k_1_supply, k_1_exhaust": "the same of a curve, where the edge begins to open",
    "supply_ratio": "supply pressure of the metering bench over the stated one",
    "u_0_supply, u_0_exhaust": "command at which the edge opens",
    "w_supply, w_exhaust": "width of the rounding about that command",
    "h_supply, h_exhaust": "saturation of the conductance over the command",
    "C_leak_supply, C_leak_exhaust": "conductance of the closed edge",
    "v_s": "speed within which Coulomb friction is smoothed",
    "C, b, m": "sonic conductance, critical pressure ratio, subsonic index (ISO 6358)",
    "Y, W, X̂, ρ": "left side of the balances, regressor, estimates, residuals (eq. 13)",
    "σ": "standard deviation; ± 2σ is an interval of about 95 %",
    "WLS, OE": "weighted least squares on filtered data; output error by simulation",
}


def laboratory_tables(content: Mapping[str, Any]) -> tuple[Table, ...]:
    """Return chambers, motion, effects and valve in laboratory units.

    Parameters
    ----------
    content : mapping
        Plain values of an identification, as in ``result.json``.
    """
    tables = (_chambers(content), _motion(content), _effects(content), _valve(content))
    return tuple(table for table in tables if table.rows)


def legend_table(used: str, *tables: Table) -> Table:
    """Return the legend of the symbols.

    Parameters
    ----------
    used : str
        Text of a report; symbols that neither it nor the tables hold are left out.
    *tables : Table
        Tables of the report, of which headings and first cells count.
    """
    heads = (cell for table in tables for cell in (*table.columns, *(row[0] for row in table.rows)))
    used = " ".join((used, *heads))
    rows = [
        (symbols, meaning)
        for symbols, meaning in LEGEND.items()
        if any(_holds(used, symbol) for symbol in symbols.split(", "))
    ]
    return Table("Symbols of this report", ("", "meaning"), tuple(rows))


def _holds(text: str, symbol: str) -> bool:
    """Return whether a text holds a symbol as a word of its own."""
    return re.search(rf"(?<![\w]){re.escape(symbol)}(?![\w⁺⁻])", text) is not None


def _chambers(content: Mapping[str, Any]) -> Table:
    derived = content["output_error"]["derived"]
    rows = []
    for words, symbol in _CHAMBER:
        names = [_of_chamber(symbol, chamber) for chamber in "PN"]
        if names[0] in derived:
            cells = [_estimate(derived[name]) for name in names]
            rows.append((f"{words} {symbol}", *cells))
    return Table("Chambers, estimate ± 2σ", ("", "P", "N"), tuple(rows), _stated_areas(content))


def _of_chamber(symbol: str, chamber: str) -> str:
    return f"V_{chamber}(0)" if symbol == "V(0)" else f"{symbol}_{chamber}".replace("D_", "D")


def _stated_areas(content: Mapping[str, Any]) -> tuple[str, ...]:
    bench = (content["model"] or {}).get("bench", {})
    if "S_P_m2" not in bench:
        return ()
    S_P, S_N = (f"{1e4 * bench[key]:.4g} cm²" for key in ("S_P_m2", "S_N_m2"))
    return (f"bench.json states S_P = {S_P} and S_N = {S_N}.",)


def _motion(content: Mapping[str, Any]) -> Table:
    parameters = content["output_error"]["parameters"]
    sheet = (content["model"] or {}).get("bench", {}).get("datasheet", {})
    rows = []
    for name, item in parameters.items():
        if name.startswith("X_s") or "." in name:
            continue
        words = _MOTION.get(name, "")
        stated = f"{sheet['M_kg']:.4g} kg" if name == "M" and "M_kg" in sheet else ""
        rows.append((f"{words} {with_symbols(name)}".strip(), _estimate(item), stated))
    table = Table("Motion, estimate ± 2σ", ("", "estimate", "data sheet"), tuple(rows))
    return table if any(row[2] for row in rows) else table.without("data sheet")


def _effects(content: Mapping[str, Any]) -> Table:
    """Return the sizes of effects, and below what each one is."""
    rows, meanings = [], []
    for name, item in content["output_error"]["parameters"].items():
        effect, _, own = name.partition(".")
        if not own:
            continue
        rows.append((with_symbols(name), _estimate(item)))
        known = EFFECTS.get(effect)
        described = {each.name: each.description for each in known().parameters} if known else {}
        if own in described:
            meanings.append(f"{with_symbols(name)}: {described[own]}.")
    return Table("Effects, estimate ± 2σ", ("", "estimate"), tuple(rows), tuple(meanings))


def _valve(content: Mapping[str, Any]) -> Table:
    rows = tuple(_valve_rows(content["flow"] or {}))
    bench = (content["model"] or {}).get("bench", {})
    unknown = (
        "The accuracy of the flow meter is not stated (valve.accuracy_percent in bench.json), and "
        "not in ± 2σ of C.",
    )
    section = bench.get("valve", {})
    valves = [section[name] for name in "PN"] if "P" in section else [section]
    one_map = "both" in (content["flow"] or {}).get("conductance", {})  # has one meter
    stated = ["accuracy_percent" in valve for valve in valves]
    notes = () if (any(stated) if one_map else all(stated)) else unknown
    return Table("Valve, estimate ± 2σ", ("", "filling", "exhausting"), rows, notes)


def _valve_rows(flow: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    for key, item in flow.get("conductance", {}).items():
        which, end = ("", "") if key == "both" else (f" {key}", f"_{key}")
        fill, exhaust = (
            f"{_conductance(item, edge)} at {item[f'u_{edge}_V']:.3g} V"
            for edge in ("fill", "exhaust")
        )
        yield f"Sonic conductance C{which}", fill, exhaust
        ratios = [flow["parameters"].get(f"b_{edge}{end}") for edge in ("supply", "exhaust")]
        if ratios[0] is not None and ratios[1] is not None:
            yield f"Critical pressure ratio b{which}", _estimate(ratios[0]), _estimate(ratios[1])


def _conductance(item: Mapping[str, Any], edge: str) -> str:
    # Earlier results have no interval.
    std = item.get(f"C_{edge}_std")
    value = Value(item[f"C_{edge}_m3_per_s_Pa"], math.nan if std is None else std, "m³/(s Pa)")
    return quantity(value)


def _estimate(item: Mapping[str, Any]) -> str:
    """Return an estimate ± 2σ, or what its note says of it."""
    note = item.get("note")
    if note is not None:
        return quantity(Value(item["value"], 0.0, item["unit"]), held=f" ({note})")
    # JSON holds no infinity: None stands for an estimate without information.
    stds = [math.nan if item[key] is None else item[key] for key in ("std", "std_robust")]
    return quantity(Value(item["value"], max(stds), item["unit"]))


def estimate_table(content: Mapping[str, Any]) -> Table:
    """Return WLS and output error side by side, and the truth if it is known.

    Parameters
    ----------
    content : mapping
        Plain values of an identification, as in ``result.json``.
    """
    wls, truth = content["wls"]["parameters"], content["truth"] or {}
    fit = content["output_error"]
    wls = wls | (content["wls"]["derived"] or {})
    ratios = {name: fit["derived"][name] for name in ("k_P", "k_N") if name in fit["derived"]}
    rows = []
    for name, item in (fit["parameters"] | ratios).items():
        e = exponent_of(item["value"])
        linear = wls.get(name)
        rows.append(
            (
                with_symbols(name),
                scaled_unit("" if item["unit"] == "1" else item["unit"], e),
                "" if linear is None else _wls(linear, e),
                _interval(item, e) + (f" ({item['note']})" if "note" in item else ""),
                f"{truth[name] / 10.0**e:.4g}" if name in truth else "",
            )
        )
    columns = ("", "unit", "WLS", "output error", "truth")
    table = Table("Identified parameters, estimate ± 2σ", columns, tuple(rows))
    return table if truth else table.without("truth")


def _wls(item: Mapping[str, Any], exponent: int) -> str:
    """Return an estimate of WLS; only its parameters have an interval that allows for all."""
    return interval_text(item["value"], 2 * item.get("std_hac", item["std"]), exponent)


def _interval(item: Mapping[str, Any], exponent: int) -> str:
    stds = [item[key] for key in ("std", "std_robust") if item.get(key) is not None]
    return interval_text(item["value"], 2 * max(stds) if stds else None, exponent)
