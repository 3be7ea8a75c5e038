"""Recordings of an axis: bench, channels, case folders, and checks of the data that are read."""

from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC, AxisKind, Balance
from pneumo_casadi.data.bench.bench import AnyBench, Bench, ForceBench, SensorNoise
from pneumo_casadi.data.bench.bench_file import read_bench
from pneumo_casadi.data.bench.controllers import (
    Controller,
    NestedController,
    ProportionalController,
)
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.case_folder import EXAMPLE, example_case, read_case, write_case
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.records import check_recording
from pneumo_casadi.data.emps import read_emps
from pneumo_casadi.data.readers.columns import Column, column_map, read_columns
from pneumo_casadi.data.readers.recordings import read_recording
from pneumo_casadi.data.recording.channels import UNITS, InputHold
from pneumo_casadi.data.recording.recording import Recording

__all__ = [
    "EXAMPLE",
    "FORCE_DRIVEN",
    "PNEUMATIC",
    "UNITS",
    "AnyBench",
    "AxisKind",
    "Balance",
    "Bench",
    "Case",
    "Column",
    "Controller",
    "Finding",
    "ForceBench",
    "Grade",
    "InputHold",
    "NestedController",
    "ProportionalController",
    "Recording",
    "SensorNoise",
    "check_recording",
    "column_map",
    "example_case",
    "read_bench",
    "read_case",
    "read_columns",
    "read_emps",
    "read_recording",
    "write_case",
]
