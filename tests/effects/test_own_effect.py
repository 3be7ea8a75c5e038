"""An effect of one's own needs no registration: simulation, regression and output error take it."""

import numpy as np
import pytest

from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.model.simulation import simulate, simulate_closed_loop
from pneumo_casadi.parameters import Parameter


@pytest.fixture(scope="module")
def own():
    """An effect as a notebook would define it: no metadata, no file, no line in the index."""

    class Magnet(Effect):
        """A pull to mid-stroke that grows with the cube of the distance."""

        name = "magnet"
        parameters = (Parameter("c", 0.0, "N/m3", lower=0.0, scale=1e4, null=0.0),)

        def force(self, F, at):
            return F - at["c"] * at.x**3

    return Magnet


@pytest.fixture(scope="module")
def pulled(made, own):
    """An axis with the effect, and a record of it under control."""
    axis = made.true_force_axis(own()).with_parameters({"magnet.c": 3e4})
    u, x = made.controlled(axis, 2000)
    return axis, made.recorded(axis, u, x, 0)


def test_it_is_simulated(made, own, pulled):
    axis, record = pulled
    u, start = record["F"][:, None], [record["x"][0], 0.0]
    pulled_back, nominal = (
        simulate(a, u, record.dt, start) for a in (axis, made.true_force_axis(own()))
    )
    assert np.abs(pulled_back["x"] - nominal["x"]).max() > 1e-2
    assert own.name not in EFFECTS


def test_it_joins_the_regression_because_it_is_linear(made, own, pulled):
    axis, record = pulled
    fit = fit_wls(made.true_force_axis(own()), record)
    assert "magnet.c" in fit.names
    assert fit.parameters["magnet.c"].value == pytest.approx(3e4, rel=0.03)
    assert fit.parameters["M"].value == pytest.approx(axis.parameters["M"].value, rel=0.01)


def test_it_is_fitted_by_output_error_with_an_interval(made, own, pulled):
    _, record = pulled
    options = OutputErrorOptions(widths=(made.FORCE_TRUE["v_s"],))
    result = fit_output_error(made.true_force_axis(own()), [record], options=options)
    std = result.std("magnet.c")
    assert 0 < 8 * std < 3e4
    assert abs(result.parameters["magnet.c"].value - 3e4) < 4 * std


def test_one_with_a_state_of_its_own_works_as_well(made):
    class Creep(Effect):
        name = "creep"
        parameters = (Parameter("k", 0.0, "N/m", null=0.0),)
        states = (State("x_slow", "m"),)

        def rest(self, entering, at):
            return {"x_slow": at.x}

        def rates(self, entering, at):
            return {"x_slow": (at.x - at["x_slow"]) / 0.1}

        def force(self, F, at):
            return F - at["k"] * (at.x - at["x_slow"])

    axis = made.true_axis(Creep()).with_parameters({"creep.k": 200.0})
    run = simulate_closed_loop(axis, 0.05 * np.ones(400), 1e-3, [3.5e5, 4.7e5, 0.0, 0.0])
    np.testing.assert_allclose(
        np.gradient(run["creep.x_slow"], 1e-3)[5:-5],
        ((run["x"] - run["creep.x_slow"]) / 0.1)[5:-5],
        atol=2e-3,
    )
    assert "creep.k" not in axis.regressor_names
