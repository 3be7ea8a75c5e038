"""Functions of all samples equal CasADi's own, whatever they do and whatever is shared."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumo_casadi.model.along_record import ArrayFunction, array_function
from pneumo_casadi.model.along_record.array_function import NUMPY_BLOCK
from pneumo_casadi.model.along_record.block_program import work_through

UNARY = (
    ca.sin, ca.cos, ca.tan, ca.atan, ca.tanh, ca.sinh, ca.cosh, ca.exp, ca.floor, ca.ceil, ca.fabs,
    ca.sign, ca.sqrt, ca.log, ca.asin, ca.acos, ca.log1p, ca.expm1, ca.logic_not, ca.sumsqr,
    lambda x: -x, lambda x: 1 / x, lambda x: x + x, lambda x: x**3, lambda x: x**0.5,
)  # fmt: skip
BINARY = (
    ca.plus, ca.minus, ca.times, ca.rdivide, ca.power, ca.fmin, ca.fmax, ca.atan2, ca.hypot, ca.lt,
    ca.le, ca.eq, ca.ne, ca.logic_and, ca.logic_or, lambda x, y: ca.if_else(x > y, x, y * x),
)  # fmt: skip


@pytest.fixture(scope="module", params=["machine code", "NumPy"], autouse=True)
def means(request):
    """Evaluate with each of the two."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "NumPy":
            patch.setattr(array_function, "work_through", lambda: None)
        elif work_through() is None:
            pytest.skip("no C compiler")
        yield


#: Samples with larger intermediate results are not compared.
LARGE = 1e4
#: Samples: no whole number of vectors.
N = 41
STEPS = st.lists(
    st.tuples(st.integers(0, len(UNARY) + len(BINARY) - 1), st.integers(0, 99), st.integers(0, 99)),
    min_size=1,
    max_size=8,
)


def function_of(steps):
    """A function of x (2,), c (2,) that applies operations to results of earlier ones."""
    x, c = ca.SX.sym("x", 2), ca.SX.sym("c", 2)
    known = [x[0], x[1], c[0], c[1], ca.SX(0.5)]
    for operation, first, second in steps:
        a, b = known[first % len(known)], known[second % len(known)]
        binary = operation - len(UNARY)
        known.append(UNARY[operation](a) if binary < 0 else BINARY[binary](a, b))
    return ca.Function("f", [x, c], [ca.vertcat(*known[-3:]), ca.vertcat(*known[5:])])


@pytest.mark.slow
# The same draws in every run: a comparison of numbers that differ in the last bit can go either way
# (one draw in 30,000).
@settings(derandomize=True)
@given(STEPS, st.sampled_from([(True, True), (True, False), (False, True), (False, False)]))
def test_they_equal_casadis_own(steps, shared):
    f = function_of(steps)
    assert ArrayFunction.suits(f)
    rng = np.random.default_rng(len(steps))
    arrays = [
        rng.normal(size=2).round(2) if one else rng.normal(size=(2, N)).round(2) for one in shared
    ]
    found = ArrayFunction(f).evaluate(N, *arrays)
    whole = [a if a.ndim == 2 else np.tile(a[:, None], N) for a in arrays]
    expected = [part.full() for part in f.map(N)(*whole)]
    # Of numbers that large, or what follows from them, rounding decides: the sine of 1e16 is any.
    tame = (np.abs(expected[1]) < LARGE).all(axis=0)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours[:, tame], theirs[:, tame], rtol=1e-9, atol=1e-9)


def test_long_records_are_worked_on_in_blocks_and_matrices_are_column_after_column():
    x, c = ca.SX.sym("x", 2), ca.SX.sym("c")
    f = ca.Function("f", [x, c], [c * x, ca.densify(ca.jacobian(x * x[0], x))])
    values = np.random.default_rng(0).normal(size=(2, 2 * NUMPY_BLOCK + 7))
    product, slope = ArrayFunction(f).evaluate(
        values.shape[1], np.asfortranarray(values), np.array([3.0])
    )
    np.testing.assert_allclose(product, 3 * values)
    np.testing.assert_allclose(slope, [2 * values[0], values[1], 0 * values[0], values[0]])


def test_the_sign_of_zero_is_kept():
    x = ca.SX.sym("x", 1)
    f = ca.Function("f", [x], [ca.atan2(ca.sign(x), -1.0)])
    values = np.array([[0.0, -0.0, 2.0, -2.0]])
    np.testing.assert_array_equal(ArrayFunction(f).evaluate(4, values)[0], f.map(4)(values).full())


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_so_is_that_of_a_zero_that_all_samples_share(zero):
    x, c = ca.SX.sym("x"), ca.SX.sym("c")
    f = ca.Function("f", [x, c], [ca.vertcat(x / c, c / x, ca.fmin(c, x))])
    found = ArrayFunction(f).evaluate(2, np.array([[1.0, 2.0]]), np.array([zero]))[0]
    expected = f.map(2)(np.array([[1.0, 2.0]]), zero).full()
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


def test_a_sample_does_not_depend_on_where_it_stands():
    x = ca.SX.sym("x")
    f = ArrayFunction(ca.Function("f", [x], [ca.exp(ca.sin(x)) + ca.fabs(x) ** 1.3]))
    values = np.random.default_rng(0).normal(size=(1, 600))
    (together,) = f.evaluate(600, values)
    for first in (0, 1, 254, 511, 599):
        (alone,) = f.evaluate(600 - first, values[:, first:])
        np.testing.assert_array_equal(alone, together[:, first:])


def test_what_is_no_number_shows_without_a_warning():
    x = ca.SX.sym("x")
    (root,) = ArrayFunction(ca.Function("f", [x], [ca.sqrt(x) + ca.log(x - 1)])).evaluate(
        2, np.array([[-1.0, 1.0]])
    )
    assert np.isnan(root[0, 0]) and np.isinf(root[0, 1])


def test_functions_with_calls_or_of_mx_are_left_to_machine_code():
    x = ca.MX.sym("x")
    assert not ArrayFunction.suits(ca.Function("f", [x], [x * x]))


@pytest.mark.parametrize("wrong", [np.zeros((2, 50)), np.zeros((3, 49)), np.zeros(2)])
def test_arrays_of_the_wrong_shape_are_refused(wrong):
    x = ca.SX.sym("x", 3)
    with pytest.raises(ValueError, match="shape"):
        ArrayFunction(ca.Function("f", [x], [2 * x])).evaluate(50, wrong)
