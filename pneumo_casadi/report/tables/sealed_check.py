"""The scores of a sealed check as a table."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.report.tables.results import Table

#: Shares: key, what it says.
SHARES = (
    ("right_first", "singles: named, and nothing else"),
    ("ranked_first", "singles: first in the ranking"),
    ("first_three", "singles: among the first three"),
    ("set_covers", "singles: in the set offered"),
    ("set_covers_given", "... where a set is offered"),
    ("pair_one", "pairs: one named"),
    ("pair_both", "pairs: both named"),
    ("false_alarm", "nothing wrong: one named"),
    ("unknown_caught", "cause in no list: unknown"),
    ("unknown_caught_left_out", "... left out of this catalogue"),
    ("unknown_caught_never_listed", "... never in it"),
    ("wrongly_named", "cause in no list: one named"),
    ("false_unknown", "listed or none: unknown"),
    ("located", "right balance"),
    ("located_single", "... of singles"),
    ("absorbed_told", "absorbed: told"),
    ("absorbed_misnamed", "absorbed: another named"),
    ("failed", "diagnosis failed"),
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
        ("mean size of the set", *(_number(score["set_size"], "mean") for score in both)),
        (
            "median shrink over an oracle's",
            *(_number(score["shrink_of_oracle"], "median") for score in both),
        ),
    ]
    error = result["calibration"]["expected_calibration_error"]
    rows.append(("expected calibration error", "-" if error is None else f"{error:.3f}", ""))
    rows += _rivals([result["rivals"]["all"], result["rivals"]["visible"]])
    notes = [
        "Shares in % (Wilson's interval of 95 %) and counts. Visible: the cause makes a residual",
        "of the nominal axis half as large again as without it, or nothing is wrong.",
    ]
    if result["unmeasured"]:
        notes.append(f"{result['unmeasured']} cases could not be measured and count as not visible")
    title = f"{result['cases']} cases whose causes were withheld"
    return Table(title, ("", "all", "visible"), tuple(rows), tuple(notes))


def _rivals(both: list[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    kept = (
        ("training_error", "right_first", "by training error: first"),
        ("training_error", "first_three", "by training error: among three"),
        ("forward_aic", "right_first", "forward AIC: named, nothing else"),
        ("forward_aic", "first_chosen", "forward AIC: chosen first"),
        ("forward_aic", "pair_both", "forward AIC: both of a pair"),
        ("forward_aic", "false_alarm", "forward AIC: false alarms"),
    )
    rows = [(text, *(share_text(group[rival][key]) for group in both)) for rival, key, text in kept]
    for key, text in (("right_first", "chance: first"), ("first_three", "chance: among three")):
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
