"""What sensor noise has moved is told less its bias, unless that cannot be relied upon."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.prepare import noise_bias
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.noise_bias import LARGEST_BIAS, without_noise_bias
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.equation_error import NoiseInfluence


@pytest.fixture
def unbiased_of(made, monkeypatch):
    """Values and standard deviations of M and f_v for some influence of the noise."""
    axis = made.true_force_axis()
    study = SimpleNamespace(axis=axis, train=(), anchor_with=lambda effects: None)
    values = axis.parameters.as_dict()
    fitted = FittedModel((), values, {"M": 1.0, "f_v": 1.0}, 0.0, (), (), (), (), True)

    def with_influence(influence):
        def estimate(*arguments):
            if influence is None:
                raise FitError("too few rows")
            bias, std = influence
            return NoiseInfluence(("M", "f_v"), np.array(bias), np.diag(np.square(std)))

        monkeypatch.setattr(noise_bias, "estimate_noise_influence", estimate)
        return fitted, without_noise_bias(study, fitted, ())

    return with_influence


def test_the_bias_is_taken_away_and_the_scatter_told(unbiased_of):
    fitted, unbiased = unbiased_of(([0.3, -0.5], [0.2, 0.4]))
    assert unbiased.values["M"] == fitted.values["M"] - 0.3
    assert unbiased.values["f_v"] == fitted.values["f_v"] + 0.5
    assert unbiased.std == pytest.approx({"M": 0.2, "f_v": 0.4})
    assert unbiased.values["F_c_plus"] == fitted.values["F_c_plus"]


def test_what_a_fit_held_stays_held(made, unbiased_of, monkeypatch):
    fitted, _ = unbiased_of(([0.0, 0.0], [0.2, 0.4]))
    axis, asked = made.true_force_axis(), []

    def estimate(axis, *rest):
        asked.extend(axis.parameters.free_names)
        raise FitError("enough")

    monkeypatch.setattr(noise_bias, "estimate_noise_influence", estimate)
    study = SimpleNamespace(axis=axis, train=(), anchor_with=lambda effects: None)
    assert without_noise_bias(study, fitted, ()) is fitted
    assert tuple(asked) == axis.parameters.free_names and "v_s" not in asked


def test_a_large_bias_widens_the_interval_and_moves_nothing(unbiased_of):
    fitted, unbiased = unbiased_of(([1.01 * LARGEST_BIAS * 0.2, 0.1], [0.2, 0.4]))
    assert unbiased.values["M"] == fitted.values["M"]
    assert unbiased.std["M"] == pytest.approx(np.hypot(1.01 * LARGEST_BIAS * 0.2, 0.2))
    assert unbiased.values["f_v"] == fitted.values["f_v"] - 0.1


def test_no_value_leaves_its_bounds(unbiased_of):
    fitted, unbiased = unbiased_of(([100.0, 0.0], [90.0, 0.4]))
    assert unbiased.values["M"] == fitted.values["M"] > 0
    assert unbiased.std["M"] == pytest.approx(np.hypot(100.0, 90.0))


def test_where_noise_tells_nothing_the_fit_is_told_as_it_is(unbiased_of):
    fitted, unbiased = unbiased_of(None)
    assert unbiased is fitted
