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
    VirtualAxis,
    VirtualSensors,
    VirtualValve,
    random_axis,
)
from pneumo_casadi.virtual_bench.case import SyntheticCase, make_case
from pneumo_casadi.virtual_bench.catalogue import (
    ALL_FORMS,
    FORMS,
    draw_background,
    effects_for,
    forms_of,
    weak_effects,
)
from pneumo_casadi.virtual_bench.effect import EffectForm, Severity, Size, VirtualEffect, scales
from pneumo_casadi.virtual_bench.experiment import KINDS, Excitation, Experiment
from pneumo_casadi.virtual_bench.laboratory import Laboratory
from pneumo_casadi.virtual_bench.sanity import Sanity, sanity
from pneumo_casadi.virtual_bench.simulation import Run, metered_map, record, simulate_axis

__all__ = [
    "ALL_FORMS",
    "FORMS",
    "IDEAL_SENSORS",
    "KINDS",
    "EffectForm",
    "Excitation",
    "Experiment",
    "Laboratory",
    "Run",
    "Sanity",
    "Severity",
    "Size",
    "SyntheticCase",
    "VirtualAxis",
    "VirtualEffect",
    "VirtualSensors",
    "VirtualValve",
    "draw_background",
    "effects_for",
    "forms_of",
    "make_case",
    "metered_map",
    "random_axis",
    "record",
    "sanity",
    "scales",
    "simulate_axis",
    "weak_effects",
]
