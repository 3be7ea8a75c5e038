"""Functions of one sample, evaluated for all samples of a record at once or one after another."""

from pneumo_casadi.model.along_record.array_function import ArrayFunction
from pneumo_casadi.model.along_record.mapped_function import (
    MappedFunction,
    evaluated_without_compiling,
)
from pneumo_casadi.model.along_record.record_function import RecordFunction
from pneumo_casadi.model.along_record.recursion import Recursion, compile_recursion
from pneumo_casadi.model.along_record.sample_function import (
    SampleFunction,
    compile_sample_functions,
)

__all__ = [
    "ArrayFunction",
    "MappedFunction",
    "RecordFunction",
    "Recursion",
    "SampleFunction",
    "compile_recursion",
    "compile_sample_functions",
    "evaluated_without_compiling",
]
