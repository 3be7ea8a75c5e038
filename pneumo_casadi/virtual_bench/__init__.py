"""The virtual bench: a second description of the axis, for recordings whose causes are known.

It shares no equation with the model: spool-edge valves, mass and energy balances where heat is
exchanged, set-valued friction with events, sensors that quantise; and effects in forms of its
own. It imports the recordings alone and needs the extra ``bench``.

Examples
--------
>>> axis = random_axis(7)
>>> hidden = effects_for(axis, {"stribeck": "medium"}, seed=7)
>>> made = record(axis, Experiment.of("creep"), hidden, fs=1000.0, duration=0.2, seed=7)
>>> made.N, made.names
(200, ('u_P', 'u_N', 'p_P', 'p_N', 'x', 'x_ref'))
"""

from pneumo_casadi.virtual_bench.axis import (
    IDEAL_SENSORS,
    BenchAxis,
    BenchSensors,
    BenchValve,
    random_axis,
)
from pneumo_casadi.virtual_bench.case import MadeCase, make_case
from pneumo_casadi.virtual_bench.effect import BenchEffect, EffectForm, Severity, Size, scales
from pneumo_casadi.virtual_bench.experiment import KINDS, Excitation, Experiment
from pneumo_casadi.virtual_bench.forms import FORMS, effects_for
from pneumo_casadi.virtual_bench.running import Run, metered_map, record, run_bench
from pneumo_casadi.virtual_bench.sanity import Sanity, sanity

__all__ = [
    "FORMS",
    "IDEAL_SENSORS",
    "KINDS",
    "BenchAxis",
    "BenchEffect",
    "BenchSensors",
    "BenchValve",
    "EffectForm",
    "Excitation",
    "Experiment",
    "MadeCase",
    "Run",
    "Sanity",
    "Severity",
    "Size",
    "effects_for",
    "make_case",
    "metered_map",
    "random_axis",
    "record",
    "run_bench",
    "sanity",
    "scales",
]
