"""Diagnosis: where simulation and measurement disagree, which effect causes it, what it closes."""

from pneumo_casadi.diagnosis.diagnose import DiagnosisOptions, diagnose
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    Check,
    Closure,
    EffectFound,
    Gap,
    Value,
    Where,
)
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, Regime, RegimeKind
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import Criteria
from pneumo_casadi.diagnosis.prepare.prepare_study import applicable, prepare_study
from pneumo_casadi.diagnosis.refined_identification import (
    options_of_diagnosis,
    refine_diagnosis,
)
from pneumo_casadi.diagnosis.result.diagnosis_result import Diagnosis
from pneumo_casadi.diagnosis.result.read_diagnosis import read_diagnosis

__all__ = [
    "Candidate",
    "Check",
    "Closure",
    "Condition",
    "Criteria",
    "Diagnosis",
    "DiagnosisOptions",
    "EffectFound",
    "Gap",
    "Location",
    "Regime",
    "RegimeKind",
    "Value",
    "Verdict",
    "Where",
    "applicable",
    "diagnose",
    "options_of_diagnosis",
    "prepare_study",
    "read_diagnosis",
    "refine_diagnosis",
]
