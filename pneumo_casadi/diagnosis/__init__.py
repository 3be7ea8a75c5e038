"""Diagnosis: where simulation and reality part, which effect causes it, how far the gap closes."""

from pneumo_casadi.diagnosis.decide.result import (
    Diagnosis,
    Verdict,
)
from pneumo_casadi.diagnosis.diagnose import DiagnosisOptions, applicable, diagnose, prepare
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    Check,
    Closure,
    EffectFound,
    Gap,
    Regime,
    Value,
    Where,
)

__all__ = [
    "Candidate",
    "Check",
    "Closure",
    "Diagnosis",
    "DiagnosisOptions",
    "EffectFound",
    "Gap",
    "Regime",
    "Value",
    "Verdict",
    "Where",
    "applicable",
    "diagnose",
    "prepare",
]
