"""Errors of a metered flow map in the rows of a regression."""

import numpy as np
import pytest

import pneumo_casadi as pc
from pneumo_casadi.estimation.wls.evaluation import evaluate_regressor
from pneumo_casadi.estimation.wls.flow_map_error import covariance_root, flow_map_error
from pneumo_casadi.model.servosystem import Servosystem
from pneumo_casadi.signals import filter_recording, parallel_decimate, plan_filters_for
from pneumo_casadi.valve import fit_iso6358, fit_polynomials, read_flow_map


@pytest.fixture(scope="module")
def table1_case():
    return pc.example_case()


@pytest.fixture(scope="module", params=["polynomials", "iso6358"])
def axis(request, table1_case):
    bench = table1_case.bench
    table = read_flow_map(table1_case.flow_map_path, p_supply=bench.p_supply, p_ext=bench.p_ext)
    fit = fit_polynomials if request.param == "polynomials" else fit_iso6358
    return Servosystem(bench, fit(table))


def test_they_are_what_a_standard_deviation_of_the_coefficients_does_to_y(axis, table1_case):
    record = table1_case.identify[0]
    plan = plan_filters_for([record])
    filtered = filter_recording(record, plan, None)
    shared = flow_map_error(axis, filtered, plan)
    L = covariance_root(axis.flow.covariance)
    names, values = axis.flow_parameters, np.array(axis.flow.parameters.values)
    for k in (0, L.shape[1] - 1):
        Y = []
        for step in (1e-3, -1e-3):
            shifted = axis.with_parameters(dict(zip(names, values + step * L[:, k], strict=True)))
            Y.append(evaluate_regressor(shifted, filtered, axis.regressor_names)[0])
        slope = ((Y[0] - Y[1]) / 2e-3).T
        expected = parallel_decimate(slope, plan.factor, plan.decimation).T
        size = np.linalg.norm(expected)
        assert 0 < np.linalg.norm(shared[:, :, k] - expected) < 0.1 * size
        assert not shared[2].any()  # the force balance holds no flow


def test_the_root_gives_back_the_covariance(axis):
    L = covariance_root(axis.flow.covariance)
    known = np.isfinite(np.diag(axis.flow.covariance))
    C = axis.flow.covariance[np.ix_(known, known)]
    size = np.sqrt(np.diag(C))
    np.testing.assert_allclose(
        (L @ L.T)[np.ix_(known, known)] / np.outer(size, size), C / np.outer(size, size), atol=1e-9
    )


def test_a_model_without_a_metered_map_has_none(made):
    record = made.smooth_record(1)
    plan = plan_filters_for([record])
    filtered = filter_recording(record, plan, None)
    assert flow_map_error(made.Eq7(), filtered, plan).shape[2] == 0
