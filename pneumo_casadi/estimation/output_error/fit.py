"""The output-error fit: of data as they are, or of long data by way of a sample."""

from collections.abc import Sequence

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error.long_records import are_long, fit_long_records
from pneumo_casadi.estimation.output_error.options import OutputErrorOptions
from pneumo_casadi.estimation.output_error.result import OutputErrorResult
from pneumo_casadi.estimation.output_error.stages import fit_stages
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.progress import Progress, no_progress
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import AnyFlowMap


@one_thread
def fit_output_error(
    axis: Axis,
    records: Recording | Sequence[Recording],
    flow_map: AnyFlowMap | None = None,
    options: OutputErrorOptions | None = None,
    progress: Progress | None = None,
) -> OutputErrorResult:
    """Fit all free parameters of an axis by multiple shooting.

    Minimises ½ Σ ((y - ŷ)/σ)² over parameters and initial states, subject to the axis'
    equations. y are the measured and ŷ the simulated outputs (p_P and p_N [Pa], x [m]), both as
    means over blocks of samples; σ is the standard deviation of the noise of each mean. If flow
    coefficients are free, the squared residuals of the measured flow map are added.

    Parameters
    ----------
    axis : Axis
        Its parameters give the starting values (from WLS, say) and what is free.
    records : Recording or sequence of Recording
        Fitted together; each has its own initial state.
    flow_map : FlowMap, optional
        Measured map; needed where flow coefficients are free.
    options : OutputErrorOptions, optional
        Solver, blocks, windows, widths.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    OutputErrorResult

    Raises
    ------
    ModelError
        If flow coefficients and X_s are free without a measured map (their common scale
        changes no trajectory), or nothing is free.
    FitError
        If a stage does not converge; ``.partial`` holds the result as far as it got.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``, refitted to one second with the flow map
    held:

    >>> fixed = result.flow.parameters.names
    >>> start = result.axis.with_parameters(result.axis.parameters.fix(*fixed))
    >>> fit = pc.fit_output_error(start, [result.records[0].window(10.0, 11.0)])
    >>> fit.status, round(fit.parameters["M"].value, 1)
    ('converged', 16.9)
    """
    options = options or OutputErrorOptions()
    report = progress or no_progress
    records = (records,) if isinstance(records, Recording) else tuple(records)
    if not records:
        raise ModelError("no record to fit")
    if are_long(axis, records, options):
        return fit_long_records(axis, records, flow_map, options, report)
    return fit_stages(axis, records, flow_map, options, report)
