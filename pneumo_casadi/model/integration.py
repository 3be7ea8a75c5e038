"""Numerical integration: Runge-Kutta steps, and many of them in sequence."""

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from pneumo_casadi.data import Clock, InputHold, Recording
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.model.machine_code.calls import mapped
from pneumo_casadi.model.stepping import Stepping, keeps_moving
from pneumo_casadi.parameters import FloatArray

#: Steps in one call of CasADi.
CHUNK = 250
#: ``rates(share, states)``: the rates after a share of a sample.
Rates = Callable[[Expression, Sequence[Expression]], Sequence[Expression]]
#: ``integrate(states, given, length)``: the states at the end of a sample.
Integrate = Callable[[Sequence[Expression], Sequence[Expression], Expression], list[Expression]]


def runge_kutta(
    f: Callable[[float, Sequence[Expression]], Sequence[Expression]],
    x: Sequence[Expression],
    h: Expression,
) -> list[Expression]:
    """Take one classical Runge-Kutta step of several quantities that move together.

    Parameters
    ----------
    f : callable
        ``f(share, x)`` returns the rates at a share of the step (0, ½ or 1).
    x : sequence of Expression
        Where the step starts.
    h : Expression
        Length of the step [s].

    Examples
    --------
    >>> end, = runge_kutta(lambda share, x: [-x[0]], [1.0], 0.1)
    >>> round(end, 7)
    0.9048375
    """

    def ahead(k: Sequence[Expression], part: float) -> list[Expression]:
        return [value + part * h * rate for value, rate in zip(x, k, strict=True)]

    k1 = f(0.0, x)
    k2 = f(0.5, ahead(k1, 0.5))
    k3 = f(0.5, ahead(k2, 0.5))
    k4 = f(1.0, ahead(k3, 1.0))
    return [
        value + h / 6 * (a + 2 * b + 2 * c + d)
        for value, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True)
    ]


def runge_kutta_sample(
    axis: Axis,
    rates: Rates,
    states: Sequence[Expression],
    given: Sequence[Expression],
    stepping: Stepping,
    inline: bool = False,
) -> Integrate:
    """Return what integrates one sample by calls of one Runge-Kutta step, compiled once.

    Steps are called in groups, which are functions as well: every call is code to be compiled.
    Compiled code takes few steps in the samples in which the axis keeps moving, and branches.

    Parameters
    ----------
    axis : Axis
        What moves.
    rates : callable
        ``rates(share, states)`` returns the rates after a share of the sample.
    states, given : sequence of Expression
        Symbols of what moves, x first, and of what the rates depend on besides, the inputs at the
        beginning first and θ last.
    stepping : Stepping
        Steps per sample.
    inline : bool
        Whether the steps are written out, not called; then every sample takes as many.

    Returns
    -------
    callable
        ``(states, given, length) -> states`` at the end of a sample of that length [s].
    """
    sym = type(states[0]).sym
    h, begin, part = sym("h"), sym("begin"), sym("part")

    def f(share: float, z: Sequence[Expression]) -> Sequence[Expression]:
        return rates(begin + share * part, z)

    inputs = [*states, *given, h, begin, part]
    step = ca.Function("substep", inputs, runge_kutta(f, states, h))
    careful = _in_steps(step, len(states), len(given), stepping.substeps, inline)
    if inline or stepping.moving is None or stepping.moving >= stepping.substeps:
        return careful
    quick = _in_steps(step, len(states), len(given), stepping.moving)
    length = sym("length")
    every = [*states, *given, length]
    few = ca.Function("quick_sample", every, quick(states, given, length))
    many = ca.Function("careful_sample", every, careful(states, given, length))
    either = ca.Function.if_else("either_sample", few, many)

    def choose(
        start: Sequence[Expression], at: Sequence[Expression], length: Expression
    ) -> list[Expression]:
        moves = keeps_moving(axis, start[0], at[0][: len(axis.inputs)], at[-1], length)
        return list(either.call([moves, *start, *at, length]))

    return choose


def _in_steps(
    step: ca.Function, n_states: int, n_given: int, count: int, inline: bool = False
) -> Integrate:
    """Return a sample of `count` steps; see `runge_kutta_sample`."""
    size = 1 if inline else _group_size(count)
    group = step
    if size > 1:
        inputs = step.mx_in()
        end, given = inputs[:n_states], inputs[n_states : n_states + n_given]
        h, begin, part = inputs[-3:]
        for k in range(size):
            end = step.call([*end, *given, h, begin + k * part, part], False, False)
        group = ca.Function(f"substeps_{count}", inputs, end)

    def integrate(
        start: Sequence[Expression], at: Sequence[Expression], length: Expression
    ) -> list[Expression]:
        end = list(start)
        for k in range(0, count, size):
            end = group.call([*end, *at, length / count, k / count, 1 / count], inline, False)
        return end

    return integrate


def _group_size(count: int) -> int:
    """Return in groups of how many a number of calls takes the least code."""
    return min(
        (size for size in range(1, count + 1) if count % size == 0),
        key=lambda size: count // size + (size if size > 1 else 0),
    )


def inputs_between(
    w: Expression, axis: Axis, hold: InputHold
) -> Callable[[Expression], Expression]:
    """Return the inputs as a function of the share of a sample that has passed.

    `w` begins with what `held_inputs` gives for the sample: the inputs, and below them the next
    values of those that run on.
    """
    held, nu = count_held(axis, hold), len(axis.inputs)
    if held == nu:
        return lambda share: w[:nu]
    now, ahead = w[held:nu], w[nu : 2 * nu - held]
    return lambda share: ca.vertcat(w[:held], (1 - share) * now + share * ahead)


def count_held(axis: Axis, hold: InputHold) -> int:
    """Return how many inputs hold over a sample; those behind them run on to their next value.

    Measured ones, a supply pressure or a force on the rod, run on whatever the commands do: held,
    they would act half a sample late, which a fit takes for viscous friction.
    """
    return 0 if hold is InputHold.LINEAR else len(axis.kind.commands)


def step_function(axis: Axis, stepping: Stepping, inline: bool = False) -> ca.Function:
    """Return one sample of integration, (x, w, θ) → x at the next sample.

    `w` is the inputs of this sample, below them the next values of those that run on (see
    `count_held`), and the length of a timed sample over dt last. With `inline` everything is
    written out; otherwise every Runge-Kutta step calls the same function, which is compiled once.
    """
    sym = (axis.symbol if inline else ca.MX).sym
    nu = len(axis.inputs)
    x = sym("x", len(axis.states))
    w = sym("w", 2 * nu - count_held(axis, stepping.hold) + stepping.timed)
    theta = sym("theta", len(axis.parameters))
    u = inputs_between(w, axis, stepping.hold)

    def rates(share: Expression, at: Sequence[Expression]) -> list[Expression]:
        return list(axis.rhs.call([at[0], u(share), theta], inline, False))

    integrate = runge_kutta_sample(axis, rates, [x], [w, theta], stepping, inline)
    (end,) = integrate([x], [w, theta], stepping.dt * w[-1] if stepping.timed else stepping.dt)
    if axis.sampled_states:
        (end,) = axis.renewed.call([end, w[:nu], theta], inline, False)
    return ca.Function("step", [x, w, theta], [end], ["x", "w", "theta"], ["x_next"])


def held_inputs(
    axis: Axis, u: FloatArray, hold: InputHold, lengths: FloatArray | None = None
) -> FloatArray:
    """Return `w` of every step, shape (nw, N - 1), from inputs of shape (N, nu).

    `lengths` (N - 1,) are those of timed samples, over dt.
    """
    rows = [u[:-1].T, u[1:, count_held(axis, hold) :].T]
    if lengths is not None:
        rows.append(lengths[None])
    return np.vstack(rows)


def sample_lengths(record: Recording, dt: float) -> FloatArray | None:
    """Return the lengths of the samples of a record over dt [s], (N - 1,); None if uniform."""
    return record.intervals / dt if record.clock is Clock.AS_RECORDED else None


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
        results = chunks[n].call([x, *given])
        for part, value in zip(parts, results, strict=True):
            array = np.asarray(value.full(), dtype=float)
            part.append(array.reshape(len(array), B, n).transpose(1, 0, 2))
        x = parts[0][-1][:, :, -1].T
    return tuple(np.concatenate(part, axis=2) for part in parts)


def _chunk(f: ca.Function, n: int, streams: int, theta: FloatArray, B: int) -> ca.Function:
    x = ca.MX.sym("x", f.size1_in(0))
    given = [ca.MX.sym(f"s{i}", f.size1_in(1 + i), n) for i in range(streams)]
    chain = f.mapaccum("chain", n)
    results = chain.call([x, *given, ca.repmat(ca.DM(theta), 1, n)])
    chunk = ca.Function("chunk", [x, *given], results)
    return mapped(chunk, B)
