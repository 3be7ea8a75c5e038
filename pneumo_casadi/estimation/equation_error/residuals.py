"""Residuals of the balances along a smoothed motion; states of the effects are simulated."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.estimation.equation_error.true_motion import (
    simulate_effect_states,
    true_motions,
)
from pneumo_casadi.parameters import FloatArray

#: Step of difference quotients, in units of the scale of a parameter.
DIFFERENCE = 1e-3


@dataclass(frozen=True, eq=False)
class LinearisedResiduals:
    """Residuals of the balances at every row of a record.

    Parameters
    ----------
    r : (ne, m) array
        In the units of `BalanceFunctions.residual`.
    J : (ne, m, n) array
        Derivatives to the free parameters, in the order of `BalanceFunctions.free`.
    """

    r: FloatArray
    J: FloatArray


def balance_residuals(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray
) -> FloatArray:
    """Return the decimated residuals at some parameters, shape (ne, m)."""
    return residuals_of_variants(model, data, [theta])[0]


def residuals_of_variants(
    model: BalanceFunctions, data: SmoothedMotion, variants: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the decimated residuals for every variant of θ, each (ne, m)."""
    return [
        _removing_swings(model, data, theta)(data.averaged(r))
        for theta, r in zip(variants, _undecimated(model, data, variants), strict=True)
    ]


def linearise_residuals(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray, whole: bool = False
) -> LinearisedResiduals:
    """Return residuals and derivatives at some parameters.

    Derivatives to the nominal parameters hold the states of the effects, and are exact where these
    states do not depend on them. Derivatives to parameters of effects are exact where no state and
    no sensor depends on them, and difference quotients otherwise. With `whole`, difference
    quotients are also used for nominal parameters on which states depend, at the price of one
    simulation of the states for each.
    """
    holding = model.state_dependent if whole else ()
    variants, step_sizes = _perturbed(model, theta, (*model.by_difference, *holding), {})
    residuals = _undecimated(model, data, variants, jacobian=True)
    r, J = residuals[0], residuals[-1]
    ne, k = len(r), len(step_sizes)
    moved = [(perturbed - r) / h for perturbed, h in zip(residuals[1:-1], step_sizes, strict=True)]
    low = np.concatenate([data.averaged(part) for part in (r, J, *moved)])
    derivatives = low[ne:].reshape(-1, ne, data.m).transpose(1, 2, 0)
    exact, quotients = np.split(derivatives, [derivatives.shape[2] - k], axis=2)
    own = len(model.by_difference)
    exact[:, :, [model.analytic.index(name) for name in holding]] = quotients[:, :, own:]
    J = np.concatenate([exact, quotients[:, :, :own]], axis=2)
    without_swings = _removing_swings(model, data, theta)
    J = without_swings(J.transpose(2, 0, 1)).transpose(1, 2, 0)
    return LinearisedResiduals(without_swings(low[:ne]), J)


def undecimated_residuals(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray
) -> FloatArray:
    """Return the residuals at some parameters at every sample, shape (ne, N)."""
    return _undecimated(model, data, [theta])[0]


def effect_derivatives(
    model: BalanceFunctions,
    data: SmoothedMotion,
    theta: FloatArray,
    names: Sequence[str],
    sizes: Mapping[str, float] | None = None,
    at_theta: FloatArray | None = None,
) -> FloatArray:
    """Return derivatives of the residuals to parameters of the effects, shape (ne, m, k).

    With `sizes`, the quotients over steps of those sizes by name. `at_theta` are the
    `undecimated_residuals`, where they are known.
    """
    variants, step_sizes = _perturbed(model, theta, names, sizes or {})
    if at_theta is None:
        at_theta, *residuals = _undecimated(model, data, variants)
    else:
        residuals = _undecimated(model, data, variants[1:])
    moved = [(perturbed - at_theta) / h for perturbed, h in zip(residuals, step_sizes, strict=True)]
    ne, k = len(at_theta), len(names)
    low = np.array([data.averaged(part) for part in moved]).reshape(k, ne, data.m)
    return _removing_swings(model, data, theta)(low).transpose(1, 2, 0)


def _removing_swings(
    model: BalanceFunctions, data: SmoothedMotion, theta: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """Return what takes from rows (..., ne, m) how the force swings on from the record's beginning.

    A load on a spring goes on swinging for seconds, and how it did when a record begins nobody has
    measured. What it adds to the rows of the force, e^{s t} for each of its poles s, is fitted to
    them and taken away (variable projection, Golub and Pereyra 1973).
    """
    axis = model.axis
    values = dict(zip(axis.parameters.names, theta.tolist(), strict=True))
    poles: list[complex] = []
    for effect in axis.effects:
        own = {item.name: values[f"{effect.name}.{item.name}"] for item in effect.parameters}
        poles += effect.swings(own)
    if not poles:
        return lambda rows: rows
    waves = np.exp(np.outer(poles, np.arange(data.m) / data.row_rate))
    C, force = np.vstack([waves.real, waves.imag]), axis.equations.index("force")
    used = data.used(axis)[force]
    amplitudes = np.linalg.pinv(C * used)

    def without(rows: FloatArray) -> FloatArray:
        left = rows.copy()
        left[..., force, :] -= (rows[..., force, :] * used) @ amplitudes @ C
        return left

    return without


def _perturbed(
    model: BalanceFunctions,
    theta: FloatArray,
    names: Sequence[str],
    sizes: Mapping[str, float],
) -> tuple[list[FloatArray], list[float]]:
    """Return θ, copies of it with one parameter perturbed each, and the perturbations."""
    parameters = model.axis.parameters
    variants, step_sizes = [theta], []
    for name in names:
        item, at = parameters[name], parameters.index(name)
        h = sizes.get(name, DIFFERENCE * item.scale)
        if theta[at] + h > item.upper:
            h = -h
        moved = theta.copy()
        moved[at] += h
        variants.append(moved)
        step_sizes.append(h)
    return variants, step_sizes


def _undecimated(
    model: BalanceFunctions,
    data: SmoothedMotion,
    variants: Sequence[FloatArray],
    jacobian: bool = False,
) -> list[FloatArray]:
    """Return r (ne, N) for every variant of θ, and last the Jacobian of the first (ne n, N)."""
    motions = true_motions(model, data, variants)
    states = simulate_effect_states(model, data, variants, motions)
    residuals: list[FloatArray] = []
    jacobians: list[FloatArray] = []
    c, functions = model.constant_values, model.functions
    for i, (theta, z, (x, dx)) in enumerate(zip(variants, states, motions, strict=True)):
        given = (x, dx, data.u, z, c, theta)
        if jacobian and i == 0:
            r, slope = functions["residual_and_jacobian"].evaluate(data.N, *given)
            jacobians = [slope]
        else:
            (r,) = functions["residual"].evaluate(data.N, *given)
        residuals.append(r)
    return residuals + jacobians
