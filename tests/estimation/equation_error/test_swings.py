"""A load that swings when a record begins: nobody has measured how, and the fit leaves it out."""

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.effects import ElasticLoad
from pneumo_casadi.estimation.equation_error import fit_equation_error
from pneumo_casadi.model.simulation import simulate

TRUTH = {"elastic_load.m_2": 6.0, "elastic_load.f": 8.0, "elastic_load.zeta": 0.03}
#: The load 2 mm ahead of the piston, which stands.
SWINGING = [0.0, 0.0, 2e-3, 0.0]


@pytest.fixture(scope="module")
def swinging(made):
    """A record of a force-driven axis that begins while its load swings, and the axis."""
    axis = made.true_force_axis(ElasticLoad()).with_parameters({"v_s": 1e-2} | TRUTH)
    t = np.arange(6000) / 1e3
    F = 60.0 * np.sin(2 * np.pi * 1.1 * t) + 20.0 * np.sin(2 * np.pi * 5.3 * t)
    run = simulate(axis, F[:, None], 1e-3, SWINGING)
    x = run["x"] + 2e-6 * np.random.default_rng(0).normal(size=t.size)
    return axis, Recording(t, {"F": F, "x": x}, "swinging", "simulated", InputHold.ZERO)


def test_the_load_is_found_although_its_start_is_unknown(swinging):
    axis, record = swinging
    fit = fit_equation_error(
        axis.at_starting_values().with_parameters({"elastic_load.f": 8.5}), [record]
    )
    assert fit.converged
    for name, value in TRUTH.items():
        assert fit.parameters[name].value == pytest.approx(value, rel=0.03), name


def test_without_its_poles_the_start_would_be_taken_for_the_load(swinging, monkeypatch):
    axis, record = swinging
    monkeypatch.setattr(ElasticLoad, "swings", lambda self, values: ())
    fit = fit_equation_error(axis, [record])
    worst = max(abs(fit.parameters[name].value / value - 1) for name, value in TRUTH.items())
    assert worst > 0.1


@pytest.mark.parametrize(("zeta", "expected"), [(0.1, 2), (1.0, 1), (3.0, 2)])
def test_poles_are_those_of_the_oscillator(zeta, expected):
    poles = ElasticLoad().swings({"f": 5.0, "zeta": zeta})
    omega = 2 * np.pi * 5.0
    roots = np.roots([1.0, 2 * zeta * omega, omega**2])
    assert len(set(np.round(poles, 6))) == expected
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(roots), atol=1e-5)
