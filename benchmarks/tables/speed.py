"""Tables on time and memory."""

from collections.abc import Mapping
from statistics import median
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


#: How the times of a problem are called in tables.
TIMES = ("cold", "warm", "restart")
#: The problem whose tools stand at the head of the result.
COMMON = "common"


def problem(result: Mapping[str, Any], name: str) -> str:
    """Return the times of all tools on one problem, and what they amount to."""
    entry = result["problems"][name]
    told = [
        f"{time} {entry[f'speed_up_{time}']:.1f} ({entry[f'fastest_{time}']})"
        for time in TIMES
        if entry.get(f"speed_up_{time}") is not None
    ]
    head = [
        "tool",
        *(f"{label} s" for label in TIMES),
        "peak GB",
        "cost",
        "largest error %",
        "reached",
    ]
    body = []
    for tool, row in tools_of(result, name).items():
        label = f"{tool} {row['version']}" if "version" in row else tool
        if "failure" in row:
            body.append([label, *[""] * 6, row["failure"]])
            continue
        seconds = [row[f"{time}_s"] for time in TIMES]
        numbers = ["" if s is None else f"{s:.2f}" for s in seconds] + [f"{row['peak_GB']:.2f}"]
        numbers += [f"{row['cost']:.1f}", f"{row['parameter_error_percent']:.2f}"]
        body.append([label, *numbers, "yes" if row["reached"] else "no"])
    answer = f"Fastest other tool that reaches the optimum, in times of ours: {', '.join(told)}."
    return f"{answer}\n\n{rows(head, body)}"


def tools_of(result: Mapping[str, Any], name: str) -> Mapping[str, Mapping[str, Any]]:
    """Return a problem's tools."""
    found: Mapping[str, Mapping[str, Any]]
    found = result["tools"] if name == COMMON else result["problems"][name]["tools"]
    return found


def peers(result: Mapping[str, Any]) -> str:
    """Our time beside that of other tools on the same problem."""
    return problem(result, "common")


def peers_windows(result: Mapping[str, Any]) -> str:
    """Return the same on 40 windows."""
    return problem(result, "windows")


def peers_long(result: Mapping[str, Any]) -> str:
    """Return the same on a long record with all parameters free."""
    return problem(result, "long")


def peers_answer(result: Mapping[str, Any]) -> str:
    """How often as long the fastest other tool takes, on every problem."""
    head = ["problem", "ours cold s"]
    head += [f"fastest other, {label}" for label in TIMES]
    body = []
    for name, entry in result["problems"].items():
        ours = tools_of(result, name)["pneumo_casadi"]
        row = [entry["title"], f"{ours['cold_s']:.1f}"]
        for time in TIMES:
            ratio = entry[f"speed_up_{time}"]
            told = "" if ratio is None else f"{ratio:.1f} times ours, {entry[f'fastest_{time}']}"
            row.append(told)
        body.append(row)
    table = rows(head, body, head[2:])
    return f"{table}\n\nPreliminary: {note}." if (note := result.get("preliminary")) else table


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


def many_cases(result: Mapping[str, Any]) -> str:
    """Return what the process that holds a large batch takes."""
    head = ["cases", "record, s", "time, s", "memory before, MB", "at most, MB", "more, MB"]
    sizes = (result[key] for key in ("seconds", "before_MB", "largest_MB", "grown_MB"))
    line = [f"{result['cases']:,}", f"{result['duration_s']:g}", *(f"{size:.0f}" for size in sizes)]
    return rows(head, [line])


def diagnosis_time(result: Mapping[str, Any]) -> str:
    """Return how long a diagnosis takes."""
    practice, drawn = result["each"].values(), result["draws"].values()
    head = ["cases", "number", "median, s", "slowest, s", "most memory, GB"]
    cases = [
        ("practice, 20 s at 1 kHz", practice, result["peak_GB"]),
        ("drawn, 20 s at 1 kHz", drawn, result["draws_peak_GB"]),
        ("60 s at 5 kHz", [result["long_s"]], result["long_GB"]),
    ]
    table = rows(
        head,
        [
            [name, f"{len(times)}", f"{median(times):.1f}", f"{max(times):.1f}", f"{peak:.2f}"]
            for name, times, peak in cases
        ],
    )
    return f"{table}\n\nWith an empty cache at most {result['cold_extra_s']:.1f} s more."
