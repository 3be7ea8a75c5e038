"""Evaluation of a model's regressor along a record."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.wls.linear_system import IntArray
from pneumo_casadi.model.along_record import evaluated_without_compiling
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals import FilteredRecording

#: Samples at which a function is evaluated at a time.
STRETCH = 100_000


def evaluate_regressor(
    model: Any, filtered: FilteredRecording, names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Evaluate the regressor at every sample, averaged over the inputs around it.

    Parameters
    ----------
    model : LinearModel
        Supplies the regressor.
    filtered : FilteredRecording
        N samples of states, derivatives and inputs.
    names : sequence of str
        The n parameters, in the order of the columns of W.

    Returns
    -------
    Y : (ne, N) array
    W : (ne, N, n) array

    Raises
    ------
    ModelError
        If a value is not finite; the message names equation and instant.
    """
    Y, W = evaluate_along(model.regressor(names), model, filtered)
    for label, values in (("Y", Y), ("W", W)):
        if not np.isfinite(values).all():
            e, k, _ = np.argwhere(~np.isfinite(values))[0]
            raise ModelError(
                f"{filtered.source}: {label} of {model.equations[e]} is not finite at "
                f"t = {filtered.t[k]:g} s; do the states leave the flow map's range?"
            )
    return Y[:, :, 0], W


def evaluate_along(
    function: ca.Function,
    model: Any,
    filtered: FilteredRecording,
    samples: IntArray | slice = slice(None),
) -> tuple[FloatArray, ...]:
    """Evaluate a function (x, dx, u) at some samples, averaged over the inputs around each.

    Returns
    -------
    tuple of (r, N, c) array
        One for each output, (r, c), of the function, at the N samples asked for, by default all.
    """
    x = filtered.stack_states(model.motion_states)[:, samples]
    dx = filtered.stack_derivatives(model.motion_states)[:, samples]
    sets = [u[:, samples] for u in filtered.stack_inputs(model.inputs)]
    uncompiled = evaluated_without_compiling(function)
    shapes = [function.size_out(k) for k in range(function.n_out())]
    # A value holds the columns of a matrix one below the other.
    results = [np.zeros((c * r, x.shape[1])) for r, c in shapes]
    # In stretches: the memory of a long record is that of its results, not a multiple of them. Rows
    # that are zero throughout, as most of a regressor's are, are never written and take none.
    for first in range(0, x.shape[1], STRETCH):
        at = slice(first, first + STRETCH)
        for u in sets:
            values = uncompiled.evaluate(x[:, at].shape[1], x[:, at], dx[:, at], u[:, at])
            for result, value in zip(results, values, strict=True):
                for own, part in zip(result, value.reshape(len(result), -1), strict=True):
                    if part.any():
                        own[at] += part / len(sets)
    return tuple(
        result.reshape(c, r, x.shape[1]).transpose(1, 2, 0)
        for result, (r, c) in zip(results, shapes, strict=True)
    )
