"""Diagnosis: where simulation and reality part, which effect causes it, how far the gap closes."""

from pneumo_casadi.diagnosis.decide.result import (
    Diagnosis,
    Verdict,
)
from pneumo_casadi.diagnosis.diagnose import DiagnosisOptions, applicable, diagnose, prepare
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    Check,
    EffectFound,
    Gap,
    Regime,
    Shrink,
    Value,
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
