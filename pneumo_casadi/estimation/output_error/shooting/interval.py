"""Intervals between shooting nodes, with sensitivities and normal equations built inside.

An interval is a stretch of blocks of samples that starts from one free state. Within it states
and their sensitivities S = ∂x/∂(x_0, θ) run along, and block after block the residuals of mean
outputs leave only their sums JᵀJ and Jᵀe: a long record needs few nodes and little memory.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.model.integration import Integrate, inputs_between, runge_kutta_sample
from pneumo_casadi.model.junctions import Expression
from pneumo_casadi.model.machine_code.compilation import compile_functions
from pneumo_casadi.model.sampled_axis import SampledAxis


@dataclass(frozen=True, eq=False)
class IntervalFunctions:
    """One interval as machine code, written and compiled when it is first asked for.

    Shapes are those of one interval with nx states, nw values a sample, ny outputs, n samples a
    block, B blocks and m = nx + n_free columns. ``h`` is the sampling period in each block
    [s]; a block with h = 0 takes no time and counts for nothing, so that intervals of different
    lengths share a function.

    Parameters
    ----------
    model : SampledAxis
        The axis from one sample to the next.
    n, blocks : int
        Samples a block, blocks an interval.
    free : tuple of str
        Parameters to differentiate to.
    """

    model: SampledAxis
    n: int
    blocks: int
    free: tuple[str, ...]

    @cached_property
    def value(self) -> ca.Function:
        """``(x (nx,), w (nw, n B), θ, h (1, B)) -> (x_end (nx,), ȳ (ny, B))``.

        The state at the end and the mean outputs over the n samples of each block.
        """
        return compile_functions([_value(self.model, self.n, self.blocks)])[0]

    @cached_property
    def sensitivity(self) -> ca.Function:
        """``(x, w, θ, h, ȳ_measured (ny, B), weight (ny,)) -> (x_end, ȳ, S, H, g, s)``.

        ∂x_end/∂(x_0, θ_free) of shape (nx, m), per output JᵀJ and Jᵀe of the means, the lower
        triangle of the former column by column, (m (m + 1)/2, ny) and (m, ny), and per block the
        weighted scores Σ_y weight Jᵀe, (m, B).
        """
        return compile_functions([_sensitivity(self.model, self.n, self.blocks, self.free)])[0]


def triangle_index(m: int) -> NDArray[np.intp]:
    """Return where a lower triangle, column by column, has each element of its symmetric matrix.

    Examples
    --------
    >>> triangle_index(3)
    array([[0, 1, 2],
           [1, 3, 4],
           [2, 4, 5]])
    """
    index = np.zeros((m, m), dtype=np.intp)
    upper = np.triu_indices(m)
    index[upper] = index.T[upper] = np.arange(len(upper[0]))
    return index


def _value(model: SampledAxis, n: int, blocks: int) -> ca.Function:
    ny, n_theta = len(model.axis.outputs), len(model.axis.parameters)
    sample = _sample(model)
    x, w = ca.MX.sym("x", model.nx), ca.MX.sym("w", model.nw, n)
    theta, h = ca.MX.sym("theta", n_theta), ca.MX.sym("h")
    end, total = x, ca.MX.zeros(ny)
    for i in range(n):
        end, total = sample(end, total, w[:, i], theta, h)
    block = ca.Function("block", [x, w, h, theta], [end, total / n])
    chain = _chain("value_chain", block, blocks, carried=1, streams=2)
    W, H = ca.MX.sym("w", model.nw, n * blocks), ca.MX.sym("h", 1, blocks)
    return ca.Function("interval", [x, W, theta, H], chain.call([x, W, H, theta]))


def _sensitivity(model: SampledAxis, n: int, blocks: int, free: Sequence[str]) -> ca.Function:
    ny, n_theta = len(model.axis.outputs), len(model.axis.parameters)
    m = model.nx + len(free)
    block = _normal_block(model, n, free)
    chain = _chain("sensitivity_chain", block, blocks, carried=3 + ny, streams=3)
    x, theta = ca.MX.sym("x", model.nx), ca.MX.sym("theta", n_theta)
    W, H = ca.MX.sym("w", model.nw, n * blocks), ca.MX.sym("h", 1, blocks)
    Y, weight = ca.MX.sym("y", ny, blocks), ca.MX.sym("weight", ny)
    nothing = [ca.MX.zeros(ca.Sparsity.lower(m)) for _ in range(ny)]
    start = [x, ca.MX(_identity(model.nx, m)), ca.MX.zeros(m, ny), *nothing]
    end, S, Jte, *JtJ, means, scores = chain.call([*start, W, H, Y, theta, weight])
    outputs = [end, means, S, ca.horzcat(*(part.nz[:] for part in JtJ)), Jte, scores]
    return ca.Function("interval_sensitivity", [x, W, theta, H, Y, weight], outputs)


def _normal_block(model: SampledAxis, n: int, free: Sequence[str]) -> ca.Function:
    """Return a block that adds what its mean outputs say to the normal equations."""
    ny, m = len(model.axis.outputs), model.nx + len(free)
    sample = _sample(model, free)
    x, S = ca.MX.sym("x", model.nx), ca.MX.sym("S", model.nx, m)
    # Symmetric: a triangle says it all, and the loops over it are what the blocks add to a sweep.
    JtJ = [ca.MX.sym(f"JtJ_{i}", ca.Sparsity.lower(m)) for i in range(ny)]
    Jte = ca.MX.sym("Jte", m, ny)
    w, h, y = ca.MX.sym("w", model.nw, n), ca.MX.sym("h"), ca.MX.sym("y", ny)
    theta, weight = ca.MX.sym("theta", len(model.axis.parameters)), ca.MX.sym("weight", ny)
    end, S_end, total, J = x, S, ca.MX.zeros(ny), ca.MX.zeros(ny, m)
    for i in range(n):
        end, S_end, total, J = sample(end, S_end, total, J, w[:, i], theta, h)
    mean = total / n
    counts = h > 0
    rows = (J * (counts / n)).T
    e = (y - mean) * counts
    squares = [ca.rank1(JtJ[i], 1.0, rows[:, i], rows[:, i]) for i in range(ny)]
    added = rows * ca.repmat(e.T, m, 1)
    return ca.Function(
        "normal_block",
        [x, S, Jte, *JtJ, w, h, y, theta, weight],
        [end, S_end, Jte + added, *squares, mean, added @ weight],
    )


def _sample(model: SampledAxis, free: Sequence[str] | None = None) -> ca.Function:
    """Return one sample that adds up its outputs.

    ``(x, total, w, θ, h) -> (x_next, total)``, or with the sensitivities S to (x_0, θ_free)
    beside every value, ``(x, S, total, J, w, θ, h) -> (x_next, S_next, total, J)``.
    """
    axis = model.axis
    nxa, ny, nu = len(axis.states), len(axis.outputs), len(axis.inputs)
    at = None if free is None else [axis.parameters.index(name) for name in free]
    m = 0 if free is None else model.nx + len(free)
    width = 1 + (free is not None)
    x, w, theta = (
        ca.MX.sym("x", model.nx),
        ca.MX.sym("w", model.nw),
        ca.MX.sym("theta", len(axis.parameters)),
    )
    h = ca.MX.sym("h")
    state = [x, ca.MX.sym("S", model.nx, m)][:width]
    total = [ca.MX.sym("total", ny), ca.MX.sym("J", ny, m)][:width]
    own = [part[:nxa, :] for part in state]
    moving = model.controller is not None
    output = _with_sensitivities("outputs", axis.output, axis, at, m, False)
    u, kept = [w], []
    if moving:
        feedback = _with_sensitivities("loop", model.feedback, axis, at, m, False)
        law = feedback.call([*state, w, theta])
        u, kept = [part[:nu, :] for part in law], [part[nu:, :] for part in law]
        if model.nw > 1 + nu:
            u.append(w[1 + nu :])  # the next values of what runs on
    y = output.call([*own, u[0][:nu], theta])
    integrate = _integration(model, at, m)
    end = integrate(own, [*u, theta], h * w[-1] if model.stepping.timed else h)
    end = [ca.vertcat(a, b) for a, b in zip(end, kept, strict=True)] if moving else end
    sums = [a + b for a, b in zip(total, y, strict=True)]
    return ca.Function("sample", [*state, *total, w, theta, h], [*end, *sums])


def _integration(model: SampledAxis, at: Sequence[int] | None, m: int) -> Integrate:
    """Return what integrates one sample, ``([x[, S]], [w, θ], length) -> [x[, S]]``.

    With a controller the inputs are given as ``[u[, du], next]`` in the place of w: what it sets,
    and the next values of those that run on.
    """
    axis, moving = model.axis, model.controller is not None
    nx, nu = len(axis.states), len(axis.inputs)
    width = 1 + (at is not None)
    own = [ca.MX.sym("x", nx), ca.MX.sym("S", nx, m)][:width]
    theta = ca.MX.sym("theta", len(axis.parameters))
    given = [ca.MX.sym("w", model.nw)]
    if moving:
        given = [ca.MX.sym("u", nu), ca.MX.sym("du", nu, m)][:width]
        if model.nw > 1 + nu:
            given.append(ca.MX.sym("next", model.nw - 1 - nu))
    rates = _with_sensitivities("rates", axis.rhs, axis, at, m, moving)
    between = inputs_between(ca.vertcat(given[0], *given[width:]), axis, model.stepping.hold)

    def f(share: Expression, z: Sequence[Expression]) -> list[Expression]:
        return list(rates.call([*z, between(share), *(given[1:width] if moving else []), theta]))

    integrate = runge_kutta_sample(axis, f, own, [*given, theta], model.stepping)
    if not axis.sampled_states:
        return integrate
    renew = _with_sensitivities("renew", axis.renewed, axis, at, m, moving)

    def and_renew(
        start: Sequence[Expression], during: Sequence[Expression], length: Expression
    ) -> list[Expression]:
        end = integrate(start, during, length)
        changes = during[1:width] if moving else ()
        after = renew.call([*end, during[0][:nu], *changes, during[-1]])
        # A block without time counts for nothing: nothing may jump there.
        return [ca.if_else(length > 0, a, b) for a, b in zip(after, end, strict=True)]

    return and_renew


def _with_sensitivities(
    name: str,
    f: ca.Function,
    axis: Expression,
    at: Sequence[int] | None,
    m: int,
    moving: bool,
) -> ca.Function:
    """Return f(x, v, θ) with its sensitivities: (x, S, v[, dv], θ) → (f, df).

    S, dv and df are derivatives with respect to (x_0, θ_free), where `at` are the indices of
    θ_free; without `at`, f is returned unchanged. With `moving`, v depends on (x_0, θ_free) as
    well, with the derivatives dv.
    """
    if at is None:
        return f
    sym = axis.symbol.sym
    nx, nv = f.size1_in(0), f.size1_in(1)
    x, v, theta = sym("x", nx), sym("v", nv), sym("theta", f.size1_in(2))
    S, dv = sym("S", nx, m), sym("dv", nv, m)
    value = f(x, v, theta)
    to_theta = ca.jacobian(value, theta)[:, list(at)]
    d = ca.jacobian(value, x) @ S
    d = d + ca.horzcat(ca.DM(value.shape[0], m - len(at)), to_theta)
    if moving:
        d = d + ca.jacobian(value, v) @ dv
    given = [x, S, v, dv, theta] if moving else [x, S, v, theta]
    return ca.Function(name, given, [value, ca.densify(d)])


def _chain(name: str, f: ca.Function, count: int, carried: int, streams: int) -> ca.Function:
    """Return `count` calls of f in a row: carried values, then streams, then constants.

    Streams and further outputs get one column group a call. Two levels of calls keep the code
    short for long intervals.
    """
    inner = max(1, int(np.sqrt(count)))
    if inner < 4:
        return _unrolled(name, [f] * count, carried, streams)
    stretch = _unrolled(f"{name}_inner", [f] * inner, carried, streams)
    whole, rest = divmod(count, inner)
    return _unrolled(name, [stretch] * whole + [f] * rest, carried, streams)


def _unrolled(name: str, calls: Sequence[ca.Function], carried: int, streams: int) -> ca.Function:
    first = calls[0]
    given = [
        ca.MX.sym(f"a{i}", first.size1_in(i), sum(f.size2_in(i) for f in calls))
        if carried <= i < carried + streams
        else ca.MX.sym(f"a{i}", first.sparsity_in(i))
        for i in range(first.n_in())
    ]
    values, constants = given[:carried], given[carried + streams :]
    pieces = [
        ca.horzsplit(stream, np.cumsum([0, *(f.size2_in(carried + i) for f in calls)]).tolist())
        for i, stream in enumerate(given[carried : carried + streams])
    ]
    gathered: list[list[ca.MX]] = []
    for k, f in enumerate(calls):
        out = f.call([*values, *(piece[k] for piece in pieces), *constants])
        values = out[:carried]
        gathered.append(out[carried:])
    stacked = [ca.horzcat(*parts) for parts in zip(*gathered, strict=True)]
    return ca.Function(name, given, [*values, *stacked])


def _identity(rows: int, columns: int) -> ca.DM:
    return ca.densify(ca.DM(np.eye(rows, columns)))
