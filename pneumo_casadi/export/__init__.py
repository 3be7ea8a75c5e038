"""Identified models for other tools: JSON, CasADi functions, C, FMU, linear state space."""

from pneumo_casadi.export.c_code import write_c
from pneumo_casadi.export.casadi_functions import (
    ExportedFunctions,
    read_functions,
    write_functions,
)
from pneumo_casadi.export.export import Format, export_model
from pneumo_casadi.export.fmu import write_fmu
from pneumo_casadi.export.linear import (
    LinearAxis,
    OperatingPoint,
    linearise,
    operating_point,
    write_state_space,
)
from pneumo_casadi.export.model import (
    IdentifiedModel,
    identified_model,
    model_dict,
    read_model,
    write_model,
)

__all__ = [
    "ExportedFunctions",
    "Format",
    "IdentifiedModel",
    "LinearAxis",
    "OperatingPoint",
    "export_model",
    "identified_model",
    "linearise",
    "model_dict",
    "operating_point",
    "read_functions",
    "read_model",
    "write_c",
    "write_fmu",
    "write_functions",
    "write_model",
    "write_state_space",
]
