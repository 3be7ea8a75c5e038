"""Tables on damaged and hostile files."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from tables.common import rows

#: What a reader owes, by its word in the result.
OWED = {
    "refuse": "an error that names the file, or a severe finding",
    "finding": "an error or a finding",
    "accept": "no error: a valid variant",
    "any": "no crash: what is hit decides",
}
FAULTS = ("tracebacks", "hangs", "crashes", "silent", "valid_refused", "nameless")


def damaged(result: Mapping[str, Any]) -> str:
    """Return cases and outcomes by what was owed, and the faults of all of them."""
    kinds, outcomes = Counter[str](), {due: Counter[str]() for due in OWED}
    for kind in result["kinds"].values():
        kinds[kind["due"]] += 1
        outcomes[kind["due"]].update({k: n for k, n in kind.items() if k != "due"})
    told = ("refused", "severe", "finding")
    body = [
        [
            text,
            str(kinds[due]),
            *(str(outcomes[due][key]) for key in ("cases", *told)),
            str(outcomes[due]["cases"] - sum(outcomes[due][key] for key in told)),
        ]
        for due, text in OWED.items()
    ]
    faults = ", ".join(f"{name.replace('_', ' ')} {result[name]}" for name in FAULTS)
    table = rows(["owed", "kinds", "cases", "refused", "severe", "finding", "accepted"], body)
    return f"{table}\n\nOf {result['cases']} cases: {faults}."


def hostile(result: Mapping[str, Any]) -> str:
    """Return how many hostile files there are, and how many succeeded."""
    won = "".join(f"\n- {name}: {how}" for name, how in result["won"].items())
    return f"{result['files']} files, of which {result['succeeded']} succeeded.{won}"
