"""Evaluation of a model's regressor along a record, in bounded memory."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.compilation import call_with_arrays
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals import FilteredRecording

#: Samples at which a function is evaluated at a time.
STRETCH = 20_000


def evaluate_regressor(
    model: Any, filtered: FilteredRecording, names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Evaluate the regressor at every sample, averaged over the inputs around it.

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
        wrong = np.argwhere(~np.isfinite(values))
        if wrong.size:
            e, k, _ = wrong[0]
            raise ModelError(
                f"{filtered.source}: {label} of {model.equations[e]} is not finite at "
                f"t = {filtered.t[k]:g} s; do the states leave the flow map's range?"
            )
    return Y[:, :, 0], W


def evaluate_along(
    function: ca.Function, model: Any, filtered: FilteredRecording
) -> tuple[FloatArray, ...]:
    """Evaluate a function (x, dx, u) at every sample, averaged over the inputs around it.

    Returns
    -------
    tuple of (r, N, c) array
        One for each output, (r, c), of the function.
    """
    x = filtered.stack_states(model.motion_states)
    dx = filtered.stack_derivatives(model.motion_states)
    sets = filtered.stack_inputs(model.inputs)
    shapes = [function.size_out(k) for k in range(function.n_out())]
    results = tuple(np.zeros((r, filtered.N, c)) for r, c in shapes)
    # In stretches: the memory of a long record is that of its results, not a multiple of them.
    for first in range(0, filtered.N, STRETCH):
        at = slice(first, min(first + STRETCH, filtered.N))
        mapped = function.map(at.stop - first)
        for u in sets:
            values = call_with_arrays(mapped, x[:, at], dx[:, at], u[:, at])
            for result, value, (r, c) in zip(results, values, shapes, strict=True):
                # CasADi lays the maps side by side: columns k c to (k + 1) c belong to sample k.
                result[:, at] += np.reshape(value, (r, -1, c)) / len(sets)
    return results
