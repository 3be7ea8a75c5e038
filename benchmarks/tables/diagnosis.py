"""Tables on verdicts of the diagnosis, the virtual bench and designed experiments."""

from collections.abc import Mapping
from statistics import median
from typing import Any

from pneumo_casadi.report.tables.sealed_check import share_text
from tables.common import SYMBOLS, rows

#: Kinds of sensor noise.
NOISES = ("white", "coloured")
#: What a gap is measured in.
VIEWS = ("closed_loop", "windows")


def verdicts(result: Mapping[str, Any]) -> str:
    """Return what the diagnosis says of labelled cases."""
    head = ["case", "named (probability)", "balance", "gap %", "after", "closed %"]
    body = []
    for name, entry in result["cases"].items():
        named = ", ".join(f"{e['name']} ({e['probability']:.2f})" for e in entry["effects"])
        gap, mark = entry["gap"], "" if entry["right"] else " (wrong)"
        closed = f"{100 * gap['shrink']:.0f}" if named else ""
        term = entry["discovered"]
        over = f": {term['form']} over {term['driver']}" if term else ""
        verdict = (named or entry["verdict"] + over) + mark
        balance = entry["where"]["balance"].replace("_", " ")
        body.append([name, verdict, balance, f"{gap['before']:.2f}", f"{gap['after']:.2f}", closed])
    return rows(head, body, texts=head[1:3])


def effect_coverage(result: Mapping[str, Any]) -> str:
    """Coverage of the intervals of effects, where model and data have the same form."""
    return _coverage(result, "by_effect")


def term_coverage(result: Mapping[str, Any]) -> str:
    """Coverage of the intervals of discovered terms, where their formula is that of the data."""
    return _coverage(result, "by_term")


def discovered(result: Mapping[str, Any]) -> str:
    """Return what is told of causes outside every catalogue, by their kind."""
    head = ["cause", "visible", "right driver", "closed, median %", "largest error of a size, %"]
    body = []
    for kind in dict.fromkeys(case["kind"] for case in result["unlisted"]):
        shown = [case for case in result["unlisted"] if case["kind"] == kind and case["visible"]]
        closed = [100 * case["discovered"]["closes"]["value"] for case in shown if case["right"]]
        errors = [abs(e) for case in shown for e in case["errors_percent"].values()]
        body.append(
            [
                kind.replace("_", " "),
                str(len(shown)),
                str(sum(case["right"] for case in shown)),
                f"{median(closed):.0f}" if closed else "",
                f"{max(errors):.1f}" if errors else "",
            ]
        )
    figures = result["figures"]
    right = f"{figures['right_driver']:.1%}"
    closed = f"{100 * figures['median_closure']:.0f}"
    body.append(["all", str(figures["visible"]), right, closed, ""])
    return rows(head, body)


def _coverage(result: Mapping[str, Any], by: str) -> str:
    studies = [study[kind] for study in (result, result["disturbed"]) for kind in NOISES]
    body = [
        [name.replace("_", " "), *(share_text(study[by][name]) for study in studies)]
        for name in result["white"][by]
    ]
    body.append(["all", *(share_text(study["coverage"]) for study in studies)])
    heads = [f"{kind}{state}" for state in ("", ", disturbed") for kind in NOISES]
    return rows(["covered, %", *heads], body)


def practice(result: Mapping[str, Any]) -> str:
    """Gaps of cases with one labelled effect, before and after a refit with it."""
    head = ["case", "closed loop %", "after", "closed %", "windows %", "after", "closed %"]
    head += ["fitted / label"]
    body = []
    for name, entry in result["cases"].items():
        row = [name + _failed(entry)]
        for view in VIEWS:
            shares = entry.get("closed_percent", {}).get(view, {})
            faint = "" if view in entry["visible"] or not entry["effects"] else " °"
            faint += " †" if entry["nominal"]["failure"] else ""
            row += [
                _gap(entry["nominal_gap"], view) + faint,
                _gap(entry.get("refit_gap"), view) if entry["effects"] else "",
                f"{shares['all']:.1f}" if shares.get("all") is not None else "",
            ]
        ratios = [
            f"{label} {q['fitted'] / q['label']:.3f}" + ("*" if q["forms_differ"] else "")
            for label, q in entry.get("quantities", {}).items()
        ]
        body.append([*row, ", ".join(ratios)])
    table = rows(head, body)
    notes = {
        "°": "at most twice the gap of the case without an effect: not visible.",
        "†": "the nominal fit has not converged.",
        "*": "forms differ.",
    }
    return f"{table}\n\n" + " ".join(f"{k} {text}" for k, text in notes.items() if k in table)


def effect_visibility(result: Mapping[str, Any]) -> str:
    """Verdicts on every effect, one an axis; gaps and what has moved are those of the first."""
    axes = result["axes"]
    first = next(iter(axes.values()))
    refits = any("refit" in entry for entry in first.values())
    head = ["effect", *(f"axis {seed}" for seed in axes)]
    for text in ("closed loop %", "windows %"):
        head += [text, "after"] if refits else [text]
    head.append("absorbed by")
    body = []
    for name, entry in first.items():
        gaps = []
        for view in VIEWS:
            gaps.append(_gap(entry["gap"], view))
            if refits:
                gaps.append(_gap(entry.get("refit_gap"), view) if "refit" in entry else "")
        if "verdict" not in entry:
            body.append(["(none)", *("" for _ in axes), *gaps, ""])
            continue
        verdicts = [axis[name]["verdict"] for axis in axes.values()]
        label = name + ("" if entry["listed"] else " (not in the catalogue)") + _failed(entry)
        body.append([label, *verdicts, *gaps, _moves(entry)])
    return rows(head, body, texts=(head[-1], *head[1 : 1 + len(axes)]))


def rule_cases(result: Mapping[str, Any]) -> str:
    """Return the rules, what is hidden in the record of each, and what is said in another way."""
    body = []
    for rule, case in result["cases"].items():
        hidden = ", ".join(f"{name} ({size})" for name, size in case["hidden"].items())
        body.append([rule, hidden, "; ".join(case["differences"]) or "as expected"])
    return rows(
        ["rule", "hidden (form, size)", "said"], body, texts=("hidden (form, size)", "said")
    )


def bench_sanity(result: Mapping[str, Any]) -> str:
    """Balances of the virtual bench, agreement with the model, and what a nominal fit leaves."""
    head = ["axis", "mass balance", "energy balance", "step", "x to model, no F_c, %"]
    head += ["x to model, F_c, %", "nominal fit: x, closed loop, % of motion"]
    body = []
    for seed, entry in result["axes"].items():
        apart = entry["agreement_percent"]
        narrowest = list(apart["with_coulomb_friction"].values())[-1]
        fit = result["nominal_fit"].get(seed)
        body.append(
            [
                seed,
                *(f"{entry[key]:.0e}" for key in ("mass_error", "energy_error")),
                f"{entry['step_errors'][-1]:.0e}",
                f"{apart['without_coulomb_friction']['x']:.0e}",
                f"{narrowest['x']:.3f}",
                "" if fit is None else f"{fit['closed_loop_x_percent_of_motion']:.3f}",
            ]
        )
    return rows(head, body)


def designs(result: Mapping[str, Any]) -> str:
    """Return what designed experiments promised, and what they gave."""
    head = ["axis", "gain predicted", "real / predicted standard errors"]
    sample = next(iter(result["separation"].values()))
    names = sample["hidden"], sample["wrong"]
    head += [f"probability of {name}" for name in names]
    body = []
    for axis, entry in result["precision"].items():
        quotients = [p["real"] / p["predicted"] for p in entry["parameters"].values()]
        verdict = result["separation"][axis]["said"]
        odds = [
            " → ".join(f"{answers['probability'][name]:.2f}" for answers in verdict)
            for name in names
        ]
        span = f"{min(quotients):.2f} to {max(quotients):.2f}"
        body.append([axis, f"{entry['gain']:.2f}", span, *odds])
    return rows(head, body)


def _moves(entry: Mapping[str, Any]) -> str:
    if entry["verdict"] != "absorbed":
        return ""
    return ", ".join(
        "flow map" if "map" in name else f"{SYMBOLS.get(name, name)} {shift:+.1f} %"
        for name, shift in entry["moved"].items()
    )


def _gap(gap: Mapping[str, Any] | None, view: str) -> str:
    return "failed" if gap is None else f"{gap[view]['gap_percent']:.2f}"


def _failed(entry: Mapping[str, Any]) -> str:
    return " (refit failed)" if entry.get("refit", {}).get("failure") else ""
