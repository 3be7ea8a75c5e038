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


def damaged(*results: Mapping[str, Any]) -> str:
    """Return cases and outcomes by what was owed, and the faults of all of them, for all seeds."""
    known: dict[str, set[str]] = {due: set() for due in OWED}
    outcomes = {due: Counter[str]() for due in OWED}
    for name, kind in (item for result in results for item in result["kinds"].items()):
        known[kind["due"]].add(name)
        outcomes[kind["due"]].update({k: n for k, n in kind.items() if k != "due"})
    told = ("refused", "severe", "finding")
    body = [
        [
            text,
            str(len(known[due])),
            *(str(outcomes[due][key]) for key in ("cases", *told)),
            str(outcomes[due]["cases"] - sum(outcomes[due][key] for key in told)),
        ]
        for due, text in OWED.items()
    ]
    faults = ", ".join(
        f"{name.replace('_', ' ')} {sum(result[name] for result in results)}" for name in FAULTS
    )
    cases, seeds = sum(result["cases"] for result in results), [r["seed"] for r in results]
    of_seeds = f"seeds {', '.join(map(str, seeds))}" if len(seeds) > 1 else f"seed {seeds[0]}"
    table = rows(["owed", "kinds", "cases", "refused", "severe", "finding", "accepted"], body)
    return f"{table}\n\nOf {cases:,} cases ({of_seeds}): {faults}."


def hostile(result: Mapping[str, Any]) -> str:
    """Return how many hostile files there are, and how many succeeded."""
    won = "".join(f"\n- {name}: {how}" for name, how in result["won"].items())
    return f"{result['files']} files, of which {result['succeeded']} succeeded.{won}"


def kills(result: Mapping[str, Any]) -> str:
    """Return what ended commands left behind, and how fast an interrupt ends them."""
    faults = {
        "half": "half outputs",
        "left_processes": "processes left after 5 s",
        "left_drafts": "drafts left after the next run",
        "different": "other results after it",
    }
    counted = ", ".join(f"{text} {result[name]}" for name, text in faults.items())
    head = ["command", "takes, s", "Ctrl-C to the end, longest, s"]
    body = [
        [
            name,
            f"{seconds:.1f}",
            f"{result['slowest'][name]:.2f}" if name in result["slowest"] else "",
        ]
        for name, seconds in sorted(result["commands"].items())
    ]
    return (
        f"Of {result['kills']} kills: {counted}. From Ctrl-C to the end: "
        f"{result['interrupt_s_p95']:.2f} s at the 95th percentile.\n\n{rows(head, body)}"
    )
