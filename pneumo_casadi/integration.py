"""From the right-hand side to samples: Runge-Kutta steps, blocks of samples, sensitivities."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pneumo_casadi.axis import Axis
from pneumo_casadi.compilation import compiled
from pneumo_casadi.effect import Expression
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.recording import ForceBench, InputHold

#: Threads among which blocks and stretches are shared.
THREADS = 2
#: Fastest rate times sampling period up to which a sample is one step.
ONE_STEP = 0.5
#: Steps that run inside CasADi at a time.
CHUNK = 250


@dataclass(frozen=True, slots=True)
class Stepping:
    """How a sampled record is integrated.

    Parameters
    ----------
    dt : float
        Sampling period [s].
    hold : InputHold
        What the input does between two samples.
    substeps : int
        Runge-Kutta steps of order four per sample; see `substeps_for`.
    """

    dt: float
    hold: InputHold = InputHold.ZERO
    substeps: int = 1


def substeps_for(axis: Axis, dt: float) -> int:
    """Return the Runge-Kutta steps per sample that the axis needs at standstill to stay stable.

    There smoothed friction is steepest, (F_c⁺ + F_c⁻) / (2 M v_s) on the nominal axis, and
    effects add their own (a lag, Stribeck's force). RK4 is stable up to 2.78 times the fastest
    rate and accurate below about 1 per step; where one step would do for a whole sample, half
    of that is asked for, because the steps are then long against everything else as well.
    """
    rate = dt * _fastest_rate(axis)
    return max(1 if rate <= ONE_STEP else 2, int(np.ceil(rate)))


def _fastest_rate(axis: Axis) -> float:
    """Return the largest magnitude of the axis' poles at mid-stroke and standstill [1/s]."""
    bench, theta = axis.bench, axis.parameters.values
    pressures = [] if isinstance(bench, ForceBench) else [(bench.p_supply + bench.p_ext) / 2] * 2
    u = np.zeros(len(axis.inputs))
    at_rest = axis.rest([*pressures, 0.0, 0.0], u, theta)
    x = axis.symbol.sym("x", len(axis.states))
    # In θ as a symbol: the same expression for all parameter values, and MX maps need it.
    p = axis.symbol.sym("p", theta.size)
    A = ca.Function("A", [x, p], [ca.jacobian(axis.rhs(x, u, p), x)])(at_rest, theta).full()
    if not np.isfinite(A).all():
        raise ModelError("the axis' equations are not finite at standstill; check its parameters")
    return float(np.abs(np.linalg.eigvals(A)).max())


def step_function(axis: Axis, stepping: Stepping) -> ca.Function:
    """Return one sample of integration, (x, w, θ) → x at the next sample.

    `w` is the input of this sample and, under linear hold, of the next one below it.
    """
    sym = axis.symbol.sym
    nu = len(axis.inputs)
    linear = stepping.hold is InputHold.LINEAR
    x = sym("x", len(axis.states))
    w = sym("w", nu * (2 if linear else 1))
    theta = sym("theta", len(axis.parameters))
    h = stepping.dt / stepping.substeps

    def u(step: int, part: float) -> Expression:
        if not linear:
            return w
        share = (step + part) / stepping.substeps
        return (1 - share) * w[:nu] + share * w[nu:]

    f = axis.rhs
    end: Expression = x
    for step in range(stepping.substeps):
        k1 = f(end, u(step, 0.0), theta)
        k2 = f(end + h / 2 * k1, u(step, 0.5), theta)
        k3 = f(end + h / 2 * k2, u(step, 0.5), theta)
        k4 = f(end + h * k3, u(step, 1.0), theta)
        end = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("step", [x, w, theta], [end], ["x", "w", "theta"], ["x_next"])


def held_inputs(u: FloatArray, hold: InputHold) -> FloatArray:
    """Return `w` of every step, shape (nw, N - 1), from inputs of shape (N, nu)."""
    now = u[:-1].T
    return np.vstack([now, u[1:].T]) if hold is InputHold.LINEAR else now


@dataclass(frozen=True, slots=True)
class BlockFunctions:
    """A block of n samples, and the same with its sensitivities.

    Parameters
    ----------
    n : int
        Samples per block.
    value : casadi.Function
        ``(x_0 (nx,), w (nw, n), θ) -> (x_n (nx,), ȳ (ny,))``: the state one block later and the
        mean of the outputs at samples 0 ... n-1.
    sensitivity : casadi.Function
        The same inputs to ``(x_n, ȳ, ∂x_n, ∂ȳ)``, differentiated to ``(x_0, θ_free)``.
    """

    n: int
    value: ca.Function
    sensitivity: ca.Function


def block_functions(axis: Axis, stepping: Stepping, n: int, free: Sequence[str]) -> BlockFunctions:
    """Write, differentiate and compile a block of samples.

    The sensitivities run along with the states, one small dense product a sample, instead of
    leaving a derivative of the whole block to the optimiser.
    """
    nx, ny, n_free = len(axis.states), len(axis.outputs), len(free)
    sample, sample_sensitivity = _sample_functions(axis, stepping, free)
    x = ca.MX.sym("x", nx)
    w = ca.MX.sym("w", sample.size1_in(1), n)
    theta = ca.MX.sym("theta", len(axis.parameters))

    end, total = x, ca.MX.zeros(ny)
    for i in range(n):
        end, total = sample(end, w[:, i], theta, total)
    names = ["x", "w", "theta"]
    value = ca.Function("block", [x, w, theta], [end, total / n], names, ["x_n", "y"])

    end, total = x, ca.MX.zeros(ny)
    S = ca.MX(ca.DM.eye(nx + n_free)[:nx, :])
    S, dy = ca.densify(S), ca.MX.zeros(ny, nx + n_free)
    for i in range(n):
        end, total, S, dy = sample_sensitivity(end, w[:, i], theta, total, S, dy)
    sensitivity = ca.Function(
        "block_sensitivity",
        [x, w, theta],
        [end, total / n, S, dy / n],
        names,
        ["x_n", "y", "dx_n", "dy"],
    )
    return BlockFunctions(n, *compiled([value, sensitivity]))


def _sample_functions(
    axis: Axis, stepping: Stepping, free: Sequence[str]
) -> tuple[ca.Function, ca.Function]:
    """Return one sample that adds up its outputs, without and with sensitivities."""
    sym = axis.symbol.sym
    nx, ny, n_free = len(axis.states), len(axis.outputs), len(free)
    step = step_function(axis, stepping)
    x, w = sym("x", nx), sym("w", step.size1_in(1))
    theta, total = sym("theta", len(axis.parameters)), sym("total", ny)
    S, dS = sym("S", nx, nx + n_free), sym("dy", ny, nx + n_free)
    at = [axis.parameters.index(name) for name in free]
    x_next = step(x, w, theta)
    y = axis.output(x, w[: len(axis.inputs)], theta)

    def along(value: Expression) -> Expression:
        to_theta = ca.jacobian(value, theta)[:, at]
        pad = ca.DM(value.shape[0], nx)
        return ca.densify(ca.jacobian(value, x) @ S + ca.horzcat(pad, to_theta))

    common = [x, w, theta, total]
    plain = ca.Function("sample", common, [x_next, total + y])
    full = ca.Function(
        "sample_sensitivity", [*common, S, dS], [x_next, total + y, along(x_next), dS + along(y)]
    )
    return plain, full


def accumulate(
    f: ca.Function, x_0: FloatArray, streams: Sequence[FloatArray], theta: FloatArray
) -> tuple[FloatArray, ...]:
    """Apply a step over and over, many stretches side by side.

    Parameters
    ----------
    f : casadi.Function
        ``(x, stream_1, ..., θ) -> (x_next, output_1, ...)`` of one step.
    x_0 : (nx, B) array
        Initial states of B stretches.
    streams : sequence of (B, r, N) array
        What each step is given, r rows a step.
    theta : (n,) array
        Parameters, the same in every step.

    Returns
    -------
    tuple of (B, rows, N) array
        All outputs of all steps.

    Notes
    -----
    Steps run in chunks of `CHUNK` inside CasADi. One chain over a whole record would take longer
    to build than to run.
    """
    B, _, N = streams[0].shape
    parts: list[list[FloatArray]] = [[] for _ in range(f.n_out())]
    x = x_0
    chunks: dict[int, ca.Function] = {}
    for first in range(0, N, CHUNK):
        n = min(CHUNK, N - first)
        if n not in chunks:
            chunks[n] = _chunk(f, n, len(streams), theta, B)
        given = [np.hstack(list(stream[:, :, first : first + n])) for stream in streams]
        found = chunks[n].call([x, *given])
        for part, value in zip(parts, found, strict=True):
            array = np.asarray(value.full(), dtype=float)
            part.append(array.reshape(len(array), B, n).transpose(1, 0, 2))
        x = parts[0][-1][:, :, -1].T
    return tuple(np.concatenate(part, axis=2) for part in parts)


def _chunk(f: ca.Function, n: int, streams: int, theta: FloatArray, B: int) -> ca.Function:
    x = ca.MX.sym("x", f.size1_in(0))
    given = [ca.MX.sym(f"s{i}", f.size1_in(1 + i), n) for i in range(streams)]
    chain = f.mapaccum("chain", n)
    found = chain.call([x, *given, ca.repmat(ca.DM(theta), 1, n)])
    chunk = ca.Function("chunk", [x, *given], found)
    if B == 1:
        return chunk
    side_by_side: ca.Function = chunk.map(B, "thread", THREADS)
    return side_by_side
