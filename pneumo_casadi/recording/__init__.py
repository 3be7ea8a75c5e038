"""Recordings of an axis: bench, channels, case folders, and the checks at the door."""

from pneumo_casadi.recording.bench import AnyBench, Bench, ForceBench, SensorNoise
from pneumo_casadi.recording.bench_file import read_bench
from pneumo_casadi.recording.case import Case, load_case
from pneumo_casadi.recording.channels import UNITS, InputHold
from pneumo_casadi.recording.checks import check_recording
from pneumo_casadi.recording.controllers import (
    Controller,
    NestedController,
    ProportionalController,
)
from pneumo_casadi.recording.emps import load_emps
from pneumo_casadi.recording.mapping import column_map, read_columns
from pneumo_casadi.recording.reading import Column, read_recording
from pneumo_casadi.recording.recording import Recording
from pneumo_casadi.recording.writing import write_case

__all__ = [
    "UNITS",
    "AnyBench",
    "Bench",
    "Case",
    "Column",
    "Controller",
    "ForceBench",
    "InputHold",
    "NestedController",
    "ProportionalController",
    "Recording",
    "SensorNoise",
    "check_recording",
    "column_map",
    "load_case",
    "load_emps",
    "read_bench",
    "read_columns",
    "read_recording",
    "write_case",
]
