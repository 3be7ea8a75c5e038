"""Tables on the rules of the diagnosis: what moves of criteria and rules left out change."""

from collections.abc import Mapping
from typing import Any

from tables.common import rows


def criteria_moved(result: Mapping[str, Any]) -> str:
    """Return each criterion, its values, and how many verdicts change with it."""
    head = ["criterion", "value"]
    for way in ("lowered to", "raised to"):
        head += [way, "other word or first cause", "other causes beside"]
    body = []
    for row in result["criteria"]:
        cells = [f"`{row['criterion']}`", f"{row['value']:g}"]
        for way in ("lowered", "raised"):
            moved = row[way]
            beside = moved["beside_only"]
            cells += [f"{moved['value']:.3g}", str(len(moved["changed"]) - beside), str(beside)]
        body.append(cells)
    return rows(head, body)


def rules_off(result: Mapping[str, Any]) -> str:
    """Return each rule, where it acts, and what becomes of verdicts without it."""
    head = [
        "rule",
        "acts in",
        "right only with it",
        "right only without",
        "other, equally right or wrong",
    ]
    keys = ("worse_without", "better_without", "as_right")
    body = [
        [row["rule"], str(row["acts_in"]), *(str(len(row[key])) for key in keys)]
        for row in result["rules"]
    ]
    return rows(head, body)
