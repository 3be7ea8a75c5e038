"""Calls with arrays, one or many side by side."""

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.model.machine_code.calls import (
    SIDE_BY_SIDE,
    call_side_by_side,
    call_with_arrays,
)


@pytest.fixture(scope="module")
def polar():
    """A point and three factors to the scaled square and to the factors' sums."""
    x, s = ca.MX.sym("x", 2), ca.MX.sym("s", 2, 3)
    return ca.Function("polar", [x, s], [ca.densify(x @ x.T), ca.sum1(s)])


@pytest.mark.parametrize("count", [1, 2, SIDE_BY_SIDE, 2 * SIDE_BY_SIDE + 7])
def test_many_calls_are_those_of_one_after_the_other(polar, count):
    rng = np.random.default_rng(count)
    x, s = rng.normal(size=(2, count)), rng.normal(size=(2, 3 * count))
    squares, sums = call_side_by_side(polar, x, s)
    assert squares.shape == (2, 2 * count) and sums.shape == (1, 3 * count)
    for k in (0, count // 2, count - 1):
        one = call_with_arrays(polar, x[:, k], s[:, 3 * k : 3 * k + 3])
        np.testing.assert_array_equal(squares[:, 2 * k : 2 * k + 2], one[0])
        np.testing.assert_array_equal(sums[:, 3 * k : 3 * k + 3], one[1])


def test_the_order_in_memory_of_what_is_given_does_not_matter(polar):
    rng = np.random.default_rng(3)
    x, s = rng.normal(size=(2, 300)), rng.normal(size=(2, 900))
    rows = call_side_by_side(polar, np.ascontiguousarray(x), np.ascontiguousarray(s))
    columns = call_side_by_side(polar, np.asfortranarray(x), np.asfortranarray(s))
    np.testing.assert_array_equal(rows[0], columns[0])


def test_arrays_of_another_size_are_refused(polar):
    with pytest.raises(ValueError, match=r"input 1 has \d+ values, expected"):
        call_side_by_side(polar, np.zeros((2, 300)), np.zeros((2, 600)))
