"""Functions along a record: compiled they equal the interpreted ones, whatever the arrays."""

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.model.along_record import SampleFunction, compile_sample_functions
from pneumo_casadi.model.machine_code.compilation import compiler


def functions():
    z, x, c = ca.SX.sym("z", 2), ca.SX.sym("x", 3), ca.SX.sym("c", 2)
    after = ca.vertcat(0.9 * z[0] + x[0], ca.tanh(z[1]) - c[1] * x[2])
    return (
        ca.Function("shape", [x, c], [ca.dot(x, x) * c, ca.densify(ca.jacobian(x * c[0], x))]),
        ca.Function("after", [z, x, c], [after]),
    )


@pytest.fixture
def arrays():
    rng = np.random.default_rng(0)
    return np.asfortranarray(rng.standard_normal((3, 50))), np.array([2.0, -1.0])


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_compiled_and_interpreted_give_the_same(arrays):
    x, c = arrays
    for compiled, plain in zip(compile_sample_functions(functions()), functions(), strict=True):
        assert compiled.library is not None
        interpreted = SampleFunction(plain, None)
        if plain.name() == "after":
            both = [f.accumulate(50, np.array([1.0, -2.0]), x, c) for f in (compiled, interpreted)]
            assert both[0].shape == (2, 51)
            np.testing.assert_allclose(both[0], both[1], rtol=1e-14)
            continue
        for one, other in zip(
            *(f.evaluate(50, x, c) for f in (compiled, interpreted)), strict=True
        ):
            assert one.shape == (one.shape[0], 50)
            np.testing.assert_allclose(one, other, rtol=1e-14)


def test_any_order_in_memory_and_a_part_of_an_array_are_read_right(arrays):
    x, c = arrays
    shape, _ = compile_sample_functions(functions())
    expected = np.sum(x**2, axis=0) * c[:, None]
    for given in (x, np.ascontiguousarray(x)):
        np.testing.assert_allclose(shape.evaluate(50, given, c)[0], expected)
        np.testing.assert_allclose(shape.evaluate(20, given[:, 7:], c)[0], expected[:, 7:27])
    constant = shape.evaluate(4, x[:, 0], c)[0]
    np.testing.assert_allclose(constant, np.tile(expected[:, :1], 4))


@pytest.mark.parametrize("wrong", [np.zeros((2, 50)), np.zeros((3, 49)), np.zeros(2)])
def test_arrays_of_the_wrong_shape_are_refused(arrays, wrong):
    shape, _ = compile_sample_functions(functions())
    with pytest.raises(ValueError, match="shape"):
        shape.evaluate(50, wrong, arrays[1])
