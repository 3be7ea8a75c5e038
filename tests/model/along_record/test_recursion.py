"""Variants side by side give what CasADi gives for each alone, whatever the function does."""

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.model.along_record import ArrayFunction, compile_recursion
from pneumo_casadi.model.along_record import recursion as recursion_module
from pneumo_casadi.model.along_record.array_function import _OPERATIONS
from pneumo_casadi.model.machine_code.compilation import compiler
from pneumo_casadi.model.machine_code.lane_code import LANES, runs_in_lanes
from pneumo_casadi.model.machine_code.operations import program_of

N = 30
UNARY = (
    ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.tanh, ca.sinh, ca.cosh, ca.exp, ca.floor,
    ca.ceil, ca.fabs, ca.sign, ca.sqrt, ca.log, ca.log1p, ca.expm1, ca.logic_not,
    lambda a: ca.exp(-a), lambda a: 1 / a, lambda a: a + a, lambda a: a * a, lambda a: a**0.4,
    lambda a: a * 1e-300 * 1e-300, lambda a: ca.fmin(a, ca.inf), lambda a: ca.fmax(a, -ca.inf),
)  # fmt: skip
BINARY = (
    ca.plus, ca.minus, ca.times, ca.rdivide, ca.power, ca.fmin, ca.fmax, ca.atan2, ca.hypot, ca.lt,
    ca.le, ca.eq, ca.ne, ca.logic_and, ca.logic_or, lambda a, b: ca.if_else(a > b, a, b * a),
)  # fmt: skip
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def every_operation():
    """A recursion z⁺ = z/8 + operation(x, c), one state an operation."""
    x, c = ca.SX.sym("x", 2), ca.SX.sym("c", 2)
    results = [f(x[0] + c[0]) for f in UNARY] + [f(x[1], c[1]) for f in BINARY]
    z = ca.SX.sym("z", len(results))
    return ca.Function("every", [z, x, c], [z / 8 + ca.densify(ca.vertcat(*results))])


def variants_of(f, count):
    rng = np.random.default_rng(count)
    n = f.size1_in(0)
    strange = (np.nan, np.inf, -np.inf, 0.0, -0.0)
    variants = []
    for _ in range(count):
        x, c = rng.normal(size=(2, N)).round(1), rng.normal(size=2).round(1)
        x[1, : len(strange)] = strange
        variants.append((rng.normal(size=n), x, c))
    variants[-1][2][1] = np.nan
    return variants


def by_casadi(f, variant):
    z, x, c = variant
    return np.column_stack([z, f.mapaccum(N)(z, x, np.tile(c[:, None], N)).full()])


@needs_compiler
@pytest.mark.parametrize("count", [1, LANES, LANES + 2])
def test_each_variant_comes_out_as_alone(count):
    f = every_operation()
    recursion = compile_recursion(f, (True, False))
    assert recursion.recur is not None
    variants = variants_of(f, count)
    results = recursion.accumulate(N, variants)
    assert len(results) == count
    for result, variant in zip(results, variants, strict=True):
        np.testing.assert_allclose(result, by_casadi(f, variant), rtol=1e-12, atol=1e-12)


def test_all_that_numpy_evaluates_runs_in_lanes():
    f = every_operation()
    assert runs_in_lanes(f) and ArrayFunction.suits(f)
    powers = {ca.OP_POW, ca.OP_CONSTPOW}  # CasADi chooses
    assert {line.operation for line in program_of(f).lines} >= set(_OPERATIONS) - powers


def test_without_code_for_lanes_the_same_comes_out(monkeypatch):
    monkeypatch.setattr(recursion_module, "build_library", lambda code: None)
    f = every_operation()
    recursion = compile_recursion(f, (True, False))
    assert recursion.recur is None
    variants = variants_of(f, 2)
    for result, variant in zip(recursion.accumulate(N, variants), variants, strict=True):
        np.testing.assert_allclose(result, by_casadi(f, variant), rtol=1e-12, atol=1e-12)


def test_what_is_not_known_there_runs_one_variant_after_another():
    z, x = ca.MX.sym("z"), ca.MX.sym("x")
    recursion = compile_recursion(ca.Function("f", [z, x], [z / 2 + ca.erf(x)]), (True,))
    assert recursion.recur is None
    x = np.linspace(-1, 1, N)[None]
    first, second = recursion.accumulate(N, [(np.ones(1), x), (np.zeros(1), x)])
    np.testing.assert_allclose(first - second, 0.5 ** np.arange(N + 1)[None])


@needs_compiler
@pytest.mark.parametrize("wrong", [np.zeros((1, N)), np.zeros((2, N - 1)), np.zeros(3)])
def test_arrays_of_the_wrong_shape_are_refused(wrong):
    f = every_operation()
    z, x, c = variants_of(f, 1)[0]
    recursion = compile_recursion(f, (True, False))
    with pytest.raises(ValueError, match="shape"):
        recursion.accumulate(N, [(z, x, c), (z, wrong, c)])
    for strange in ([(z, x, x)], [(z, x, c), (z, x[:, 0], c)]):
        with pytest.raises(ValueError, match="changes from sample to sample"):
            recursion.accumulate(N, strange)
    with pytest.raises(ValueError, match="2 inputs, expected 3"):
        recursion.accumulate(N, [(z, x)])
    with pytest.raises(ValueError, match="shape"):
        recursion.accumulate(N, [(z, x[:, :, None], c)])
    assert recursion.accumulate(N, []) == []


def test_functions_of_another_form_are_refused():
    z, y = ca.SX.sym("z", 2), ca.SX.sym("y", 3)
    sparse = ca.vertcat(ca.SX(1, 1), z[0])
    for outputs in ([sparse], [ca.vertcat(z, y)], [z, z], [z[0]]):
        with pytest.raises(ValueError, match="its one output must be dense"):
            compile_recursion(ca.Function("f", [z, y], outputs), (True,))
    with pytest.raises(ValueError, match="its one output"):
        compile_recursion(ca.Function("f", [z, y], [z]), (True, True))
