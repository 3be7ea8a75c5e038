"""Tables on how the flow map acts on the parameters."""

from collections.abc import Mapping
from statistics import median
from typing import Any

from tables.common import rows

#: Forms of the flow map, as tables call them.
NAMES = {
    "polynomials": "eq. 12",
    "iso6358": "ISO 6358",
    "iso6358_curve": "ISO 6358 with curved openings",
    "spline": "spline",
}


def flow_answer(result: Mapping[str, Any]) -> str:
    """Answer the paper's question in one paragraph."""
    own = {(row["form"], row["treatment"]): row for row in result["forms"]["table1"]}

    def k_errors(form: str, use: str, key: str = "output_error") -> str:
        entry = own[form, use][key]
        return f"{_signed(entry['k_P'])} and {_signed(entry['k_N'])} %"

    def span(use: str, k: str) -> str:
        rows = [row["output_error"] for (_, used), row in own.items() if used == use]
        errors = [entry[k]["error_percent"] for entry in rows if entry is not None]
        return f"{min(errors):+.1f} … {max(errors):+.1f} %"

    forms = {form for form, used in own if used == "left out" and form != "3-3-3"}
    pairs = [[own[form, use]["output_error"] for use in ("anchored", "left out")] for form in forms]
    apart = max(
        abs(entry[k]["error_percent"] - other[k]["error_percent"])
        for entry, other in pairs
        if entry is not None and other is not None
        for k in ("k_P", "k_N")
    )
    lost = [row for (_, use), row in own.items() if use == "left out" and not row["output_error"]]
    gain, filling = result["metering"]["shifts"][:2]
    noise = next(n for n in result["metering"]["noise"] if n["noise_percent"] > 0.2)
    ways = ("wls", "fixed", "anchored")
    most = max(0.01, *(abs(gain[way][k]) for way in ways for k in ("k_P", "k_N")))
    chambers = [value for name, value in gain["anchored"].items() if name.startswith("X_s")]
    moved = [f"{filling[way]['k_P']:+.2f} %" for way in ways]
    spread = [f"{noise[way]['k_P']:.2f}" for way in ways]
    seen, metered = result["largest_command_V"], result["metered_command_V"]
    return (
        "A gain error of 1 % in the map moves X_s1 ... X_s6 by "
        f"{sum(chambers) / len(chambers):.2f} % and k_P, k_N by no more than {most:.2g} %, fixed "
        "or anchored; trajectories do not depend on it. What moves k_P and k_N is the "
        f"shape of the map, and only where the record goes: here |u| stays below {seen:.2f} V of "
        f"the {metered:g} V that were metered. With the map as fitted, k_P and k_N of WLS err by "
        f"{k_errors('7-7-4', 'fixed', 'wls')} with the paper's degrees 7-7-4, by "
        f"{k_errors('7-7-7', 'fixed', 'wls')} with 7-7-7 and by "
        f"{k_errors('ISO 6358', 'fixed', 'wls')} with ISO 6358; those of output error with the map "
        f"held fixed by {k_errors('7-7-4', 'fixed')}, {k_errors('7-7-7', 'fixed')} and "
        f"{k_errors('ISO 6358', 'fixed')}. Anchored, so that the fit may correct the shape, "
        f"k_P errs by {span('anchored', 'k_P')} and k_N by {span('anchored', 'k_N')} over all "
        f"forms; left out, by {span('left out', 'k_P')} and {span('left out', 'k_N')}, but then "
        f"the scale of X_s must come from the piston's area, and {len(lost)} forms of high degree "
        f"do not converge. From degree 5 on the two differ by {apart:.1f} % at most: little of the "
        "remaining error is due to the map. With degrees 9-9-9, filling flows metered 1 % too high "
        f"move k_P by {moved[0]} (WLS), {moved[1]} (fixed) and {moved[2]} (anchored); noise of "
        f"{noise['noise_percent']:g} % of the largest flow scatters it by {spread[0]}, {spread[1]} "
        f"and {spread[2]} %."
    )


def flow_forms(result: Mapping[str, Any]) -> str:
    """Errors of X_s, k_P and k_N by form and treatment of the flow map."""
    uses = ("fixed", "anchored", "left out")
    head = ["record, form", "misfit %", "where used %", "WLS", *(f"OE, {use}" for use in uses)]
    body = []
    for case, entries in result["forms"].items():
        for form in dict.fromkeys(row["form"] for row in entries):
            own = {row["treatment"]: row for row in entries if row["form"] == form}
            first = next(iter(own.values()))
            cells = [_errors(first["wls"])]
            cells += [_errors(own[use]["output_error"]) if use in own else "" for use in uses]
            misfits = [first[f"map_error{part}_percent"] for part in ("", "_used")]
            body.append([f"{case}, {form}", *(f"{m:.2f}" for m in misfits), *cells])
    return rows(head, body)


def flow_metering(result: Mapping[str, Any]) -> str:
    """Shifts of X_s, k_P and k_N by errors of the metered map."""
    keys = ("wls", "fixed", "fixed_first_order", "anchored", "anchored_first_order")
    head = ["error of the map", "WLS", "OE, fixed", "to 1st order", "OE, anchored", "to 1st order"]
    body = [
        [entry["metering"], *(_shifts(entry[key]) for key in keys)]
        for entry in result["metering"]["shifts"]
    ]
    for entry in result["metering"]["noise"]:
        name = f"noise {entry['noise_percent']:g} %, spread over {entry['seeds']} maps"
        body.append([name, *(_spreads(entry[key]) for key in keys)])
    return rows(head, body)


def flow_default_answer(result: Mapping[str, Any]) -> str:
    """Say in one paragraph what the default changes against eq. 12 with the paper's degrees."""
    summary, cases = result["summary"], list(result["cases"].values())
    chosen = " and ".join(f"{NAMES[form]} for {n}" for form, n in summary["chosen"].items())
    both = [pair for pair in map(_before_after, cases) if all(f["output_error"] for f in pair)]

    def medians(stage: str, figure: str, pairs: list[Any]) -> str:
        values = [median(fit[stage][figure] for fit in side) for side in zip(*pairs, strict=True)]
        return f"{values[0]:.2g} to {values[1]:.2g} %"

    pairs = [_before_after(case) for case in cases]
    failed = [sum(fit["output_error"] is None for fit in side) for side in zip(*pairs, strict=True)]
    return (
        f"Of {len(cases)} labelled cases the default chooses {chosen}. Against eq. 12 with the "
        "paper's degrees, the default of 0.1.0, the median of the root mean square error of "
        f"X_s1 ... X_s6 goes from {medians('wls', 'rms_error_percent', pairs)} with WLS. With "
        "output error, which refines the form anchored by the map, it goes from "
        f"{medians('output_error', 'rms_error_percent', both)}, and the error of windows of the "
        f"held-out record from {medians('output_error', 'held_out_percent', both)} of the signal "
        f"({len(both)} cases where both converge; {failed[0]} fail with eq. 12, {failed[1]} with "
        "the default). Errors of more than a few per cent that both forms share come from the "
        "effect of the case, which the nominal model has not."
    )


def flow_default(result: Mapping[str, Any]) -> str:
    """Errors by case with eq. 12 and with the form that is chosen by default."""
    forms = ("eq. 12", "chosen")
    head = ["case, chosen form"]
    head += [f"{what}, {form}" for what in ("WLS", "OE", "held-out %") for form in forms]
    body = []
    for name, case in result["cases"].items():
        fits = _before_after(case)
        ended = [fit["output_error"] for fit in fits]
        cells = [_case_errors(fit["wls"]) for fit in fits]
        cells += [_case_errors(entry) for entry in ended]
        cells += ["" if entry is None else f"{entry['held_out_percent']:.2f}" for entry in ended]
        body.append([f"{name.split('/')[1]}, {NAMES[case['selection']['chosen']]}", *cells])
    return rows(head, body)


def _before_after(case: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return the fits with eq. 12 of the paper's degrees, and with the form chosen by default."""
    return case["forms"]["polynomials_7_7_4"], case["forms"][case["selection"]["chosen"]]


def _case_errors(entry: Mapping[str, Any] | None) -> str:
    """Largest error of X_s1 ... X_s6, then those of k_P = X_s3/X_s2 and k_N = X_s6/X_s5.

    With heat exchange k has no true value, nor have X_s that contain it.
    """
    if entry is None:
        return "failed"
    factor = {name: 1 + error / 100 for name, error in entry["errors_percent"].items()}
    worst = max(map(abs, entry["errors_percent"].values()))
    if "X_s2" not in factor:
        return f"{worst:.1f}"
    k = [100 * (factor[f"X_s{i + 1}"] / factor[f"X_s{i}"] - 1) for i in (2, 5)]
    return f"{worst:.1f} / {k[0]:+.1f} / {k[1]:+.1f}"


def _errors(entry: Mapping[str, Any] | None) -> str:
    """Largest error of X_s1 ... X_s6, then those of k_P and k_N."""
    if entry is None:
        return "failed"
    worst = max(abs(v["error_percent"]) for n, v in entry.items() if n.startswith("X_s"))
    return f"{worst:.1f} / {_signed(entry['k_P'])} / {_signed(entry['k_N'])}"


def _signed(entry: Mapping[str, Any]) -> str:
    return f"{entry['error_percent']:+.1f}"


def _shifts(entry: Mapping[str, float] | None) -> str:
    """Smallest and largest shift of X_s1 ... X_s6, then those of k_P and k_N."""
    if entry is None:
        return "failed"
    moved = [value for name, value in entry.items() if name.startswith("X_s")]
    span = f"{min(moved):+.2f} … {max(moved):+.2f}"
    return f"{span} / {entry['k_P']:+.2f} / {entry['k_N']:+.2f}"


def _spreads(entry: Mapping[str, float] | None) -> str:
    if entry is None:
        return "failed"
    spread = [value for name, value in entry.items() if name.startswith("X_s")]
    span = f"{min(spread):.2f} … {max(spread):.2f}"
    return f"{span} / {entry['k_P']:.2f} / {entry['k_N']:.2f}"
