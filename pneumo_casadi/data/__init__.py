"""Recordings of an axis: bench, channels, case folders, and checks of the data that are read."""

from pneumo_casadi.data.bench.axis_kind import FORCE_DRIVEN, PNEUMATIC, AxisKind, Balance
from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.bench_file import read_bench
from pneumo_casadi.data.bench.controllers import (
    Controller,
    CustomController,
    NestedController,
    NoController,
    ProportionalController,
)
from pneumo_casadi.data.bench.driven_bench import AnyBench, ForceBench, PressureBench
from pneumo_casadi.data.bench.load import Load
from pneumo_casadi.data.bench.pid_controllers import (
    AntiWindup,
    CascadeController,
    PidController,
)
from pneumo_casadi.data.bench.sensor_noise import SensorNoise
from pneumo_casadi.data.bench.valve_source import Arrangement, FlowSource, ValveData, Valves
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.case_folder import EXAMPLE, example_case, read_case, write_case
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.emps import read_emps
from pneumo_casadi.data.readers.columns import Column, column_map, read_columns
from pneumo_casadi.data.readers.recordings import read_recording
from pneumo_casadi.data.record_checks import check_recording, check_records
from pneumo_casadi.data.recording.channels import UNITS, InputHold
from pneumo_casadi.data.recording.clock import Clock
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.seal_friction import read_seal_friction

__all__ = [
    "EXAMPLE",
    "FORCE_DRIVEN",
    "PNEUMATIC",
    "UNITS",
    "AntiWindup",
    "AnyBench",
    "Arrangement",
    "AxisKind",
    "Balance",
    "Bench",
    "CascadeController",
    "Case",
    "Clock",
    "Column",
    "Controller",
    "CustomController",
    "Finding",
    "FlowSource",
    "ForceBench",
    "Grade",
    "InputHold",
    "Load",
    "NestedController",
    "NoController",
    "PidController",
    "PressureBench",
    "ProportionalController",
    "Recording",
    "SensorNoise",
    "ValveData",
    "Valves",
    "check_recording",
    "check_records",
    "column_map",
    "example_case",
    "read_bench",
    "read_case",
    "read_columns",
    "read_emps",
    "read_recording",
    "read_seal_friction",
    "write_case",
]
