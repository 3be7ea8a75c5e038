"""Diagnosis: where simulation and reality part, which effect causes it, how far the gap closes."""

from pneumo_casadi.diagnosis.diagnose import DiagnosisOptions, applicable, diagnose, prepare
from pneumo_casadi.diagnosis.findings import (
    Candidate,
    Check,
    EffectFound,
    Gap,
    Regime,
    Shrink,
    Value,
    Where,
)
from pneumo_casadi.diagnosis.result import (
    Diagnosis,
    Verdict,
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
