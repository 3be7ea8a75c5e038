"""Tables on time and memory."""

from collections.abc import Mapping
from typing import Any

from tables.common import rows


def tools(entries: Mapping[str, Mapping[str, Any]]) -> str:
    """Time, memory and accuracy of every tool; failures stay in the table."""
    head = ["tool", "build s", "solve s", "peak GB", "cost", "largest error %", "reached"]
    body = []
    for name, row in entries.items():
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
    answers = (
        f"Ours, build and solve with a cold cache, is {result['speed_up_over_fastest_peer']:.1f} "
        f"times faster than the fastest peer that reaches the optimum ({result['fastest_peer']})."
    )
    return f"{answers}\n\n{tools(result['tools'])}"


def solvers(result: Mapping[str, Any]) -> str:
    """Solvers on our own problem."""
    return tools({"pneumo_casadi": result["tools"]["pneumo_casadi"]} | dict(result["solvers"]))


def scaling(result: Mapping[str, Any]) -> str:
    """Time and memory over the length of the record."""
    head = ["record", "samples", "WLS s", "OE s", "iterations", "iteration / sweep", "peak GB"]
    body = []
    for entry in [*result["records"], result["six_records"]]:
        parts = "" if entry["records"] == 1 else f" in {entry['records']} files"
        body.append(
            [
                f"{entry['length_s']:g} s{parts}",
                f"{entry['samples']:,}",
                f"{entry['wls_s']:.1f}",
                f"{entry['seconds']:.1f}",
                f"{entry['iterations']}",
                f"{entry['iteration_over_sweep']:.2f}",
                f"{entry['peak_GB']:.2f}",
            ]
        )
    return rows(head, body)


def batch(result: Mapping[str, Any]) -> str:
    """Return what a batch costs beside its diagnoses, and how much faster two workers are."""
    head = ["executor", "workers", "work a case, s", "outside it, ms", "outside, %", "speed-up"]
    body = [
        [
            name,
            f"{entry['workers']}",
            f"{entry['work_per_case_s']:.1f}",
            f"{1e3 * entry['outside_s_per_case']:.1f}",
            f"{entry['outside_percent']:.2f}",
            f"{entry['speed_up']:.2f}",
        ]
        for name, entry in result["executors"].items()
    ]
    return rows(head, body)
