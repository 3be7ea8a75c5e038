"""pneumo_casadi: condensed Gauss-Newton, with all that a fit returns, intervals included."""

import pickle
from typing import Any

import numpy as np

from peer_tools.estimation import N_OUTPUTS, Answer, Estimation
from peer_tools.judging import MECHANICAL, map_cost
from pneumo_casadi import __version__
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, fit_output_error


def version() -> str:
    """Return the tool's version."""
    return __version__


def build(problem: Estimation) -> Any:
    """Read axis, recording and flow map; functions are written and compiled by the fit itself."""
    return pickle.loads(problem.own)


def solve(problem: Estimation, built: Any, method: Method = Method.GAUSS_NEWTON) -> Answer:
    """Fit with the noise as it is known; the time of the stages is that of solving."""
    axis, record, flow_map = built
    window = None if problem.windows == 1 else problem.N / problem.windows * problem.dt
    widths = (problem.constants["v_s"],)
    options = OutputErrorOptions(method=method, window=window, widths=widths, reweight=False)
    result = fit_output_error(axis, [record], flow_map, options)
    residuals = [s.y - m for s, m in zip(result.segments, result.fitted, strict=True)]
    n = result.segments[0].n
    sigma = problem.sigma[:N_OUTPUTS, None]
    theta = [result.parameters[name].value for name in problem.names]
    records = 0.5 * n * sum(float(np.sum((e / sigma) ** 2)) for e in residuals)
    return Answer(
        theta,
        np.concatenate(result.initial_states),
        records + map_cost(problem, np.asarray(theta[MECHANICAL:])),
        result.status,
        result.iterations,
        sum(stage.seconds for stage in result.stages),
    )
