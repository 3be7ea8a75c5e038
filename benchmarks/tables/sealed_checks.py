"""Tables of the sealed checks."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pneumo_casadi.evaluation.sealed_check import Share
from pneumo_casadi.report.tables.sealed_check import AMONG_WEAK, SHARES, besides_rows, share_text
from tables.common import rows

SCOPES = ("all", "visible")
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
    body += _calibration_rows(result["calibration"])
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


def several(calibration: Mapping[str, Any], *checks: Mapping[str, Any]) -> str:
    """Return what is asked of a sealed check, counted over several of them together."""
    body = []
    for part, texts, asked in (
        ("scores", SHARES, ASKED_OF_FORMS | {"pair_both_shown": ""}),
        ("background", AMONG_WEAK, ASKED_AMONG_WEAK),
    ):
        for key, text in texts:
            if key in asked:
                shares = (counted(checks, part, scope, key).as_dict() for scope in SCOPES)
                body.append([text, *map(share_text, shares), asked[key]])
    body += _calibration_rows(calibration["together"], f" ({calibration['cases']} cases)")
    head = f"{len(checks)} checks, {sum(check['cases'] for check in checks):,} cases"
    return rows([head, "all", "visible", "target"], body)


def counted(checks: Sequence[Mapping[str, Any]], part: str, scope: str, key: str) -> Share:
    """Return how often something was right in several sealed checks, and of how many."""
    shares = [check[part][scope][key] for check in checks]
    return Share(sum(share["hits"] for share in shares), sum(share["of"] for share in shares))


def _calibration_rows(calibration: Mapping[str, Any], of: str = "") -> list[list[str]]:
    """Return what probabilities are off, and what exact ones would seem to be."""
    error, exact = calibration["expected_calibration_error"], calibration["error_if_exact"]
    return [
        [f"expected calibration error{of}", f"{error:.3f}", "", "≤ 0.05"],
        ["... mean of as many exact probabilities", f"{exact:.3f}", "", ""],
    ]
