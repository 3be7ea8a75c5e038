"""Warnings about a result: found, graded by one table, and what they make of the result."""

from pneumo_casadi.identification.warnings.grading import (
    CONDITIONS,
    LIMITS,
    Limit,
    ResultWarning,
    Usability,
    Usable,
    in_order,
    judge_usability,
    met,
)
from pneumo_casadi.identification.warnings.result_warnings import (
    inflation,
    largest_gap,
    result_warnings,
    simulation_sentence,
    validation_warnings,
)

__all__ = [
    "CONDITIONS",
    "LIMITS",
    "Limit",
    "ResultWarning",
    "Usability",
    "Usable",
    "in_order",
    "inflation",
    "judge_usability",
    "largest_gap",
    "met",
    "result_warnings",
    "simulation_sentence",
    "validation_warnings",
]
