"""Many cases at once: on this machine's processors or a cluster's, resumed after interruptions."""

from pneumo_casadi.evaluation.batch.run import (
    case_folders,
    diagnose_many,
    diagnose_one,
    real_diagnosis,
)
from pneumo_casadi.evaluation.batch.table import CSV, FAILED, PARQUET, Row, write_tables

__all__ = [
    "CSV",
    "FAILED",
    "PARQUET",
    "Row",
    "case_folders",
    "diagnose_many",
    "diagnose_one",
    "real_diagnosis",
    "write_tables",
]
