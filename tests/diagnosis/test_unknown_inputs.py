"""Unknown inputs of the balances."""

import time
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import read_case
from pneumo_casadi.diagnosis.locate.signatures import residual_floor
from pneumo_casadi.diagnosis.locate.unknown_inputs import unknown_inputs
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.study import start_study
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import make_axis
from pneumo_casadi.valve import FlowForm
from pneumo_casadi.virtual_bench import make_case, random_axis


def opened(folder, effects, duration=5.0):
    axis = replace(random_axis(5), F_c_plus=14.0, F_c_minus=18.0)
    made = make_case(folder / "case", 5, effects, duration=duration, axis=axis)
    case = read_case(made.case.folder)
    table, flow = read_flow(case, IdentifyOptions(FlowForm.POLYNOMIALS))
    study = start_study(make_axis(case, flow), table, case.identify, case.validate)
    return study, made


@pytest.fixture(scope="module")
def nothing(tmp_path_factory):
    study, _ = opened(tmp_path_factory.mktemp("nothing"), {}, duration=10.0)
    return study, fit_model(study, ())


@pytest.mark.slow
def test_nothing_is_missing_where_nothing_is_wrong(nothing):
    study, nominal = nothing
    inputs = unknown_inputs(study.axis, nominal.values, study.smoothed[1][0])
    assert np.all(np.sqrt(inputs.energy) < 0.015)
    # The bands hold: beyond three of them lies next to nothing but misfit of the form.
    outside = np.abs(inputs.w) > 3 * inputs.std
    assert np.all(outside[:2].mean(axis=1) < 0.1)


@pytest.mark.slow
def test_the_input_of_a_chamber_is_its_leak_where_all_else_is_known(tmp_path):
    study, made = opened(tmp_path, {"leakage_P": {"q": 1.5e-3}})
    (leak,) = made.effects
    true = made.axis.truth
    # At the true parameters and the metered map, all that is missing is the leak.
    values = study.axis.parameters.as_dict() | dict(true)
    data = study.smoothed[1][0]
    inputs = unknown_inputs(study.axis, values, data)
    p, c = inputs.states[0], study.axis.constants
    q = leak.parameters["q"] * (p**2 - c["p_ext"] ** 2) / (c["p_supply"] ** 2 - c["p_ext"] ** 2)
    error = inputs.w[0] + q
    assert np.sqrt(np.mean(error**2)) < 0.15 * np.mean(q)
    assert inputs.energy[0] > 50 * inputs.energy[1]


@pytest.mark.slow
def test_the_force_that_is_missing_is_found_as_large_as_it_is(tmp_path):
    study, made = opened(tmp_path, {"vibration": {"A": 12.0, "f": 6.0}})
    nominal = fit_model(study, ())
    data = study.smoothed[1][0]
    inputs = unknown_inputs(study.axis, nominal.values, data)
    w = np.where(inputs.counts[2], inputs.w[2], 0.0)
    phases = np.exp(-2j * np.pi * 6.0 * inputs.t)
    amplitude = 2 * abs(np.sum(w * phases)) / inputs.counts[2].sum()
    assert made.effects[0].parameters["A"] == 12.0
    assert amplitude == pytest.approx(12.0, rel=0.15)
    assert inputs.energy[2] > 100 * inputs.energy[:2].max()


@pytest.mark.slow
def test_smoothing_agrees_with_the_residuals_along_the_motion(tmp_path):
    study, _ = opened(tmp_path, {"piston_seal_leakage": "large"})
    nominal = fit_model(study, ())
    data = study.smoothed[1][0]
    inputs = unknown_inputs(study.axis, nominal.values, data)
    names = study.axis.motion_states
    capacity = nominal.values["X_s1"] + nominal.values["X_s2"] * data.x[names.index("x")]
    w = np.interp(data.t, inputs.t, inputs.w[0])
    # Where the balance has too much, an input must take it away.
    expected = data.averaged(-(w / capacity))
    residual = nominal.held_out[0][0]
    noise = residual_floor(study.axis, nominal.values, data)[0]
    assert np.std(residual) > 1.8 * noise
    assert np.std(residual - expected) < 1.1 * noise


@pytest.mark.slow
def test_a_record_of_ten_seconds_takes_less_than_two(nothing):
    study, nominal = nothing
    data = study.smoothed[1][0]
    began = time.process_time()
    unknown_inputs(study.axis, nominal.values, data)
    assert time.process_time() - began < 2.0
