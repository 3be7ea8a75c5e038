"""One output-error fit: from a start to parameters with intervals, stage by stage."""

import logging
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.data import Clock, Recording
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.equation_error.driven_states import states_along
from pneumo_casadi.estimation.flow_anchor import anchor_flow
from pneumo_casadi.estimation.flow_scale import flow_scale_covariance
from pneumo_casadi.estimation.output_error.information import estimate_uncertainty
from pneumo_casadi.estimation.output_error.options import Method, OutputErrorOptions, plan_stages
from pneumo_casadi.estimation.output_error.result import (
    OutputErrorResult,
    Stage,
    evaluate_derived_quantities,
    flow_map_deviation,
)
from pneumo_casadi.estimation.output_error.shooting.interval import IntervalFunctions
from pneumo_casadi.estimation.output_error.shooting.problem import Problem
from pneumo_casadi.estimation.output_error.shooting.segments import cut_segments
from pneumo_casadi.estimation.output_error.solvers.ipopt import IpoptSolver
from pneumo_casadi.estimation.output_error.solvers.multiple_shooting import (
    solve_gauss_newton,
    solve_near_optimum,
)
from pneumo_casadi.estimation.output_error.solvers.solution import Solution, new_sigma
from pneumo_casadi.estimation.output_error.starts import Begin, measured_start
from pneumo_casadi.estimation.statistics import stated_or_estimated_noise
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.integration import sample_lengths
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import Stepping, stepping_for
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.runtime.progress import Progress
from pneumo_casadi.valve import AnyFlowMap

logger = logging.getLogger(__name__)


#: Relative difference of sampling periods that one model may serve: the clocks of two loggers and
#: jitter stay below it, and accelerations are wrong by twice as much, which no interval contains.
SAME_PERIOD = 1e-4
#: How often IPOPT solves again with a new estimate of the noise.
REWEIGHTINGS = 40
#: How often a stage is solved again with steps as fine as the friction found needs.
STEPPINGS = 3


def fit_stages(
    axis: Axis,
    records: Sequence[Recording],
    flow_map: AnyFlowMap | None,
    options: OutputErrorOptions,
    report: Progress,
    begin: Begin = measured_start,
) -> OutputErrorResult:
    """Fit all free parameters, every stage over all data; see `fit_output_error`.

    Parameters
    ----------
    begin : callable
        Gives the point at which a stage begins.
    """
    sigma = np.array([stated_or_estimated_noise(axis.bench, records, c) for c in axis.outputs])
    stages: list[Stage] = []
    parameters = axis.parameters
    rungs = plan_stages(options)
    for i, rung in enumerate(rungs):
        share = i / len(rungs)
        for attempt in range(STEPPINGS):
            axis = axis.with_parameters(parameters)
            done = share + attempt / STEPPINGS / len(rungs)
            report(f"{rung.name}: writing and compiling", done)
            problem = write_problem(axis, records, flow_map, rung.options)
            _ = (
                problem.functions.sensitivity
            )  # compiled here: the time of a stage is that of solving
            report(rung.name, done + 0.5 / STEPPINGS / len(rungs))
            began = time.perf_counter()
            solution = _solve(problem, rung.options, sigma, rung.refine, begin)
            problem.memory.release()  # the statistics need other arrays
            stage = Stage(
                rung.name,
                rung.options.widths[-1],
                problem.cost(solution.point.theta, solution.m, sigma),
                solution.iterations,
                solution.status,
                time.perf_counter() - began,
            )
            result = _result(problem, solution, (*stages, stage), records)
            stages = list(result.stages)
            logger.info(
                "%s: %s, %d iterations, cost %.6g",
                rung.name,
                solution.status,
                solution.iterations,
                stage.cost,
            )
            if solution.status != "converged":
                break
            parameters = result.parameters
            # Stronger friction than at the start needs finer steps; otherwise the error of the
            # integration biases it, and the result depends on the starting values.
            if stepping_of(result.axis, records, rung.options) == problem.model.stepping:
                break
        if solution.status == "converged" and rung.last:
            report("done", 1.0)
            return result if flow_map is None else _with_scale_uncertainty(result)
    tried = (
        "iterations, also by way of short windows and wider friction"
        if options.recover
        else "iterations"
    )
    raise FitError(
        f"output error: {solution.status} in stage {rung.name!r} after {solution.iterations} "
        f"{tried}. The model may omit dynamics that the data show, or map and bench may "
        "not belong to the axis; fit shorter windows (window=0.25, --window 0.25), which tolerate "
        "more misfit, and see where model and measurement disagree",
        result,
    )


def _with_scale_uncertainty(result: OutputErrorResult) -> OutputErrorResult:
    """Widen the covariances by the stated accuracy of the meter of a map that was held.

    A map that is fitted brings it along, see `anchor_flow`.
    """
    known = result.uncertainty
    if set(known.names) & set(result.axis.flow_parameters):
        return result
    values = result.parameters.select(known.names).values
    added = flow_scale_covariance(known.names, values, result.axis)
    robust, scatter = (
        None if part is None else part + added
        for part in (known.covariance_robust, known.covariance_scatter)
    )
    wider = replace(
        known,
        covariance=known.covariance + added,
        covariance_robust=robust,
        covariance_scatter=scatter,
    )
    derived = evaluate_derived_quantities(result.axis, wider)
    return replace(result, uncertainty=wider, derived=derived)


def write_problem(
    axis: Axis,
    records: Sequence[Recording],
    flow_map: AnyFlowMap | None,
    options: OutputErrorOptions,
) -> Problem:
    """Check that the problem is well posed and write it down."""
    parameters = axis.parameters
    if not parameters.free_names:
        raise ModelError("no parameter is free: release some with `Parameters.release`")
    _refuse_free_gauge(axis, parameters, flow_map)
    _refuse_other_clocks(records)
    n = max(1, round(options.block / records[0].dt))
    stepping = stepping_of(axis, records, options)
    model = SampledAxis(axis, stepping, axis.bench.controller if options.closed_loop else None)
    # No step within a window brings back what a sampled state remembers from before it.
    jumping = axis.sampled_states and options.window is not None
    driven = states_along(axis, records) if jumping else ()
    segments = cut_segments(model, records, n, options.window, options.interval, driven)
    functions = IntervalFunctions(model, n, segments[0].per, parameters.free_names)
    known = anchor_flow(axis, flow_map)
    if known is not None and not set(known.names) & set(parameters.free_names):
        known = None
    problem = Problem(model, parameters, segments, functions, known)
    _refuse_too_few(problem)
    return problem


def _refuse_other_clocks(records: Sequence[Recording]) -> None:
    """Refuse records that one sampled model cannot serve.

    All are simulated with the sampling period of the first: see `SAME_PERIOD`.
    """
    first = records[0]
    alike = all(
        r.clock is first.clock
        and r.hold is first.hold
        and (r.clock is Clock.AS_RECORDED or abs(r.dt / first.dt - 1) <= SAME_PERIOD)
        for r in records
    )
    if not alike:
        clocks = [
            f"{r.name}: {1 / r.dt:.6g} Hz, clock {r.clock.value}, hold {r.hold.value}"
            for r in records
        ]
        raise ModelError(
            f"records differ in sampling frequency, clock or input hold: {'; '.join(clocks)}; "
            'resample them to one clock, state "clock": "as recorded", or fit them apart'
        )


def _refuse_too_few(problem: Problem) -> None:
    states = problem.model.n_initial * len(problem.segments)
    outputs = problem.y.size
    points = 0 if problem.anchor is None else problem.anchor.n
    if outputs <= states or outputs + points <= states + len(problem.free):
        raise ModelError(
            f"{outputs} mean outputs for {states} initial states and {len(problem.free)} "
            "parameters: take longer windows or records, or shorter blocks"
        )


def stepping_of(axis: Axis, records: Sequence[Recording], options: OutputErrorOptions) -> Stepping:
    """Return the stepping for the narrowest friction of a stage.

    With the effects as they are and without: one that softens the axis where the fit starts
    (presliding) may vanish on the way.
    """
    dt = records[0].dt
    every = [sample_lengths(record, dt) for record in records]
    timed = [lengths for lengths in every if lengths is not None]
    narrow = axis.with_parameters({"v_s": min(options.widths)})
    return stepping_for(
        narrow,
        dt,
        records[0].hold,
        np.concatenate(timed) if timed else None,
        options.longest_step,
        (narrow.at_null_values(),),
    )


def _refuse_free_gauge(axis: Axis, parameters: Parameters, flow_map: AnyFlowMap | None) -> None:
    if not axis.kind.needs_flow_map or anchor_flow(axis, flow_map) is not None:
        return
    coefficients = set(axis.flow_parameters)
    chambers = {f"X_s{i}" for i in range(1, 7)}
    free = set(parameters.free_names)
    if free >= coefficients | chambers:
        raise ModelError(
            "flow coefficients and X_s1 ... X_s6 are free together without a measured flow map: "
            "multiplying them all by one constant changes no trajectory. Give `flow_map`, or fix "
            "the coefficients with `parameters.fix(*axis.flow.parameters.names)`"
        )


def _solve(
    problem: Problem,
    options: OutputErrorOptions,
    sigma: FloatArray,
    reweight: bool,
    begin: Begin,
) -> Solution:
    """Solve one problem at the width of the stage."""
    theta = problem.parameters.values
    theta[problem.parameters.index("v_s")] = options.widths[-1]
    point = begin(problem, theta, sigma)
    if begin is not measured_start:
        return solve_near_optimum(problem, point, sigma, reweight, options.max_iterations)
    if options.method is Method.GAUSS_NEWTON:
        return solve_gauss_newton(problem, point, sigma, reweight, options.max_iterations)
    ipopt = IpoptSolver(problem, options.max_iterations)
    solution = ipopt.solve(point, sigma)
    iterations = solution.iterations
    for _ in range(REWEIGHTINGS if reweight else 0):
        new = new_sigma(problem, solution.m, sigma)
        if new is None or solution.status != "converged":
            break
        sigma = new
        solution = ipopt.solve(solution.point, sigma)
        iterations += solution.iterations
    else:
        if reweight:
            solution = replace(solution, status="the noise has not settled")
    return replace(solution, sigma=sigma, iterations=iterations)


def _result(
    problem: Problem,
    solution: Solution,
    stages: tuple[Stage, ...],
    records: Sequence[Recording],
) -> OutputErrorResult:
    point, sigma = solution.point, solution.sigma
    axis = problem.axis.with_parameters(problem.parameters.with_values(point.theta))
    uncertainty = estimate_uncertainty(problem, solution, records)
    own_states = len(problem.axis.states)
    with np.errstate(over="ignore"):  # residuals of a model that ran away are infinite
        rms = np.sqrt(np.mean((problem.y - solution.m) ** 2, axis=1))
    return OutputErrorResult(
        axis,
        solution.status,
        problem.cost(point.theta, solution.m, sigma),
        sigma,
        rms,
        uncertainty,
        evaluate_derived_quantities(axis, uncertainty),
        stages,
        problem.segments,
        tuple(np.split(solution.m, np.cumsum([s.K for s in problem.segments])[:-1], axis=1)),
        tuple(point.x[:own_states, i] for i in problem.firsts),
        None if problem.anchor is None else flow_map_deviation(problem.anchor, axis),
    )
