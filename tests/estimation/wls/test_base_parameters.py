import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.wls import base_parameters, structural_base


def test_dependent_columns_are_regrouped_under_the_first_names():
    A = np.random.default_rng(0).normal(size=(100, 3))
    W = np.column_stack([A[:, 0], A[:, 1], 2 * A[:, 0] - 3 * A[:, 1], A[:, 2]])
    base = base_parameters(W, ["a", "b", "c", "d"])
    assert base.expressions == ("a + 2 c", "b - 3 c", "d")
    assert base.unidentifiable == ("a", "b", "c")
    assert "a + 2 c; b - 3 c can be estimated" in base.describe()
    X = np.array([1.0, -1.0, 0.5, 4.0])
    regrouped = X[list(base.columns)] + base.combination @ X[list(base.dependent)]
    np.testing.assert_allclose(W[:, list(base.columns)] @ regrouped, W @ X, atol=1e-12)


def test_a_column_of_zeros_is_named_as_leaving_no_trace():
    W = np.column_stack([np.arange(1.0, 9.0), np.zeros(8)])
    base = base_parameters(W, ["M", "f_v"])
    assert base.rank == 1
    assert base.describe() == "the data hold no trace of f_v"


@settings(max_examples=30)
@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4), st.integers(0, 50))
def test_units_do_not_decide_the_rank(exponents, seed):
    A = np.random.default_rng(seed).normal(size=(40, 3))
    W = np.column_stack([A, A @ [1.0, 1.0, 0.0]]) * 10.0 ** np.array(exponents)
    base = base_parameters(W, ["a", "b", "c", "d"])
    assert base.columns == (0, 1, 2)
    assert base.unidentifiable == ("a", "b", "d")


def test_all_ten_parameters_of_eq_7_are_structurally_identifiable(made):
    model = made.Eq7()
    base = structural_base(model.regressor(), model.regressor_names, 4, 3)
    assert base.describe() == "all 10 parameters are identifiable"


def test_a_motion_at_constant_volume_cannot_tell_the_dead_volume_from_the_area(made):
    model = made.Eq7()
    regressor = model.regressor()

    def at_one_place(x, dx, u):
        x = np.array(x)
        x[2], x[3] = 0.1, 0.0
        return regressor(x, dx, u)

    base = structural_base(at_one_place, model.regressor_names, 4, 3)
    assert "X_s1 + 0.1 X_s2" in base.expressions
    assert "X_s4 - 0.1 X_s5" in base.expressions
    assert "X_s3" in base.describe().split("no trace of")[1]


def test_bad_matrices_are_refused():
    with pytest.raises(ModelError, match="does not match 2 names"):
        base_parameters(np.ones((3, 3)), ["a", "b"])
    with pytest.raises(ModelError, match="not finite"):
        base_parameters([[1.0], [np.inf]], ["a"])
