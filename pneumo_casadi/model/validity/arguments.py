"""Arguments of a simulation: shapes, finite numbers, and the clock."""

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data import AxisKind
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray


def check_inputs(kind: AxisKind, u: ArrayLike) -> FloatArray:
    """Return the inputs (N, nu) of an axis at the sampling instants.

    Raises
    ------
    ModelError
        If they have another shape, or one of them is not finite.
    """
    inputs, nu = _numbers("u", u), len(kind.inputs)
    if inputs.ndim != 2 or inputs.shape[1] != nu:
        transpose = inputs.ndim == 2 and len(inputs) == nu
        remedy = "; give its transpose" if transpose else ""
        raise ModelError(
            f"u: shape {inputs.shape}, expected (N, {nu}), one row a sample and one column each of "
            f"{', '.join(kind.inputs)}{remedy}"
        )
    _check_samples("u", inputs)
    return inputs


def check_reference(x_ref: ArrayLike) -> FloatArray:
    """Return the reference (N,) of the position [m].

    Raises
    ------
    ModelError
        If it has another shape, or one of its values is not finite.
    """
    reference = _numbers("x_ref", x_ref)
    if reference.ndim != 1:
        raise ModelError(f"x_ref: shape {reference.shape}, expected (N,), one value a sample [m]")
    _check_samples("x_ref", reference)
    return reference


def check_disturbance(kind: AxisKind, disturbance: ArrayLike, N: int) -> FloatArray:
    """Return what is added to the inputs over N samples, (N, 1) or (N, nu).

    Raises
    ------
    ModelError
        If it has another size, or one of its values is not finite.
    """
    added, nu = _numbers("disturbance", disturbance), len(kind.inputs)
    if added.shape not in {(N,), (N, 1), (N, nu)}:
        raise ModelError(
            f"disturbance: shape {added.shape}, expected ({N},) or ({N}, {nu}), as x_ref has {N} "
            f"samples and the axis the inputs {', '.join(kind.inputs)}"
        )
    _check_samples("disturbance", added)
    return added.reshape(N, -1)


def check_memory(memory: ArrayLike, size: int) -> FloatArray:
    """Return what a controller remembers, (size,).

    Raises
    ------
    ModelError
        If it has another size.
    """
    values = _numbers("memory", memory)
    if values.shape != (size,):
        raise ModelError(
            f"memory: shape {values.shape}, expected ({size},), what the controller remembers; "
            "leave it out for a controller at rest"
        )
    return values


def check_clock(dt: float, lengths: FloatArray | None, N: int) -> None:
    """Refuse a sampling period [s], or lengths of N - 1 samples over it, that are not positive.

    Raises
    ------
    ModelError
        Naming the value, and the sample.
    """
    if not (np.ndim(dt) == 0 and 0 < float(_numbers("dt", dt)) < np.inf):
        raise ModelError(f"dt: {dt} s; give the sampling period as a positive time in seconds")
    if lengths is None:
        return
    if np.shape(lengths) != (N - 1,):
        raise ModelError(
            f"lengths: shape {np.shape(lengths)}, expected ({N - 1},), one of each interval "
            f"between {N} samples"
        )
    lengths = _numbers("lengths", lengths)
    backward = np.flatnonzero(~((lengths > 0) & np.isfinite(lengths)))
    if backward.size:
        k = int(backward[0])
        raise ModelError(
            f"lengths: {lengths[k]:g} at sample {k}; give lengths above 0, in multiples of dt"
        )


def _numbers(name: str, values: ArrayLike) -> FloatArray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name}: {error}; give an array of numbers") from None


def _check_samples(name: str, values: FloatArray) -> None:
    if len(values) < 2:
        raise ModelError(f"{name}: {len(values)} samples; give at least 2, the first at t = 0")
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        at = tuple(bad[0].tolist())
        raise ModelError(f"{name}: {values[at]} at sample {at[0]}; give finite numbers, SI units")
