"""Write the README's tables from the committed results, so that they cannot differ.

``python benchmarks/readme.py`` rewrites what stands between the markers ``<!-- table: NAME -->``
and ``<!-- end -->``; with ``--check`` it only tells whether anything would change.
"""

import argparse
import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.report.tables.sealed_check import SHARES, share_text

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
SCOPES = ("all", "visible")
SYMBOLS = {"F_c_plus": "F_c⁺", "F_c_minus": "F_c⁻"}


def main() -> None:
    """Rewrite or check the README."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing, exit 1 if stale")
    path = ROOT / "README.md"
    old = path.read_text("utf-8")
    new = written(old)
    if parser.parse_args().check:
        sys.exit(int(new != old))
    path.write_text(new, encoding="utf-8")


def written(text: str) -> str:
    """Return a text with all its tables made anew."""

    def table(match: re.Match[str]) -> str:
        make, name = TABLES[match["name"]]
        result = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))
        return f"<!-- table: {match['name']} -->\n{make(result)}\n<!-- end -->"

    return re.sub(r"<!-- table: (?P<name>\S+) -->.*?<!-- end -->", table, text, flags=re.DOTALL)


def rows(head: list[str], body: list[list[str]]) -> str:
    """Return a Markdown table, numbers to the right."""
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *body))


def coverage(result: Mapping[str, Any]) -> str:
    """Bias, spread and coverage of both estimators, and of OE under coloured noise."""
    head = ["parameter"]
    for label in ("WLS", "OE"):
        head += [f"{label} bias %", f"{label} spread %", f"{label} coverage %"]
    head += ["OE error / bound", "OE coverage %, coloured noise"]
    body = []
    for name in result["wls"]:
        row = [SYMBOLS.get(name, name)]
        for key in ("wls", "output_error"):
            one = result[key][name]
            spread = 100 * one["spread"] / abs(one["truth"])
            row += [
                f"{one['bias_percent']:+.3f}",
                f"{spread:.3f}",
                f"{one['coverage_percent']:.1f}",
            ]
        coloured = result["coloured"]["output_error_robust"][name]
        row += [
            f"{result['output_error'][name]['rms_error_over_bound']:.2f}",
            f"{coloured['coverage_percent']:.1f}",
        ]
        body.append(row)
    return rows(head, body)


def truth(result: Mapping[str, Any]) -> str:
    """Both estimators beside the truth, on independent data."""
    head = ["parameter", "unit", "WLS ± 2σ", "OE ± 2σ", "truth", "WLS − truth", "OE − truth"]
    body = []
    for name, one in result["parameters"].items():
        estimates = [
            f"{one[key]:.4g} ± {2 * max(one[f'{key}_std'], one[f'{key}_std_{wide}']):.2g}"
            for key, wide in (("wls", "hac"), ("output_error", "robust"))
        ]
        errors = [f"{one[f'{key}_error_percent']:+.2f} %" for key in ("wls", "output_error")]
        symbol = SYMBOLS.get(name, name)
        body.append([symbol, one["unit"], *estimates, f"{one['truth']:.4g}", *errors])
    for name, one in result["derived"].items():
        value = f"{one['value']:.4f} ± {2 * one['std_robust']:.2g}"
        body.append([name, "1", "", value, f"{one['truth']:.4f}", "", f"{one['error']:+.4f}"])
    return rows(head, body)


def emps(result: Mapping[str, Any]) -> str:
    """Put ours beside the published figures of a real axis."""
    head = ["EMPS", "ours", "authors"]
    body = []
    for variant in ("symmetric", "asymmetric"):
        ours, theirs = result[variant], result["authors"][variant]
        for name, value in theirs["parameters"].items():
            errors = ours["standard_errors"][name], theirs["standard_errors"][name]
            body.append(
                [
                    f"{variant} {name}",
                    f"{ours['parameters'][name]:.4f} ± {errors[0]:.4f}",
                    f"{value:.4f} ± {errors[1]:.4f}",
                ]
            )
        for key, label in (
            ("relative_error_percent", "force error, %"),
            ("cross_validation_percent", "force error on pulses, %"),
        ):
            published = f"{theirs[key]:.4f}" if key in theirs else ""
            body.append([f"{variant} {label}", f"{ours[key]:.4f}", published])
    for record, signals in result["authors"]["closed_loop"].items():
        for signal, value in signals.items():
            ours = result["closed_loop"][record][signal]
            body.append([f"closed loop, {record}, {signal}, %", f"{ours:.4g}", f"{value:.4g}"])
    return rows(head, body)


def scaling(result: Mapping[str, Any]) -> str:
    """Time and memory over the length of the record."""
    head = ["record", "samples", "WLS s", "OE s", "iterations", "iteration / sweep", "peak GB"]
    body = []
    for one in [*result["records"], result["six_records"]]:
        parts = "" if one["records"] == 1 else f" in {one['records']} files"
        body.append(
            [
                f"{one['length_s']:g} s{parts}",
                f"{one['samples']:,}",
                f"{one['wls_s']:.1f}",
                f"{one['seconds']:.1f}",
                f"{one['iterations']}",
                f"{one['iteration_over_sweep']:.2f}",
                f"{one['peak_GB']:.2f}",
            ]
        )
    return rows(head, body)


def flow_answer(result: Mapping[str, Any]) -> str:
    """Answer the paper's question in one paragraph."""
    own = {(row["form"], row["treatment"]): row for row in result["forms"]["table1"]}

    def k_errors(form: str, use: str, key: str = "output_error") -> str:
        one = own[form, use][key]
        return f"{_signed(one['k_P'])} and {_signed(one['k_N'])} %"

    def span(use: str, k: str) -> str:
        rows = [row["output_error"] for (_, used), row in own.items() if used == use]
        found = [one[k]["error_percent"] for one in rows if one is not None]
        return f"{min(found):+.1f} … {max(found):+.1f} %"

    forms = {form for form, used in own if used == "left out" and form != "3-3-3"}
    pairs = [[own[form, use]["output_error"] for use in ("anchored", "left out")] for form in forms]
    apart = max(
        abs(one[k]["error_percent"] - other[k]["error_percent"])
        for one, other in pairs
        if one is not None and other is not None
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
        "or anchored; no trajectory tells. What moves k_P and k_N is the shape of the map, and "
        f"only where the record goes: here |u| stays below {seen:.2f} V of the {metered:g} V that "
        "were metered. With the map as fitted, k_P and k_N of WLS err by "
        f"{k_errors('7-7-4', 'fixed', 'wls')} with the paper's degrees 7-7-4, by "
        f"{k_errors('7-7-7', 'fixed', 'wls')} with 7-7-7 and by "
        f"{k_errors('ISO 6358', 'fixed', 'wls')} with ISO 6358; those of output error with the map "
        f"held fixed by {k_errors('7-7-4', 'fixed')}, {k_errors('7-7-7', 'fixed')} and "
        f"{k_errors('ISO 6358', 'fixed')}. Anchored, so that trajectories may mend the shape, "
        f"k_P errs by {span('anchored', 'k_P')} and k_N by {span('anchored', 'k_N')} over all "
        f"forms; left out, by {span('left out', 'k_P')} and {span('left out', 'k_N')}, but then "
        f"the scale of X_s must come from the piston's area, and {len(lost)} forms of high degree "
        f"do not converge. From degree 5 on the two part by {apart:.1f} % at most: what is left of "
        "the error is hardly the map's. With degrees 9-9-9, filling flows metered 1 % too high "
        f"move k_P by {moved[0]} (WLS), {moved[1]} (fixed) and {moved[2]} (anchored); noise of "
        f"{noise['noise_percent']:g} % of the largest flow scatters it by {spread[0]}, {spread[1]} "
        f"and {spread[2]} %."
    )


def flow_forms(result: Mapping[str, Any]) -> str:
    """Errors of X_s, k_P and k_N by form and treatment of the flow map."""
    uses = ("fixed", "anchored", "left out")
    head = ["record, form", "misfit %", "where used %", "WLS", *(f"OE, {use}" for use in uses)]
    body = []
    for case, found in result["forms"].items():
        for form in dict.fromkeys(row["form"] for row in found):
            own = {row["treatment"]: row for row in found if row["form"] == form}
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
        [one["metering"], *(_shifts(one[key]) for key in keys)]
        for one in result["metering"]["shifts"]
    ]
    for one in result["metering"]["noise"]:
        name = f"noise {one['noise_percent']:g} %, spread over {one['seeds']} maps"
        body.append([name, *(_spreads(one[key]) for key in keys)])
    return rows(head, body)


def _errors(one: Mapping[str, Any] | None) -> str:
    """Largest error of X_s1 ... X_s6, then those of k_P and k_N."""
    if one is None:
        return "failed"
    worst = max(abs(v["error_percent"]) for n, v in one.items() if n.startswith("X_s"))
    return f"{worst:.1f} / {_signed(one['k_P'])} / {_signed(one['k_N'])}"


def _signed(one: Mapping[str, Any]) -> str:
    return f"{one['error_percent']:+.1f}"


def _shifts(one: Mapping[str, float] | None) -> str:
    """Smallest and largest shift of X_s1 ... X_s6, then those of k_P and k_N."""
    if one is None:
        return "failed"
    moved = [value for name, value in one.items() if name.startswith("X_s")]
    span = f"{min(moved):+.2f} … {max(moved):+.2f}"
    return f"{span} / {one['k_P']:+.2f} / {one['k_N']:+.2f}"


def _spreads(one: Mapping[str, float] | None) -> str:
    if one is None:
        return "failed"
    spread = [value for name, value in one.items() if name.startswith("X_s")]
    span = f"{min(spread):.2f} … {max(spread):.2f}"
    return f"{span} / {one['k_P']:.2f} / {one['k_N']:.2f}"


def emps_output_error(result: Mapping[str, Any]) -> str:
    """Put closed- and open-loop errors side by side for every estimator of a real axis."""
    head = ["EMPS", "closed loop x, v %", "on pulses x, v %", "open loop on pulses, mm"]

    def loop(errors: Mapping[str, float]) -> str:
        return f"{errors['position']:.5f}, {errors['velocity']:.3f}"

    theirs = result["authors"]["closed_loop"]
    body = [["authors", loop(theirs["identification"]), loop(theirs["pulses"]), ""]]
    for name, one in result["estimators"].items():
        errors = one["closed_loop_percent"]
        open_loop = f"{one['open_loop_mm']['pulses']:.2f}"
        body.append([name, loop(errors["identification"]), loop(errors["pulses"]), open_loop])
    for name, value in result["black_boxes_mm"].items():
        body.append([f"{name} (published)", "", "", f"{value:g}"])
    return rows(head, body)


def loops(result: Mapping[str, Any]) -> str:
    """Bias of output error, loop open and closed, by situation: mean ± 2 of its errors, spread."""
    names = ("X_s2", "X_s3", "M", "f_v", "F_c_plus")
    head = ["error in % (spread)", "loop", *(SYMBOLS.get(name, name) for name in names)]
    body = []
    for situation, by_loop in result["situations"].items():
        for loop, one in by_loop.items():
            row = [situation, loop]
            for name in names:
                bias, error = one["bias_percent"][name], one["bias_standard_error"][name]
                spread = one["spread_percent"][name]
                row.append(f"{bias:+.2f} ± {2 * error:.2f} ({spread:.2f})")
            body.append(row)
    return rows(head, body)


def tools(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Time, memory and accuracy of every tool; failures stay in the table."""
    head = ["tool", "build s", "solve s", "peak GB", "cost", "largest error %", "reached"]
    body = []
    for name, row in found.items():
        label = f"{name} {row['version']}" if "version" in row else name
        if "failure" in row:
            body.append([label, "", "", "", "", "", row["failure"]])
            continue
        numbers = [f"{row['build_s']:.2f}", f"{row['solve_s']:.2f}", f"{row['peak_GB']:.2f}"]
        numbers += [f"{row['cost']:.1f}", f"{row['parameter_error_percent']:.2f}"]
        body.append([label, *numbers, "yes" if row["reached"] else "no"])
    return rows(head, body)


def peers(result: Mapping[str, Any]) -> str:
    """Our time beside that of other tools on the same problem."""
    said = (
        f"Ours, build and solve with a cold cache, is {result['speed_up_over_fastest_peer']:.1f} "
        f"times faster than the fastest peer that reaches the optimum ({result['fastest_peer']})."
    )
    return f"{said}\n\n{tools(result['tools'])}"


def solvers(result: Mapping[str, Any]) -> str:
    """Solvers on our own problem."""
    return tools({"pneumo_casadi": result["tools"]["pneumo_casadi"]} | dict(result["solvers"]))


def starts(result: Mapping[str, Any]) -> str:
    """How many starts reach the optimum."""
    return (
        f"{result['reached']} of {result['starts']} starts with every one of {result['free']} "
        f"parameters off by up to ±{100 * result['spread']:.0f} % reach the same optimum, in "
        f"{result['median_iterations']:g} iterations at the median."
    )


#: What a gap is seen in; see `gap`.
VIEWS = ("closed_loop", "windows")


def bench_sanity(result: Mapping[str, Any]) -> str:
    """Balances of the virtual bench, agreement with the model, and what a nominal fit leaves."""
    head = ["axis", "mass balance", "energy balance", "step", "x to model, no F_c, %"]
    head += ["x to model, F_c, %", "nominal fit: x, closed loop, % of motion"]
    body = []
    for seed, one in result["axes"].items():
        apart = one["agreement_percent"]
        narrowest = list(apart["with_coulomb_friction"].values())[-1]
        fit = result["nominal_fit"].get(seed)
        body.append(
            [
                seed,
                *(f"{one[key]:.0e}" for key in ("mass_error", "energy_error")),
                f"{one['step_errors'][-1]:.0e}",
                f"{apart['without_coulomb_friction']['x']:.0e}",
                f"{narrowest['x']:.3f}",
                "" if fit is None else f"{fit['closed_loop_x_percent_of_motion']:.3f}",
            ]
        )
    return rows(head, body)


def practice(result: Mapping[str, Any]) -> str:
    """Gaps of cases with one labelled effect, before and after a refit with it."""
    head = ["case", "closed loop %", "after", "closed %", "windows %", "after", "closed %"]
    head += ["fitted / label"]
    body = []
    for name, one in result["cases"].items():
        row = [name + _failed(one)]
        for view in VIEWS:
            shares = one.get("closed_percent", {}).get(view, {})
            faint = "" if view in one["visible"] or not one["effects"] else " °"
            faint += " †" if one["nominal"]["failure"] else ""
            row += [
                _gap(one["nominal_gap"], view) + faint,
                _gap(one.get("refit_gap"), view) if one["effects"] else "",
                f"{shares['all']:.1f}" if shares.get("all") is not None else "",
            ]
        ratios = [
            f"{label} {q['fitted'] / q['label']:.3f}" + ("*" if q["forms_differ"] else "")
            for label, q in one.get("quantities", {}).items()
        ]
        body.append([*row, ", ".join(ratios)])
    notes = "° at most twice the gap of the case without an effect: not visible. "
    notes += "† the nominal fit has not converged. * forms differ."
    return rows(head, body) + "\n\n" + notes


def effect_visibility(result: Mapping[str, Any]) -> str:
    """Verdicts on every effect, one an axis; gaps and what has moved are those of the first."""
    axes = result["axes"]
    first = next(iter(axes.values()))
    refits = any("refit" in one for one in first.values())
    head = ["effect", *(f"axis {seed}" for seed in axes)]
    for text in ("closed loop %", "windows %"):
        head += [text, "after"] if refits else [text]
    head.append("absorbed by")
    body = []
    for name, one in first.items():
        gaps = []
        for view in VIEWS:
            gaps.append(_gap(one["gap"], view))
            if refits:
                gaps.append(_gap(one.get("refit_gap"), view) if "refit" in one else "")
        if "verdict" not in one:
            body.append(["(none)", *("" for _ in axes), *gaps, ""])
            continue
        verdicts = [axis[name]["verdict"] for axis in axes.values()]
        label = name + ("" if one["listed"] else " (not in the catalogue)") + _failed(one)
        body.append([label, *verdicts, *gaps, _moves(one)])
    return rows(head, body)


def verdicts(result: Mapping[str, Any]) -> str:
    """Return what the diagnosis says of the practice cases."""
    head = ["case", "named (probability)", "balance", "gap %", "after", "closed %"]
    body = []
    for name, one in result["cases"].items():
        named = ", ".join(f"{e['name']} ({e['probability']:.2f})" for e in one["effects"])
        gap, mark = one["gap"], "" if one["right"] else " (wrong)"
        closed = f"{100 * gap['shrink']:.0f}" if named else ""
        told = (named or one["verdict"]) + mark
        place = one["where"]["balance"].replace("_", " ")
        body.append([name, told, place, f"{gap['before']:.2f}", f"{gap['after']:.2f}", closed])
    return rows(head, body)


#: Asked of the sealed check, all singles beside the visible ones where both are.
ASKED = {
    "right_first": "≥ 90 visible, ≥ 70 all",
    "set_covers": "≥ 95 visible",
    "pair_one": "≥ 95",
    "pair_both": "≥ 65",
    "false_alarm": "≤ 4",
    "unknown_caught": "≥ 85",
    "false_unknown": "≤ 5",
    "located": "≥ 92 visible",
}


def withheld(result: Mapping[str, Any]) -> str:
    """Return what the sealed check counted, beside what was asked of it."""
    both = [result["scores"][scope] for scope in SCOPES]
    body = [
        [text, *(share_text(one[key]) for one in both), ASKED.get(key, "")]
        for key, text in SHARES
        if key not in ("set_covers_given", "failed")
    ]

    def figures(key: str, name: str) -> list[str]:
        return [f"{one[key][name]:.2f}" for one in both]

    body.append(["mean size of the set offered", *figures("set_size", "mean"), "≤ 1.5"])
    body.append(["median shrink over an oracle's", *figures("shrink_of_oracle", "median"), "≥ 0.9"])
    error = result["calibration"]["expected_calibration_error"]
    body.append(["expected calibration error", f"{error:.3f}", "", "≤ 0.08"])
    for rival, key, text in (
        ("training_error", "right_first", "rival, ranking by training error: first"),
        ("forward_aic", "right_first", "rival, forward AIC: named, and nothing else"),
        ("forward_aic", "pair_both", "rival, forward AIC: both of a pair"),
        ("forward_aic", "false_alarm", "rival, forward AIC: false alarms"),
    ):
        shares = (result["rivals"][scope][rival][key] for scope in SCOPES)
        body.append([text, *map(share_text, shares), ""])
    chance = [result["rivals"][scope]["chance"]["right_first_percent"] for scope in SCOPES]
    body.append(["rival, chance: first", *(f"{one:.1f}" for one in chance), ""])
    return rows(["% (95 % interval) count", "all", "visible", "asked"], body)


def withheld_effects(result: Mapping[str, Any]) -> str:
    """Return how often each single effect was named, by severity."""
    severities = ("small", "medium", "large")
    body = []
    for name, found in result["effects"].items():
        cells = (found.get(severity) for severity in severities)
        body.append([name, *("" if c is None else _counted(c) for c in cells)])
    return rows(["effect", *severities], body)


def _counted(cell: Mapping[str, int]) -> str:
    told = f"{cell['right_first']} of {cell['of']}"
    return told if cell["visible"] == cell["of"] else f"{told} ({cell['visible']} visible)"


def batch(result: Mapping[str, Any]) -> str:
    """Return what a batch costs beside its diagnoses, and how much faster two workers are."""
    head = ["executor", "workers", "work a case, s", "outside it, ms", "outside, %", "speed-up"]
    body = [
        [
            name,
            f"{one['workers']}",
            f"{one['work_per_case_s']:.1f}",
            f"{1e3 * one['outside_s_per_case']:.1f}",
            f"{one['outside_percent']:.2f}",
            f"{one['speed_up']:.2f}",
        ]
        for name, one in result["executors"].items()
    ]
    return rows(head, body)


def designs(result: Mapping[str, Any]) -> str:
    """Return what designed experiments promised, and what they gave."""
    head = ["axis", "gain predicted", "real / predicted standard errors"]
    sample = next(iter(result["separation"].values()))
    names = sample["hidden"], sample["wrong"]
    head += [f"probability of {name}" for name in names]
    body = []
    for axis, one in result["precision"].items():
        quotients = [p["real"] / p["predicted"] for p in one["parameters"].values()]
        told = result["separation"][axis]["said"]
        odds = [" → ".join(f"{said['probability'][name]:.2f}" for said in told) for name in names]
        span = f"{min(quotients):.2f} to {max(quotients):.2f}"
        body.append([axis, f"{one['gain']:.2f}", span, *odds])
    return rows(head, body)


def _moves(one: Mapping[str, Any]) -> str:
    if one["verdict"] != "absorbed":
        return ""
    return ", ".join(
        "flow map" if "map" in name else f"{SYMBOLS.get(name, name)} {shift:+.1f} %"
        for name, shift in one["moved"].items()
    )


def _gap(gap: Mapping[str, Any] | None, view: str) -> str:
    return "failed" if gap is None else f"{gap[view]['gap_percent']:.2f}"


def _failed(one: Mapping[str, Any]) -> str:
    return " (refit failed)" if one.get("refit", {}).get("failure") else ""


#: Tables by name: how it is made, and from which result.
TABLES: dict[str, tuple[Callable[[Mapping[str, Any]], str], str]] = {
    "coverage": (coverage, "wls_vs_output_error"),
    "truth": (truth, "table1"),
    "emps": (emps, "emps"),
    "flow_answer": (flow_answer, "flow_sensitivity"),
    "flow_forms": (flow_forms, "flow_sensitivity"),
    "flow_metering": (flow_metering, "flow_sensitivity"),
    "loops": (loops, "loops"),
    "peers": (peers, "peers"),
    "solvers": (solvers, "peers"),
    "starts": (starts, "starts"),
    "scaling": (scaling, "scaling"),
    "emps_output_error": (emps_output_error, "emps_output_error"),
    "bench_sanity": (bench_sanity, "bench_sanity"),
    "practice": (practice, "practice"),
    "effect_visibility": (effect_visibility, "effect_visibility"),
    "verdicts": (verdicts, "practice_verdicts"),
    "batch": (batch, "batch"),
    "designs": (designs, "design"),
    "withheld": (withheld, "withheld"),
    "withheld_effects": (withheld_effects, "withheld"),
}


if __name__ == "__main__":
    main()
