"""Changed residuals of a problem: a quantity held at a value, measured flows shifted."""

from dataclasses import replace

import casadi as ca
import numpy as np

from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.output_error.derived import Quantity
from pneumo_casadi.estimation.output_error.shooting.problem import Problem
from pneumo_casadi.parameters import FloatArray


def hold_quantity(problem: Problem, item: Quantity, value: float, width: float) -> Problem:
    """Return the problem with the residual (g(θ) - value)/width beside those of the flow map.

    A width far below what the data can tell makes it a constraint. Parameters and ratios of
    them are held alike, and the compiled functions of the problem serve for all of them.
    """
    names = problem.parameters.names
    theta = ca.MX.sym("theta", len(names))
    quantity, gradient = item.function(theta)
    rows, slopes, n_prior = [(quantity - value) / width], [ca.densify(gradient / width)], 1
    if problem.anchor is not None:
        at = [names.index(name) for name in problem.anchor.names]
        r, J = problem.anchor.residual(theta[at])
        wide = ca.MX.zeros(problem.anchor.n, len(names))
        wide[:, at] = J
        rows, slopes = [r, *rows], [wide, *slopes]
        n_prior += problem.anchor.n_prior
    residual = ca.Function(
        "residual_with_held_quantity", [theta], [ca.vertcat(*rows), ca.vertcat(*slopes)]
    )
    start = problem.parameters.values
    return replace(problem, anchor=Anchor(residual, names, start, n_prior))


def shift_measured_flows(anchor: Anchor, shift: FloatArray) -> Anchor:
    """Return the flow map's residuals as if each point had been measured `shift` σ lower."""
    c = ca.MX.sym("c", len(anchor.names))
    r, J = anchor.residual(c)
    return replace(anchor, residual=ca.Function("metered", [c], [r + np.asarray(shift), J]))
