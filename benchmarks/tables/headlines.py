"""The five headline figures of the README, from the committed results."""

from collections.abc import Mapping
from typing import Any

from tables.sealed_checks import counted


def headlines(
    table1: Mapping[str, Any],
    coverage: Mapping[str, Any],
    peers: Mapping[str, Any],
    *checks: Mapping[str, Any],
) -> str:
    """Return the list of headline figures, those of the sealed checks over all of them."""
    sentences = (
        largest_error(table1),
        coverage_range(coverage),
        named_alone(*checks),
        false_alarms(*checks),
        speed_up(peers),
    )
    return "\n".join(f"- {sentence}." for sentence in sentences)


def largest_error(result: Mapping[str, Any]) -> str:
    """Largest error of output error and of WLS on independent data of known truth."""
    worst = {
        key: max(abs(row[f"{key}_error_percent"]) for row in result["parameters"].values())
        for key in ("wls", "output_error")
    }
    return (
        "Record made by other equations, truth known: every parameter within "
        f"{worst['output_error']:.1f} % by output error, "
        f"within {worst['wls']:.1f} % by WLS (`python benchmarks/table1.py`)"
    )


def coverage_range(result: Mapping[str, Any]) -> str:
    """Coverage of the 95 % intervals of output error as printed."""
    under = [result, result["coloured"], *result["disturbed"].values()]
    printed = [
        item["coverage_percent"] for part in under for item in part["output_error_printed"].values()
    ]
    return (
        "Printed 95 % intervals of output error cover the truth in "
        f"{min(printed):.1f} to {max(printed):.1f} % of {result['replicates']:,} records, under "
        "white and coloured noise, disturbed or not (`python benchmarks/wls_vs_output_error.py`)"
    )


def named_alone(*checks: Mapping[str, Any]) -> str:
    """How often a visible hidden effect is named, and nothing else."""
    right = counted(checks, "scores", "visible", "right_first")
    return (
        f"Of {right.of} hidden effects large enough to be seen in the record, {right.hits} "
        f"were named, and nothing else with them (the last {len(checks)} sealed checks, "
        f"`python benchmarks/withheld.py --cases {checks[-1]['cases']}`)"
    )


def false_alarms(*checks: Mapping[str, Any]) -> str:
    """Return false alarms and causes outside the catalogue, of the same checks."""
    alarm = counted(checks, "scores", "all", "false_alarm")
    unknown = counted(checks, "scores", "all", "unknown_caught")
    return (
        f"In the same sealed checks: {alarm.hits} false {'alarm' if alarm.hits == 1 else 'alarms'} "
        f"in {alarm.of} cases without an effect, and {unknown.hits} of {unknown.of} causes outside "
        "the catalogue called `unknown`"
    )


def speed_up(result: Mapping[str, Any]) -> str:
    """Our time beside that of the fastest other tool that reaches the optimum."""
    ours, common = result["tools"]["pneumo_casadi"], result["problems"]["common"]
    fastest = common["fastest_cold"]
    theirs = result["tools"][fastest]["cold_s"]
    return (
        f"{result['samples']:,} samples fitted in {ours['cold_s']:.1f} s from the start of the "
        f"program, nothing compiled before; the fastest other tool, {fastest}, takes "
        f"{theirs:.1f} s (`python benchmarks/peers.py`)"
    )
