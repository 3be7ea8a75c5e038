"""Warnings about a result: found, graded by one table, and what they make of the result."""

from pneumo_casadi.identification.warnings.grading import (
    CONDITIONS,
    LIMITS,
    Limit,
    ResultWarning,
    Usability,
    Usable,
    judge_usability,
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
    "inflation",
    "judge_usability",
    "largest_gap",
    "result_warnings",
    "simulation_sentence",
    "validation_warnings",
]
