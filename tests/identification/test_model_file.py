"""What a file says of an axis besides bench, flow and parameters: the signals recorded."""

import json
from dataclasses import replace

import pytest

from pneumo_casadi.data import PressureBench
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.model_file import axis_dict, axis_from_dict
from pneumo_casadi.model.servosystem import Servosystem, nominal_axis


@pytest.fixture(scope="module")
def axes(made):
    """A servo axis and the mass alone, with signals that a laboratory records besides."""
    servo = replace(made.BENCH, signals=frozenset({"p_supply", "F_load", "v"}), noise=None)
    mass = PressureBench(1e3, 8.75e-4, 6.03e-4, 0.5, 1e5, signals=frozenset({"F_load", "v"}))
    return Servosystem(servo, made.true_flow()), nominal_axis(mass, None)


def test_further_signals_of_the_bench_survive(axes):
    for axis in axes:
        read = axis_from_dict(json.loads(json.dumps(axis_dict(axis))))
        assert read.bench.signals == axis.bench.signals
        assert (read.inputs, read.outputs) == (axis.inputs, axis.outputs)
        assert read.parameters.names == axis.parameters.names


def test_a_file_from_before_there_were_signals_has_none(made):
    content = axis_dict(made.true_axis())
    assert content.pop("signals") == []
    assert axis_from_dict(content).inputs == ("u_P", "u_N")
    with pytest.raises(CaseError, match="signals"):
        axis_from_dict(content | {"signals": "v"})
