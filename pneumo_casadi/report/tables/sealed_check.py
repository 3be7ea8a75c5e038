"""The scores of a sealed check as a table."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.report.tables.table import Table

#: Shares: key, text.
SHARES = (
    ("right_first", "single effects: named, and nothing else"),
    ("ranked_first", "single effects: first in the ranking"),
    ("first_three", "single effects: among the first three"),
    ("set_covers", "single effects: among the possible causes named"),
    ("set_covers_given", "... if any are named"),
    ("pair_one", "pairs: at least one named"),
    ("pair_both", "pairs: both named"),
    ("pair_both_shown", "... if each shows beside the other"),
    ("false_alarm", "no effect: one named (false alarm)"),
    ("unknown_caught", "cause outside the catalogue: unknown"),
    ("unknown_caught_left_out", "... effect left out of the catalogue"),
    ("unknown_caught_never_listed", "... effect never in it"),
    ("wrongly_named", "cause outside the catalogue: one named"),
    ("false_unknown", "cause in the catalogue, or none: unknown"),
    ("located", "correct balance"),
    ("located_single", "... single effects"),
    ("absorbed_told", "absorbed by parameters: reported"),
    ("absorbed_misnamed", "absorbed by parameters: another effect named"),
    ("failed", "diagnosis failed"),
)


#: Shares of the cases with weak effects besides: key, text.
AMONG_WEAK = (
    ("names_true", "among weak effects: a name is true"),
    ("dominant_named", "among weak effects: the dominant one named"),
    ("dominant_first", "... named first"),
    ("largest_named", "among weak effects: the one with the largest gap named"),
    ("largest_first", "... named first"),
    ("pair_one", "pairs among weak effects: at least one named"),
    ("false_alarm", "weak effects only: one named that is not there"),
    ("unknown_caught", "among weak effects, cause outside the catalogue: unknown"),
    ("unknown_largest", "... if it has the largest gap"),
    ("located", "among weak effects: correct balance"),
)


def withheld_table(result: Mapping[str, Any]) -> Table:
    """Return the scores for all cases and for those whose cause is visible.

    Parameters
    ----------
    result : mapping
        As the sealed check returns it.

    Returns
    -------
    Table
        Shares with Wilson's intervals (95 %), then sizes and ratios, then rivals.
    """
    both = [result["scores"]["all"], result["scores"]["visible"]]
    rows = [(text, *(share_text(score[key]) for score in both)) for key, text in SHARES]
    rows += [
        (
            "mean number of possible causes named",
            *(_number(score["set_size"], "mean") for score in both),
        ),
        (
            "gap reduction relative to the true effect, median",
            *(_number(score["shrink_of_oracle"], "median") for score in both),
        ),
    ]
    weak = [result["background"]["all"], result["background"]["visible"]]
    rows += [(text, *(share_text(score[key]) for score in weak)) for key, text in AMONG_WEAK]
    rows += [(*row, "") for row in besides_rows(result)]
    term = result["discovered"]
    rows += [
        (
            "cause never listed: balance and driver of the term right",
            *(share_text(part["driver_right"]) for part in (term, term["visible"])),
        ),
        ("... gap that the term closes, median", _number(term["closes"], "median"), ""),
        ("causes listed, or none: a term told", share_text(term["false_term"]), ""),
    ]
    error = result["calibration"]["expected_calibration_error"]
    rows.append(("expected calibration error", "-" if error is None else f"{error:.3f}", ""))
    rows += _rivals([result["rivals"]["all"], result["rivals"]["visible"]])
    notes = [
        "Shares in % (Wilson's interval of 95 %) and counts. Visible: the effect increases a",
        "residual of the nominal model by at least half, or there is no effect. Absorbed: a refit",
        "of the nominal parameters compensates the effect.",
    ]
    if result["unmeasured"]:
        notes.append(
            f"{result['unmeasured']} cases could not be measured and count as not visible."
        )
    title = f"{result['cases']} cases whose causes were withheld"
    return Table(title, ("", "all", "visible"), tuple(rows), tuple(notes))


def besides_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return how often what is told besides is true; nothing of earlier results, without it."""
    if "besides" not in result:
        return []
    return [("told as probably also there: true", share_text(result["besides"]))]


def _rivals(both: list[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    kept = (
        ("training_error", "right_first", "ranking by training error: first"),
        ("training_error", "first_three", "ranking by training error: among the first three"),
        ("forward_aic", "right_first", "forward AIC: named, and nothing else"),
        ("forward_aic", "first_chosen", "forward AIC: chosen first"),
        ("forward_aic", "pair_both", "forward AIC: both of a pair named"),
        ("forward_aic", "false_alarm", "forward AIC: false alarms"),
    )
    rows = [(text, *(share_text(group[rival][key]) for group in both)) for rival, key, text in kept]
    for key, text in (
        ("right_first", "random ranking: first"),
        ("first_three", "random ranking: among the first three"),
    ):
        percents = [group["chance"][f"{key}_percent"] for group in both]
        rows.append((text, *("-" if percent is None else f"{percent:.1f}" for percent in percents)))
    return rows


def share_text(share: Mapping[str, Any]) -> str:
    """Return a share as text.

    Examples
    --------
    >>> share_text({"hits": 8, "of": 10, "percent": 80.0, "interval": [49.0, 94.3]})
    '80.0 (49-94) 8/10'
    """
    if share["percent"] is None:
        return "-"
    low, high = share["interval"]
    return f"{share['percent']:.1f} ({low:.0f}-{high:.0f}) {share['hits']}/{share['of']}"


def _number(value: Mapping[str, Any], key: str) -> str:
    return "-" if value[key] is None else f"{value[key]:.2f}"
