"""Multiple shooting by condensed Gauss-Newton steps (Bock 1987).

The linearised dynamics tie every state to the segment's initial state and the parameters,

    δx_{k+1} = A_k δx_k + B_k δθ + d_k    with the defects d_k = F(x_k, w_k, θ) - x_{k+1},

so one sweep through the blocks leaves a dense least-squares problem in (δx_0, δθ), of the size of
the parameters and not of the record. Nodes need not satisfy the dynamics on the way: a start from
measured states survives where single shooting from the same parameters would drift away.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from pneumo_casadi.output_error.problem import Problem, Unknowns, sensitivities, values
from pneumo_casadi.parameters import FloatArray

#: Largest step of a parameter, in its scales, that the linearisation is trusted for.
TRUST = 0.5
#: Steps are halved at most this often.
HALVINGS = 10
#: Eigenvalues of the information below this share of the largest take no step.
RANK = 1e-13
#: Full steps must shrink at least by this over two iterations, or the line search takes over.
SHRINK = 0.5
#: Defects of the dynamics, in scaled states, that count as closed.
CLOSED = 1e-6
#: Step, in standard deviations of a parameter, below which the noise may be estimated again.
ROUGHLY = 0.3
#: Relative change of a noise estimate below which it has settled.
SETTLED = 0.01
#: Sensitivities and residuals beyond this come from a trajectory that ran away.
HUGE = 1e60
#: Relative rounding of the cost; less than this is no increase.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Condensed:
    """One segment, linearised and condensed to its initial state and the parameters.

    Parameters
    ----------
    J : (K, ny, nx + n_free) array
        ∂m_k/∂(x_0, θ_free) along the linearised trajectory, in SI units.
    r : (K, ny) array
        Measured minus linearised mean outputs at (δx_0, δθ) = 0, defects taken into account.
    S : (K + 1, nx, nx + n_free) array
        ∂x_k/∂(x_0, θ_free).
    c : (K + 1, nx) array
        Part of δx_k that closes the defects.
    """

    J: FloatArray
    r: FloatArray
    S: FloatArray
    c: FloatArray


@dataclass(frozen=True, slots=True)
class Linearised:
    """All segments condensed, with the model's outputs and defects at the point itself."""

    segments: tuple[Condensed, ...]
    m: FloatArray
    defects: FloatArray

    @property
    def finite(self) -> bool:
        """Whether the model stayed within numbers whose squares are finite."""
        parts = [part for s in self.segments for part in (s.J, s.r, s.S, s.c)]
        return all(bool((np.abs(part) < HUGE).all()) for part in parts)


def linearise(problem: Problem, point: Unknowns) -> Linearised:
    """Linearise the problem at a point and condense every segment."""
    ends, m, dx, dy = sensitivities(problem, point)
    d = (ends - point.x[:, problem.starts + 1]).T
    e = (problem.y - m).T
    found, block = [], 0
    with np.errstate(all="ignore"):  # a diverging trial step is found and halved
        for segment in problem.segments:
            span = slice(block, block + segment.K)
            found.append(_condense(dx[span], dy[span], d[span], e[span]))
            block += segment.K
    return Linearised(tuple(found), m, d)


def _condense(dx: FloatArray, dy: FloatArray, d: FloatArray, e: FloatArray) -> Condensed:
    K, nx, n = dx.shape
    S, c = np.zeros((K + 1, nx, n)), np.zeros((K + 1, nx))
    S[0, :, :nx] = np.eye(nx)
    for k in range(K):
        A = dx[k, :, :nx]
        S[k + 1] = A @ S[k]
        S[k + 1, :, nx:] += dx[k, :, nx:]
        c[k + 1] = A @ c[k] + d[k]
    C = dy[:, :, :nx]
    J = C @ S[:-1]
    J[:, :, nx:] += dy[:, :, nx:]
    return Condensed(J, e - (C @ c[:-1, :, None])[:, :, 0], S, c)


def scaled_normal_equations(
    problem: Problem, segment: Condensed, sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return JᵀJ and Jᵀr of one segment in scaled (x_0, θ_free)."""
    scale = np.concatenate([problem.axis.state_scales, problem.free_scales])
    weight = np.sqrt(problem.blocks.n) / sigma
    J = (segment.J * weight[None, :, None] * scale).reshape(-1, scale.size)
    r = (segment.r * weight).ravel()
    return J.T @ J, J.T @ r


def anchor_normal_equations(problem: Problem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return JᵀJ and Jᵀr of the flow map in scaled free parameters; zeros without an anchor."""
    free = problem.free
    H, g = np.zeros((len(free), len(free))), np.zeros(len(free))
    if problem.anchor is None:
        return H, g
    c = theta[[problem.parameters.index(name) for name in problem.anchor.names]]
    inside = [i for i, name in enumerate(problem.anchor.names) if name in free]
    at = [free.index(problem.anchor.names[i]) for i in inside]
    J = problem.anchor.jacobian(c)[:, inside] * problem.free_scales[at]
    H[np.ix_(at, at)] = J.T @ J
    g[at] = -J.T @ problem.anchor(c)
    return H, g


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a solver stopped, and why.

    Parameters
    ----------
    point : Unknowns
        The last point.
    sigma : (ny,) array
        Noise of one sample of each output at the end.
    status : str
        ``"converged"`` or what went wrong.
    iterations : int
        Iterations taken.
    """

    point: Unknowns
    sigma: FloatArray
    status: str
    iterations: int


def solve_gauss_newton(
    problem: Problem,
    point: Unknowns,
    sigma: FloatArray,
    reweight: bool,
    max_iterations: int = 50,
    tolerance: float = 1e-3,
) -> Solution:
    """Solve an output-error problem by Gauss-Newton steps within bounds and a trust box.

    Full steps are taken as long as they shrink: from measured states the first of them must be
    allowed to raise the cost. Where they stop shrinking, a line search takes over.

    Parameters
    ----------
    point : Unknowns
        Start; its nodes may violate the dynamics. Its θ holds the fixed parameters.
    sigma : (ny,) array
        Noise of one sample of each output.
    reweight : bool
        Near the optimum, estimate σ from the residuals until it has settled (maximum likelihood
        with unknown noise): misfitting trajectories must not overrule the flow map.
    max_iterations : int
        Iterations before giving up.
    tolerance : float
        Largest step, in standard deviations of a parameter, at which a point counts as optimal.

    Returns
    -------
    Solution
    """
    at = linearise(problem, point)
    if not at.finite:
        return Solution(point, sigma, "the start leads to numbers that are not finite", 0)
    sizes: list[float] = []
    penalty, damped = 0.0, False
    for iteration in range(1, max_iterations + 1):
        step = _gauss_newton_step(problem, at, point, sigma)
        sizes.append(step.size)
        damped = damped or _stopped_shrinking(sizes)
        if damped:
            penalty = max(penalty, step.penalty(at.defects / problem.axis.state_scales))
            trial = _searched(problem, at, point, step, sigma, penalty)
        else:
            trial = _finite(problem, point, step)
        if trial is None:
            return Solution(_with_outputs(point, at.m), sigma, "no step helps", iteration)
        found = linearise(problem, trial)
        if not found.finite:
            return Solution(
                _with_outputs(point, at.m), sigma, "the model ran away from the data", iteration
            )
        point, at = trial, found
        closed = float(np.max(np.abs(at.defects) / problem.axis.state_scales))
        # In standard deviations that count the misfit: with σ far below the residuals, a step
        # of many nominal deviations may still change nothing that the data could tell.
        size = step.size / _misfit(problem, at, sigma) / np.sqrt(max(1, step.theta.size))
        if reweight and size < ROUGHLY:
            new = residual_sigma(problem, at.m)
            if np.any(np.abs(new / sigma - 1) > SETTLED):
                sigma, sizes, penalty, damped = new, [], 0.0, False
                continue
        if size <= tolerance and closed < CLOSED:
            return Solution(_with_outputs(point, at.m), sigma, "converged", iteration)
    return Solution(_with_outputs(point, at.m), sigma, "iterations exhausted", max_iterations)


def _misfit(problem: Problem, at: Linearised, sigma: FloatArray) -> float:
    """Return the root mean square of the residuals over σ, at least one."""
    e = (problem.y - at.m) / sigma[:, None]
    return float(np.sqrt(max(1.0, problem.blocks.n * float(np.mean(e**2)))))


def _stopped_shrinking(sizes: list[float]) -> bool:
    """Tell whether full steps no longer contract: the last two against those before."""
    return len(sizes) > 4 and min(sizes[-2:]) > SHRINK * min(sizes[-4:-2])


def residual_sigma(problem: Problem, m: FloatArray) -> FloatArray:
    """Return the noise of one sample from residuals of block means, degrees of freedom counted."""
    e = problem.y - m
    fitted = len(problem.free) + e.shape[0] * len(problem.segments)
    dof = max(1.0, e.shape[1] - fitted / e.shape[0])
    found: FloatArray = np.sqrt(problem.blocks.n * np.sum(e**2, axis=1) / dof)
    return found


def _with_outputs(point: Unknowns, m: FloatArray) -> Unknowns:
    return Unknowns(point.theta, point.x, m)


@dataclass(frozen=True, slots=True)
class Step:
    """A Gauss-Newton step of all unknowns, and what it promises.

    Parameters
    ----------
    theta : (n_free,) array
        Step of the scaled free parameters.
    x : (nx, n_nodes) array
        Step of the states.
    size : float
        Length of the parameter step in standard deviations, √(δᵀHδ).
    slope : float
        Derivative of the cost along the step.
    """

    theta: FloatArray
    x: FloatArray
    size: float
    slope: float

    def penalty(self, defects: FloatArray) -> float:
        """Return the weight of squared defects that makes this step one of descent."""
        D = float(np.sum(defects**2))
        wanted = self.slope + 0.5 * self.size**2
        return 2 * wanted / D if wanted > 0 and D > 1e-24 else 0.0


def _gauss_newton_step(
    problem: Problem, at: Linearised, point: Unknowns, sigma: FloatArray
) -> Step:
    """Eliminate the initial states, solve for the parameters, and go back to all nodes."""
    nx = len(problem.axis.states)
    H, g = anchor_normal_equations(problem, point.theta)
    slope_map = g
    eliminated = []
    for segment in at.segments:
        full, gradient = scaled_normal_equations(problem, segment, sigma)
        inverse = np.linalg.pinv(full[:nx, :nx], rcond=1e-14, hermitian=True)
        G, h = inverse @ full[:nx, nx:], inverse @ gradient[:nx]
        H = H + full[nx:, nx:] - full[nx:, :nx] @ G
        g = g + gradient[nx:] - full[nx:, :nx] @ h
        eliminated.append((G, h))
    theta = _bounded_step(problem, H, g, point)
    scale = np.concatenate([problem.axis.state_scales, problem.free_scales])
    weight = problem.blocks.n / sigma**2
    moves, slope, block = [], -float(slope_map @ theta), 0
    for segment, (G, h) in zip(at.segments, eliminated, strict=True):
        full_step = np.concatenate([h - G @ theta, theta]) * scale
        moves.append((segment.S @ full_step + segment.c).T)
        e = problem.y[:, block : block + len(segment.r)] - at.m[:, block : block + len(segment.r)]
        ahead = (segment.r - segment.J @ full_step).T
        slope += float(np.sum(weight[:, None] * e * (ahead - e)))
        block += len(segment.r)
    return Step(theta, np.hstack(moves), float(np.sqrt(max(0.0, float(theta @ H @ theta)))), slope)


def _searched(
    problem: Problem,
    at: Linearised,
    point: Unknowns,
    step: Step,
    sigma: FloatArray,
    penalty: float,
) -> Unknowns | None:
    """Shorten the step until cost and weighted defects together fall (Armijo's rule)."""
    scale = problem.axis.state_scales

    def merit(candidate: Unknowns, defects: FloatArray) -> float:
        squares = float(np.sum((defects / scale) ** 2))
        return problem.cost(candidate, sigma) + 0.5 * penalty * squares

    before = merit(_with_outputs(point, at.m), at.defects)
    slope = step.slope - penalty * float(np.sum((at.defects / scale) ** 2))
    for halving in range(HALVINGS + 1):
        share = 0.5**halving
        trial, defects = evaluate(problem, _moved(problem, point, step, share))
        promised = 1e-4 * share * min(slope, 0.0)
        if merit(trial, defects) <= before + promised + ROUNDING * abs(before):
            return trial
    return None


def _finite(problem: Problem, point: Unknowns, step: Step) -> Unknowns | None:
    """Take the full step, halved only where the model leaves the finite numbers."""
    for halving in range(HALVINGS + 1):
        trial, defects = evaluate(problem, _moved(problem, point, step, 0.5**halving))
        if np.isfinite(defects).all() and np.isfinite(trial.m).all():
            return trial
    return None


def evaluate(problem: Problem, point: Unknowns) -> tuple[Unknowns, FloatArray]:
    """Return the point with the model's outputs, and the defects, shape (n_blocks, nx)."""
    ends, m = values(problem, point)
    return _with_outputs(point, m), (ends - point.x[:, problem.starts + 1]).T


def _moved(problem: Problem, point: Unknowns, step: Step, share: float) -> Unknowns:
    mask, parameters = problem.parameters.free_mask, problem.parameters
    theta = point.theta.copy()
    moved = theta[mask] + share * step.theta * problem.free_scales
    theta[mask] = np.clip(moved, parameters.lower[mask], parameters.upper[mask])
    return Unknowns(theta, point.x + share * step.x, point.m)


def _bounded_step(problem: Problem, H: FloatArray, g: FloatArray, point: Unknowns) -> FloatArray:
    """Minimise ½ δᵀHδ - gᵀδ within the parameters' bounds and the trust box."""
    if g.size == 0:
        return g
    mask, scale = problem.parameters.free_mask, problem.free_scales
    here = point.theta[mask]
    lower = np.maximum((problem.parameters.lower[mask] - here) / scale, -TRUST)
    upper = np.minimum((problem.parameters.upper[mask] - here) / scale, TRUST)
    diagonal = np.diag(H)
    # What is left of a parameter without information is rounding: it takes no step.
    known = diagonal > RANK**2 * diagonal.max()
    size = np.sqrt(np.where(known, diagonal, 1.0))
    values, vectors = np.linalg.eigh(H * np.outer(known, known) / np.outer(size, size))
    good = values > RANK * values[-1]
    root = np.sqrt(values[good])
    basis = vectors[:, good]
    free_step: FloatArray = basis @ ((basis.T @ (g / size)) / root**2) / size
    if np.all(free_step >= lower) and np.all(free_step <= upper):
        return free_step
    A = (basis * root).T * size
    b = (basis.T @ (g / size)) / root
    # lsq_linear wants a box with an inside; a parameter at its bound gets a hair's breadth.
    hair = 1e-12
    found = lsq_linear(A, b, (np.minimum(lower, -hair), np.maximum(upper, hair)), method="bvls")
    bounded: FloatArray = np.clip(found.x, lower, upper)
    return bounded
