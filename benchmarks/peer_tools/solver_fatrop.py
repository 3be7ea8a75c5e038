"""FATROP as a nonlinear solver, through CasADi."""

import casadi as ca
import numpy as np

from peer_tools import casadi_solvers
from peer_tools.casadi_solvers import version  # noqa: F401
from peer_tools.estimation import Answer, Estimation


def build(problem: Estimation) -> tuple[ca.Function, np.ndarray]:
    """Write the program with its stages."""
    # This plugin takes no Hessian from outside: it has the exact one differentiated.
    nlp, _, start = casadi_solvers.program(problem, -1.0)
    settings = casadi_solvers.options(problem)
    settings["structure_detection"] = "manual"
    more = {"print_time": False, "fatrop": {"print_level": 0}}
    return ca.nlpsol("solver", "fatrop", nlp, settings | more), start


def solve(problem: Estimation, built: tuple[ca.Function, np.ndarray]) -> Answer:
    """Solve from the smoothed measurements."""
    return casadi_solvers.answer(problem, *built)
