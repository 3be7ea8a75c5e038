"""The bounded Gauss-Newton iteration and its steps, against SciPy on problems of known answer."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from pneumo_casadi.estimation.gauss_newton import Damping, Status, minimise, minimise_in_box

SCHEDULE = Damping(start=1e-3, accept=1e-3, trust=0.5, fall=5.0, grow=5.0, most=1e9)


@dataclass(frozen=True)
class At:
    z: np.ndarray
    cost: float


@dataclass(frozen=True)
class Step:
    delta: np.ndarray
    gain: float


@dataclass(frozen=True)
class Rosenbrock:
    """Residuals (10 (y - x²), 1 - x): a curved valley with its minimum at (1, 1)."""

    lower: np.ndarray
    upper: np.ndarray

    def residuals(self, z):
        return np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]])

    def jacobian(self, z):
        return np.array([[-20 * z[0], 10.0], [-1.0, 0.0]])

    def at(self, z):
        return At(z, 0.5 * float(np.sum(self.residuals(z) ** 2)))

    def linearise(self, point):
        return point

    def step(self, linear, damping):
        J, r = self.jacobian(linear.z), self.residuals(linear.z)
        H, g = J.T @ J, -J.T @ r
        damped = H + damping * np.diag(np.diag(H))
        delta = minimise_in_box(damped, g, self.lower - linear.z, self.upper - linear.z)
        return Step(delta, float(g @ delta - 0.5 * delta @ H @ delta))

    def settled(self, linear, step, damping, costs):
        assert all(b < a for a, b in pairwise(costs))
        return step.gain < 1e-20

    def take(self, linear, step, iteration):
        return self.at(linear.z + step.delta)


WIDE = np.full(2, 10.0)


@pytest.mark.parametrize("upper", [WIDE, np.array([0.7, 10.0]), np.array([10.0, 0.2])])
def test_a_curved_valley_is_followed_to_its_end_within_bounds(upper):
    problem = Rosenbrock(-WIDE, upper)
    begin = np.array([-1.2, 0.1])
    result = minimise(problem, problem.at(begin), SCHEDULE, 200, 400)
    expected = least_squares(
        problem.residuals, begin, problem.jacobian, bounds=(-WIDE, upper), xtol=1e-14, gtol=1e-14
    )
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(result.point.z, expected.x, atol=1e-6)


def test_iterations_and_trials_are_limited():
    problem = Rosenbrock(-WIDE, WIDE)
    start = problem.at(np.array([-1.2, 1.0]))
    result = minimise(problem, start, SCHEDULE, 3, 400)
    assert result.status is Status.EXHAUSTED and result.point.cost < start.cost
    assert minimise(problem, start, SCHEDULE, 200, 5).trials == 5
    assert minimise(problem, start, SCHEDULE, 200, 0).linear is None


@pytest.mark.parametrize("cost", [np.nan, np.inf, 1e9])
def test_where_every_step_is_rejected_the_start_is_kept(cost):
    class Uphill(Rosenbrock):
        def take(self, linear, step, iteration):
            return At(linear.z + step.delta, cost)

    problem = Uphill(-WIDE, WIDE)
    start = problem.at(np.array([-1.2, 1.0]))
    result = minimise(problem, start, SCHEDULE, 50, 50)
    assert result.status is Status.NO_STEP_HELPS and result.point is start
    limited = replace(SCHEDULE, max_rejections=3)
    assert minimise(problem, start, limited, 50, 50).trials == 3


def test_a_linearisation_that_is_not_finite_ends_the_iteration():
    class Runaway(Rosenbrock):
        def step(self, linear, damping):
            return None

    problem = Runaway(-WIDE, WIDE)
    result = minimise(problem, problem.at(np.zeros(2)), SCHEDULE, 50, 50)
    assert result.status is Status.NOT_FINITE


def test_damping_stays_within_its_limits_and_rises_at_least_to_its_floor():
    schedule = replace(SCHEDULE, least=1e-4, least_after_rejection=1.0)
    assert schedule.after(np.array(1e-4), np.array(1.0)) == 1e-4
    assert schedule.after(np.array(1e-4), np.array(0.2)) == 1e-4
    assert schedule.after(np.array(1e-4), np.array(np.nan)) == 1.0
    assert schedule.after(np.array(1.0), np.array(-1.0)) == 5.0


@pytest.mark.parametrize("seed", range(5))
def test_the_step_in_a_box_is_that_of_scipy(seed):
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(20, 6)) * 10.0 ** rng.integers(-3, 4, 6), rng.normal(size=20)
    free = np.linalg.lstsq(A, b, rcond=None)[0]
    upper = np.abs(free) * rng.choice([0.3, 3.0], 6)
    result = minimise_in_box(A.T @ A, A.T @ b, -upper, upper)
    expected = lsq_linear(A, b, (-upper, upper), method="bvls", tol=1e-14).x
    np.testing.assert_allclose(result / upper, expected / upper, atol=1e-7)


def test_directions_without_information_take_no_step():
    H = np.array([[2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    step = minimise_in_box(H, np.array([2.0, 2.0, 0.0]), -np.ones(3), np.ones(3))
    np.testing.assert_allclose(step, [0.5, 0.5, 0.0], atol=1e-12)
    assert minimise_in_box(np.zeros((0, 0)), np.zeros(0), np.zeros(0), np.zeros(0)).size == 0
