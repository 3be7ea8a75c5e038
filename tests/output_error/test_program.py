"""The functions that IPOPT is given agree with finite differences and with each other."""

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.effects import ValveLag
from pneumo_casadi.output_error import OutputErrorOptions
from pneumo_casadi.output_error.condensing import anchor_normal_equations, linearise
from pneumo_casadi.output_error.fit import write_problem
from pneumo_casadi.output_error.ipopt import program, scales
from pneumo_casadi.output_error.problem import Unknowns, values

KINDS = ("servo", "lag", "windows", "force", "one block")


@pytest.fixture(scope="module", params=KINDS)
def case(request, made, servo, force, start):
    """A small problem, its program and a point z with parameters p, away from the optimum."""
    table, axis = start(0)
    _, u, x = servo
    record = made.recorded(servo[0], u[:200], x[:, :200], 0)
    options = OutputErrorOptions(widths=(5e-3,), block=10e-3)
    if request.param == "lag":
        axis = axis.with_effects(ValveLag()).with_parameters({"valve_lag.tau": 4e-3})
        axis = axis.with_parameters(axis.parameters.fix("X_s2", "f_v", "psi_plus_1"))
    if request.param == "windows":
        options = OutputErrorOptions(widths=(5e-3,), block=10e-3, window=0.05)
    if request.param == "one block":
        options = OutputErrorOptions(widths=(5e-3,), block=0.19)
    if request.param == "force":
        axis, u, x = force
        record, table = made.recorded(axis, u[:200], x[:, :200], 0), None
    problem = write_problem(axis, [record], table, options)
    first = problem.start()
    rng = np.random.default_rng(0)
    z = np.concatenate(
        [first.theta[problem.parameters.free_mask], first.x.ravel("F"), first.m.ravel("F")]
    )
    z = z / scales(problem) + 1e-3 * rng.standard_normal(z.size)
    sigma = np.array([150.0, 150.0, 1.5e-5])[-len(axis.outputs) :]
    p = np.concatenate([first.theta, 1 / sigma**2])
    return problem, program(problem), z, p, sigma


def central(function, z, h):
    columns = []
    for i in range(z.size):
        step = np.zeros(z.size)
        step[i] = h
        columns.append((function(z + step) - function(z - step)) / (2 * h))
    return np.array(columns).T


def flat(a):
    return np.asarray(a, dtype=float).ravel()


def symbolic(written):
    nlp = written.nlp
    return ca.Function("f_g", [nlp["x"], nlp["p"]], [nlp["f"], nlp["g"]])


def test_constraints_have_the_jacobian_of_finite_differences(case):
    _, written, z, p, _ = case
    g, J = written.jac_g(z, p)
    f_g = symbolic(written)
    np.testing.assert_allclose(flat(g), flat(f_g(z, p)[1]), rtol=1e-12, atol=1e-14)
    wanted = central(lambda a: flat(f_g(a, p)[1]), z, 1e-6)
    size = np.abs(wanted).max(axis=1, keepdims=True)
    assert np.max(np.abs(J.full() - wanted) / size) < 1e-5


def test_the_cost_has_the_gradient_of_finite_differences(case):
    _, written, z, p, _ = case
    f, gradient = written.grad_f(z, p)
    f_g = symbolic(written)
    assert float(f) == pytest.approx(float(f_g(z, p)[0]), rel=1e-13)
    wanted = central(lambda a: flat(f_g(a, p)[0]), z, 1e-5).ravel()
    np.testing.assert_allclose(flat(gradient), wanted, atol=1e-6 * np.abs(wanted).max())


def test_the_hessian_is_that_of_the_quadratic_cost(case):
    """Residuals are linear in all unknowns, the map's too, so Gauss-Newton is exact."""
    _, written, z, p, _ = case
    upper = written.hess_lag(z, p, 1.0, np.zeros(written.nlp["g"].shape[0])).full()
    assert not np.tril(upper, -1).any()
    H = upper + np.triu(upper, 1).T
    wanted = central(lambda a: flat(written.grad_f(a, p)[1]), z, 1e-3)
    np.testing.assert_allclose(H, wanted, atol=1e-6 * np.abs(wanted).max())
    assert np.linalg.eigvalsh(H).min() > -1e-9 * np.abs(H).max()


def test_the_cost_of_the_program_is_the_cost_of_the_problem_per_residual(case):
    problem, written, z, p, sigma = case
    parts = z * scales(problem)
    n, nodes = len(problem.free), problem.n_nodes * len(problem.axis.states)
    theta = problem.parameters.values
    theta[problem.parameters.free_mask] = parts[:n]
    point = Unknowns(
        theta,
        parts[n : n + nodes].reshape(-1, problem.n_nodes, order="F"),
        parts[n + nodes :].reshape(-1, problem.n_blocks, order="F"),
    )
    count = problem.n_blocks * problem.blocks.n * len(problem.axis.outputs)
    count += problem.anchor.n if problem.anchor else 0
    f = float(symbolic(written)(z, p)[0])
    assert f * count == pytest.approx(problem.cost(point, sigma), rel=1e-10)
    by_hand = 0.5 * np.sum(problem.blocks.n * ((problem.y - point.m) / sigma[:, None]) ** 2)
    if problem.anchor:
        c = point.theta[[problem.parameters.index(i) for i in problem.anchor.names]]
        by_hand += 0.5 * np.sum(problem.anchor(c) ** 2)
    assert problem.cost(point, sigma) == pytest.approx(by_hand, rel=1e-12)


def test_condensed_derivatives_are_those_of_the_whole_simulation(case):
    """∂m/∂(x_0, θ) along a true trajectory, against finite differences of simulating it."""
    problem, *_ = case
    axis, nx = problem.axis, len(problem.axis.states)
    mask, first = problem.parameters.free_mask, problem.start()
    starts = [0, *np.cumsum([s.K + 1 for s in problem.segments])[:-1]]

    def simulated(x_0, theta):
        """Nodes and outputs, block after block, from one initial state for each segment."""
        nodes, outputs, block = first.x.copy(), [], 0
        for segment, node, state in zip(problem.segments, starts, x_0, strict=True):
            nodes[:, node] = state
            for k in range(segment.K):
                w = problem.w[:, block * problem.blocks.n : (block + 1) * problem.blocks.n]
                end, y = problem.blocks.value(nodes[:, node + k], w, theta)
                nodes[:, node + k + 1] = flat(end)
                outputs.append(flat(y))
                block += 1
        return nodes, np.array(outputs)

    x_0 = [first.x[:, node] for node in starts]
    nodes, m = simulated(x_0, first.theta)
    at = linearise(problem, Unknowns(first.theta, nodes, first.m))
    assert np.abs(at.defects / axis.state_scales).max() < 1e-12
    np.testing.assert_allclose(at.m.T, m, rtol=1e-12)
    size = np.concatenate([axis.state_scales, problem.free_scales])

    def outputs(z):
        theta = first.theta.copy()
        theta[mask] = z[nx:] * problem.free_scales
        return simulated([z[:nx] * axis.state_scales, *x_0[1:]], theta)[1][: problem.segments[0].K]

    z = np.concatenate([x_0[0], first.theta[mask]]) / size
    wanted = central(lambda a: outputs(a).ravel(), z, 1e-6)
    found = (at.segments[0].J * size).reshape(wanted.shape)
    rows = np.abs(wanted).max(axis=1, keepdims=True)
    assert np.max(np.abs(found - wanted) / rows) < 2e-4
    moved = first.theta.copy()
    if problem.anchor is not None:
        H, g = anchor_normal_equations(problem, moved)
        c_at = [problem.parameters.index(n) for n in problem.anchor.names]

        def half_square(z_map):
            theta = moved.copy()
            theta[mask] = theta[mask] + z_map * problem.free_scales
            return np.array([0.5 * np.sum(problem.anchor(theta[c_at]) ** 2)])

        slope = central(half_square, np.zeros(g.size), 1e-3).ravel()
        np.testing.assert_allclose(-g, slope, atol=1e-6 * np.abs(H).max())


def test_blocks_evaluate_alike_one_by_one_and_all_together(case):
    problem, *_ = case
    first = problem.start()
    ends, m = values(problem, first)
    n = problem.blocks.n
    for k in (0, problem.n_blocks - 1):
        w = problem.w[:, k * n : (k + 1) * n]
        end, y = problem.blocks.value(first.x[:, problem.starts[k]], w, first.theta)
        np.testing.assert_allclose(ends[:, k], flat(end), rtol=1e-14)
        np.testing.assert_allclose(m[:, k], flat(y), rtol=1e-14)
