"""The functions that IPOPT is given agree with finite differences and with each other."""

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.estimation.output_error.shooting import condensing
from pneumo_casadi.estimation.output_error.shooting.condensing import (
    anchor_normal_equations,
    block_scores,
    condense,
    linearise,
)
from pneumo_casadi.estimation.output_error.shooting.problem import (
    Unknowns,
    evaluate_intervals,
    shoot_segments,
)
from pneumo_casadi.estimation.output_error.solvers.ipopt import _at_rounding, pack, program, unpack
from pneumo_casadi.estimation.output_error.stages import write_problem

KINDS = ("lag", "windows", "force", "one interval")


@pytest.fixture(scope="module", params=KINDS)
def case(request, made, servo, force, start):
    """A small problem, its program and a point z with parameters p, away from the optimum."""
    table, axis = start(0)
    _, u, x = servo
    record = made.recorded(servo[0], u[:200], x[:, :200], 0)
    options = OutputErrorOptions(widths=(5e-3,), block=10e-3, interval=0.03)
    if request.param == "lag":
        axis = axis.with_effects(made.ValveLag()).with_parameters({"valve_lag.tau": 4e-3})
        axis = axis.with_parameters(axis.parameters.fix("X_s2", "f_v", "psi_plus_1"))
    if request.param == "windows":
        options = OutputErrorOptions(widths=(5e-3,), block=10e-3, interval=0.03, window=0.05)
    if request.param == "one interval":
        record = made.recorded(servo[0], u[:31], x[:, :31], 0)
    if request.param == "force":
        axis, u, x = force
        record, table = made.recorded(axis, u[:200], x[:, :200], 0), None
    problem = write_problem(axis, [record], table, options)
    first = problem.start()
    rng = np.random.default_rng(0)
    z = pack(problem, first)
    z = z + 1e-3 * rng.standard_normal(z.size)
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


@pytest.mark.slow
def test_constraints_have_the_jacobian_of_finite_differences(case):
    _, written, z, p, _ = case
    g, J = written.jac_g(z, p)
    f_g = symbolic(written)
    np.testing.assert_allclose(flat(g), flat(f_g(z, p)[1]), rtol=1e-12, atol=1e-14)
    wanted = central(lambda a: flat(f_g(a, p)[1]), z, 1e-6)
    size = np.abs(wanted).max(axis=1, keepdims=True)
    assert np.max(np.abs(J.full() - wanted) / size, initial=0.0) < 1e-5


def test_the_cost_has_the_gradient_of_finite_differences(case):
    _, written, z, p, _ = case
    f, gradient = written.grad_f(z, p)
    f_g = symbolic(written)
    assert float(f) == pytest.approx(float(f_g(z, p)[0]), rel=1e-13)
    wanted = central(lambda a: flat(f_g(a, p)[0]), z, 1e-5).ravel()
    np.testing.assert_allclose(flat(gradient), wanted, atol=1e-6 * np.abs(wanted).max())


def test_the_hessian_is_that_of_the_linearised_residuals(case):
    """JᵀJ with J from finite differences of all residuals, the map's too."""
    problem, written, z, p, sigma = case
    upper = written.hess_lag(z, p, 1.0, np.zeros(written.nlp["g"].shape[0])).full()
    assert not np.tril(upper, -1).any()
    H = upper + np.triu(upper, 1).T

    def residuals(a):
        point = unpack(problem, a, problem.parameters.values)
        e = np.sqrt(problem.n) * evaluate_intervals(problem, point)[1] / sigma[:, None]
        return np.concatenate([e.ravel(), problem.anchor_residuals(point.theta)])

    J = central(residuals, z, 1e-6)
    count = problem.n_blocks * problem.n * len(sigma) + len(problem.anchor_residuals(p))
    wanted = J.T @ J / count
    np.testing.assert_allclose(H, wanted, atol=2e-6 * np.abs(wanted).max())
    assert np.linalg.eigvalsh(H).min() > -1e-9 * np.abs(H).max()


def test_the_cost_of_the_program_is_the_cost_of_the_problem_per_residual(case):
    problem, written, z, p, sigma = case
    point = unpack(problem, z, problem.parameters.values)
    count = problem.n_blocks * problem.n * len(problem.axis.outputs)
    count += problem.anchor.n if problem.anchor else 0
    f = float(symbolic(written)(z, p)[0])
    m = evaluate_intervals(problem, point)[1]
    assert f * count == pytest.approx(problem.cost(point.theta, m, sigma), rel=1e-10)
    by_hand = 0.5 * np.sum(problem.n * ((problem.y - m) / sigma[:, None]) ** 2)
    if problem.anchor:
        c = point.theta[[problem.parameters.index(i) for i in problem.anchor.names]]
        by_hand += 0.5 * np.sum(problem.anchor(c) ** 2)
    assert problem.cost(point.theta, m, sigma) == pytest.approx(by_hand, rel=1e-12)


def simulated(problem, x_0, theta):
    """Nodes and outputs, interval after interval, from one initial state for each segment."""
    data, functions = problem.data, problem.functions
    nodes, outputs = np.zeros((problem.model.nx, problem.I)), []
    for first, segment, state in zip(problem.firsts, problem.segments, x_0, strict=True):
        x = state
        for k in range(first, first + segment.intervals):
            B, n = functions.blocks, problem.n
            blocks = slice(k * B, (k + 1) * B)
            nodes[:, k] = x
            w = data.w[:, k * B * n : (k + 1) * B * n]
            end, m = functions.value(x, w, theta, data.h[:, blocks])
            outputs.append(m.full()[:, data.real[blocks]])
            x = flat(end)
    return nodes, np.hstack(outputs)


def test_condensed_derivatives_are_those_of_the_whole_simulation(case):
    """Normal equations in (x_0, θ) along a true trajectory, by differences of simulating it."""
    problem, *_, sigma = case
    axis, nx = problem.axis, len(problem.axis.states)
    mask, first = problem.parameters.free_mask, problem.start()
    x_0 = [first.x[:, k] for k in problem.firsts]
    nodes, m = simulated(problem, x_0, first.theta)
    point = Unknowns(first.theta, nodes)
    at = linearise(problem, point, sigma)
    assert np.abs(at.defects / problem.model.state_scales[:, None]).max(initial=0.0) < 1e-11
    np.testing.assert_allclose(at.m, m, rtol=1e-12)
    size = np.concatenate([axis.state_scales, problem.free_scales])
    K = problem.segments[0].K

    def outputs(z):
        theta = first.theta.copy()
        theta[mask] = z[nx:] * problem.free_scales
        starts = [z[:nx] * axis.state_scales, *x_0[1:]]
        return (simulated(problem, starts, theta)[1][:, :K] / sigma[:, None]).ravel()

    z = np.concatenate([x_0[0], first.theta[mask]]) / size
    J = np.sqrt(problem.n) * central(outputs, z, 1e-6)
    e = np.sqrt(problem.n) * ((problem.y - m)[:, :K] / sigma[:, None]).ravel()
    condensed = condense(problem, at, sigma)[0]
    np.testing.assert_allclose(condensed.H, J.T @ J, atol=2e-4 * np.abs(condensed.H).max())
    np.testing.assert_allclose(condensed.g, J.T @ e, atol=2e-4 * np.abs(J.T @ e).max())
    by_block = block_scores(problem, at, 0, condensed)
    assert by_block.shape == (K, z.size)
    np.testing.assert_allclose(by_block.sum(axis=0), condensed.g, rtol=1e-6, atol=1e-8)


def test_normal_equations_added_up_in_parts_are_those_of_all_at_once(case, monkeypatch):
    problem, _, z, _, sigma = case
    at = linearise(problem, unpack(problem, z, problem.parameters.values), sigma)
    whole = condense(problem, at, sigma)
    monkeypatch.setattr(condensing, "AT_ONCE", 1)
    if max(len(each.c) for each in whole) == 1:
        pytest.skip("one interval a window")
    for each, parts in zip(whole, condense(problem, at, sigma), strict=True):
        np.testing.assert_allclose(parts.H, each.H, rtol=1e-9, atol=1e-12 * np.abs(each.H).max())
        np.testing.assert_allclose(parts.g, each.g, rtol=1e-9, atol=1e-12 * np.abs(each.g).max())
        assert parts.closing == pytest.approx(each.closing, rel=1e-9)


def test_closing_defects_is_part_of_the_step(case):
    """The condensed gradient at open nodes is that of the linearised, closed trajectory."""
    problem, _, z, _, sigma = case
    point = unpack(problem, z, problem.parameters.values)
    at = linearise(problem, point, sigma)
    for condensed, first in zip(condense(problem, at, sigma), problem.firsts, strict=True):
        for k in range(len(condensed.c) - 1):
            A = at.S[first + k][:, : problem.model.nx]
            size = problem.model.state_scales
            ahead = A @ (condensed.c[k] * size)
            d = at.ends[:, first + k] - point.x[:, first + k + 1]
            np.testing.assert_allclose(condensed.c[k + 1] * size, ahead + d, rtol=1e-9)


def test_the_map_pulls_with_the_slope_of_its_squares(case):
    problem, *_ = case
    if problem.anchor is None:
        pytest.skip("no map")
    theta, mask = problem.parameters.values, problem.parameters.free_mask
    H, g = anchor_normal_equations(problem, theta)

    def half_square(z):
        moved = theta.copy()
        moved[mask] = moved[mask] + z * problem.free_scales
        return np.array([0.5 * np.sum(problem.anchor_residuals(moved) ** 2)])

    slope = central(half_square, np.zeros(g.size), 1e-3).ravel()
    np.testing.assert_allclose(-g, slope, atol=1e-6 * np.abs(H).max())


def test_intervals_evaluate_alike_one_by_one_and_all_together(case):
    problem, *_ = case
    first, data, B, n = problem.start(), problem.data, problem.functions.blocks, problem.n
    ends, m = evaluate_intervals(problem, first)
    for k in (0, problem.I - 1):
        w, h = data.w[:, k * B * n : (k + 1) * B * n], data.h[:, k * B : (k + 1) * B]
        end, y = problem.functions.value(first.x[:, k], w, first.theta, h)
        np.testing.assert_allclose(ends[:, k], flat(end), rtol=1e-14)
        before = int(data.real[: k * B].sum())
        y = y.full()[:, data.real[k * B : (k + 1) * B]]
        np.testing.assert_allclose(m[:, before : before + y.shape[1]], y, rtol=1e-14)


def test_shooting_goes_through_the_nodes_of_a_simulation(case):
    problem, *_ = case
    first = problem.start()
    x_0 = first.x[:, list(problem.firsts)]
    nodes, m = shoot_segments(problem, first.theta, x_0)
    wanted, outputs = simulated(problem, list(x_0.T), first.theta)
    np.testing.assert_allclose(nodes, wanted, rtol=1e-12)
    np.testing.assert_allclose(m, outputs, rtol=1e-12)


@pytest.mark.parametrize(
    ("primal", "dual", "ended"), [(1e-15, 2e-8, True), (1e-3, 2e-8, False), (1e-15, 0.1, False)]
)
def test_steps_below_rounding_are_the_end_at_an_optimum_only(primal, dual, ended):
    stats = {
        "return_status": "Search_Direction_Becomes_Too_Small",
        "iterations": {"inf_pr": [1.0, primal], "inf_du": [1.0, dual]},
    }
    assert _at_rounding(stats) is ended
    assert not _at_rounding(stats | {"return_status": "Maximum_Iterations_Exceeded"})
