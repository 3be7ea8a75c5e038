"""Diagnosis: where simulation and reality part, which effect causes it, how far the gap closes."""

from pneumo_casadi.diagnosis.diagnose import DiagnosisOptions, applicable, diagnose, prepare
from pneumo_casadi.diagnosis.result import (
    Candidate,
    Check,
    Diagnosis,
    EffectFound,
    Gap,
    Regime,
    Shrink,
    Value,
    Verdict,
    Where,
)

__all__ = [
    "Candidate",
    "Check",
    "Diagnosis",
    "DiagnosisOptions",
    "EffectFound",
    "Gap",
    "Regime",
    "Shrink",
    "Value",
    "Verdict",
    "Where",
    "applicable",
    "diagnose",
    "prepare",
]
