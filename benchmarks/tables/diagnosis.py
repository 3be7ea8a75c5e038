"""Tables on the diagnosis, the virtual bench and designed experiments."""

from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from pneumo_casadi.report.tables.sealed_check import AMONG_WEAK, SHARES, besides_rows, share_text
from tables.common import SYMBOLS, rows

SCOPES = ("all", "visible")
#: Kinds of sensor noise.
NOISES = ("white", "coloured")
#: What a gap is measured in.
VIEWS = ("closed_loop", "windows")
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


#: Asked of the check in which forms are drawn and half of the cases have weak effects besides.
ASKED_OF_FORMS = {
    "right_first": "≥ 96 visible, ≥ 80 all",
    "set_covers": "≥ 97 visible",
    "pair_one": "≥ 96",
    "pair_both": "≥ 80",
    "false_alarm": "≤ 3",
    "unknown_caught": "≥ 92",
    "wrongly_named": "≤ 2",
    "located": "≥ 95 visible",
}
#: The same among weak effects.
ASKED_AMONG_WEAK = {
    "names_true": "≥ 97 visible",
    "dominant_named": "≥ 95 visible",
    "dominant_first": "≥ 88 visible",
}


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


def _shares(
    both: Sequence[Mapping[str, Any]], shares: Iterable[tuple[str, str]], asked: Mapping[str, str]
) -> list[list[str]]:
    """Return a row a share: of all cases, of the visible ones, and what is asked."""
    return [
        [text, *(share_text(entry[key]) for entry in both), asked.get(key, "")]
        for key, text in shares
        if key not in ("set_covers_given", "failed") and all(key in entry for entry in both)
    ]


def withheld(result: Mapping[str, Any]) -> str:
    """Return what the sealed check counted, beside what was asked of it."""
    both = [result["scores"][scope] for scope in SCOPES]
    body = _shares(both, SHARES, ASKED)

    def figures(key: str, name: str) -> list[str]:
        return [f"{entry[key][name]:.2f}" for entry in both]

    body.append(["mean number of possible causes named", *figures("set_size", "mean"), "≤ 1.5"])
    body.append(
        [
            "gap reduction relative to the true effect, median",
            *figures("shrink_of_oracle", "median"),
            "≥ 0.9",
        ]
    )
    error = result["calibration"]["expected_calibration_error"]
    body.append(["expected calibration error", f"{error:.3f}", "", "≤ 0.08"])
    for rival, key, text in (
        ("training_error", "right_first", "alternative, ranking by training error: first"),
        ("forward_aic", "right_first", "alternative, forward AIC: named, and nothing else"),
        ("forward_aic", "pair_both", "alternative, forward AIC: both of a pair"),
        ("forward_aic", "false_alarm", "alternative, forward AIC: false alarms"),
    ):
        shares = (result["rivals"][scope][rival][key] for scope in SCOPES)
        body.append([text, *map(share_text, shares), ""])
    chance = [result["rivals"][scope]["chance"]["right_first_percent"] for scope in SCOPES]
    body.append(["alternative, random ranking: first", *(f"{share:.1f}" for share in chance), ""])
    return rows(["% (95 % interval) count", "all", "visible", "target"], body)


def withheld_forms(result: Mapping[str, Any]) -> str:
    """Return the same of the check with forms drawn, and what was counted among weak effects."""
    both, weak = ([result[part][scope] for scope in SCOPES] for part in ("scores", "background"))
    body = _shares(both, SHARES, ASKED_OF_FORMS) + _shares(weak, AMONG_WEAK, ASKED_AMONG_WEAK)
    body += [[*row, "", ""] for row in besides_rows(result)]
    term = result["discovered"]
    shown = share_text(term["visible"]["driver_right"]) if "visible" in term else ""
    right = share_text(term["driver_right"]), shown
    false = share_text(term["false_term"])
    body.append(
        ["cause never listed: balance and driver of the term right", *right, "≥ 85 visible"]
    )
    body.append(["... share of the gap it closes", f"{term['closes']['median']:.2f}", "", "≥ 0.7"])
    body.append(["causes listed, or none: a term told", false, "", "≤ 3"])
    error, exact = (
        result["calibration"][key] for key in ("expected_calibration_error", "error_if_exact")
    )
    body.append(["expected calibration error", f"{error:.3f}", "", "≤ 0.05"])
    body.append(["... mean of as many exact probabilities", f"{exact:.3f}", "", ""])
    return rows(["% (95 % interval) count", "all", "visible", "target"], body)


def withheld_effects(result: Mapping[str, Any]) -> str:
    """Return how often each single effect was named, by severity."""
    severities = ("small", "medium", "large")
    body = []
    for name, entries in result["effects"].items():
        cells = (entries.get(severity) for severity in severities)
        body.append([name, *("" if c is None else _counted(c) for c in cells)])
    return rows(["effect", *severities], body)


def _counted(cell: Mapping[str, int]) -> str:
    verdict = f"{cell['right_first']} of {cell['of']}"
    return verdict if cell["visible"] == cell["of"] else f"{verdict} ({cell['visible']} visible)"


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
