"""CasADi's `sqpmethod`, its quadratic programs solved stage by stage by HPIPM."""

import casadi as ca
import numpy as np

from peer_tools import casadi_solvers
from peer_tools.casadi_solvers import version  # noqa: F401
from peer_tools.estimation import Answer, Estimation


def build(problem: Estimation) -> tuple[ca.Function, np.ndarray]:
    """Write the program with its stages."""
    nlp, hessian, start = casadi_solvers.program(problem, 1.0)
    solver = ca.nlpsol(
        "solver",
        "sqpmethod",
        nlp,
        {
            "hess_lag": hessian,
            "qpsol": "hpipm",
            "qpsol_options": casadi_solvers.options(problem) | {"print_time": False},
            "print_header": False,
            "print_iteration": False,
            "print_time": False,
            "max_iter": 50,
        },
    )
    return solver, start


def solve(problem: Estimation, built: tuple[ca.Function, np.ndarray]) -> Answer:
    """Solve from the smoothed measurements."""
    return casadi_solvers.answer(problem, *built)
