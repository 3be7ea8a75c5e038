"""pneumo_casadi by IPOPT with MUMPS on the whole sparse program."""

from typing import Any

from peer_tools import ours
from peer_tools.estimation import Answer, Estimation
from pneumo_casadi.estimation.output_error import Method

version, build = ours.version, ours.build


def solve(problem: Estimation, built: Any) -> Answer:
    """Fit as `ours` does, by the other method."""
    return ours.solve(problem, built, Method.IPOPT)
