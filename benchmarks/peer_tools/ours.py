"""pneumo_casadi: condensed Gauss-Newton, with all that a fit returns, intervals included."""

import pickle
from typing import Any

import numpy as np

from peer_tools.estimation import N_OUTPUTS, Answer, Estimation
from pneumo_casadi import __version__
from pneumo_casadi.estimation.output_error import Method, OutputErrorOptions, fit_output_error


def version() -> str:
    """Return the tool's version."""
    return __version__


def build(problem: Estimation) -> Any:
    """Read axis and recording; functions are written and compiled by the fit itself."""
    return pickle.loads(problem.own)


def solve(problem: Estimation, built: Any, method: Method = Method.GAUSS_NEWTON) -> Answer:
    """Fit with the noise as it is known; the time of the stages is that of solving."""
    axis, record = built
    options = OutputErrorOptions(method=method, widths=(problem.constants["v_s"],), reweight=False)
    result = fit_output_error(axis, [record], options=options)
    residuals = [s.y - m for s, m in zip(result.segments, result.fitted, strict=True)]
    n = result.segments[0].n
    sigma = problem.sigma[:N_OUTPUTS, None]
    return Answer(
        [result.parameters[name].value for name in problem.names],
        result.initial_states[0],
        0.5 * n * sum(float(np.sum((e / sigma) ** 2)) for e in residuals),
        result.status,
        result.iterations,
        sum(stage.seconds for stage in result.stages),
    )
