"""A fit together with what it was fitted to: where every study of its uncertainty starts.

All that this package asks of the output-error core is in this file: write the problem, solve it
from a point with the noise held, and the information there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions, OutputErrorResult
from pneumo_casadi.estimation.output_error.derived import Quantity, find_quantity
from pneumo_casadi.estimation.output_error.information import gauss_newton_information
from pneumo_casadi.estimation.output_error.shooting.condensing import anchor_normal_equations
from pneumo_casadi.estimation.output_error.shooting.problem import Problem, Unknowns
from pneumo_casadi.estimation.output_error.solvers.multiple_shooting import solve_gauss_newton
from pneumo_casadi.estimation.output_error.solvers.solution import Solution
from pneumo_casadi.estimation.output_error.stages import write_problem
from pneumo_casadi.estimation.statistics import delta_std
from pneumo_casadi.model.stepping import substeps_for
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import AnyFlowMap

#: Growth of the steps per sample that friction needs from which a problem is written anew.
FINER = 1.25
#: Standard deviations by which an optimum found again may differ.
AGAIN = 0.1


@dataclass(frozen=True, eq=False)
class Optimum:
    """A converged output-error fit with its data.

    Parameters
    ----------
    result : OutputErrorResult
        From `fit_output_error` on the same axis, data and options.
    records : sequence of Recording
        That were fitted.
    flow_map : FlowMap, optional
        Measured map, where it was given to the fit.
    options : OutputErrorOptions, optional
        Of the fit. The noise is held at the fit's own estimate whatever they say, so that costs
        compare.

    Raises
    ------
    FitError
        If the fit did not converge.
    ModelError
        If result and data do not belong together.
    """

    result: OutputErrorResult
    records: Sequence[Recording]
    flow_map: AnyFlowMap | None = None
    options: OutputErrorOptions = OutputErrorOptions()  # noqa: RUF009

    def __post_init__(self) -> None:
        if self.result.status != "converged":
            raise FitError(f"no uncertainty without an optimum: {self.result.status}", self.result)
        v_s = self.result.parameters["v_s"].value
        window = self.options.window or self.result.chosen_window
        object.__setattr__(self, "options", replace(self.options, widths=(v_s,), window=window))
        object.__setattr__(self, "records", tuple(self.records))

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: self.__dict__[item.name] for item in fields(self)}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters."""
        return self.result.uncertainty.names

    @property
    def columns(self) -> list[int]:
        """Places of the fitted parameters among all parameters of the axis."""
        return [self.result.parameters.index(name) for name in self.names]

    @property
    def sizes(self) -> FloatArray:
        """Size of each fitted parameter: its value or its scale, whichever is larger."""
        chosen = self.result.parameters.select(self.names)
        sizes: FloatArray = np.maximum(np.abs(chosen.values), chosen.scales)
        return sizes

    def quantity(self, name: str) -> Quantity:
        """Return a fitted parameter, or a derived quantity, by its name."""
        if name in self.result.parameters and name not in self.names:
            raise ModelError(f"parameter {name} was held fixed in the fit: release it there")
        return find_quantity(self.result.axis, name)

    def std(self, item: Quantity, robust: bool = False) -> float:
        """Return the standard deviation of a quantity by the delta method."""
        uncertainty = self.result.uncertainty
        covariance = uncertainty.covariance_scatter if robust else uncertainty.covariance
        if covariance is None:
            covariance = uncertainty.covariance
        gradient = item.gradient(self.result.parameters.values)
        return delta_std(gradient[self.columns], covariance)

    @cached_property
    def problem(self) -> Problem:
        """The problem whose optimum this is."""
        problem = write_problem(self.result.axis, self.records, self.flow_map, self.options)
        used, given = (
            [(s.record, s.n, s.y.shape) for s in segments]
            for segments in (self.result.segments, problem.segments)
        )
        if used != given or not all(
            np.array_equal(a.y, b.y) and np.array_equal(a.w, b.w)
            for a, b in zip(self.result.segments, problem.segments, strict=True)
        ):
            raise ModelError(
                "records or options are not those of the fit: give the records, flow map, block, "
                "window and loop that the result came from"
            )
        return problem

    @cached_property
    def solution(self) -> Solution:
        """The optimum found again, states included."""
        start = replace(self.problem.start(), theta=self.result.parameters.values)
        solution = solve_from(self, self.problem, start)
        if solution.status != "converged":
            raise FitError(f"the optimum was not found again: {solution.status}", self.result)
        apart = np.abs(solution.point.theta - self.result.parameters.values)[self.columns]
        std = np.fmax(self.result.uncertainty.std, self.result.uncertainty.std_robust)
        if np.any(apart > AGAIN * std):
            raise ModelError(
                "the fit's optimum is not that of these data: parameters move by more than "
                f"{AGAIN:g} standard deviations; give the flow map and options of the fit"
            )
        return solution

    @property
    def point(self) -> Unknowns:
        """The optimum as a point of the problem."""
        return self.solution.point

    def cost(self, problem: Problem, solution: Solution) -> float:
        """Return ½ Σ (residual/σ)² of a solution, with the noise of the fit."""
        return problem.cost(solution.point.theta, solution.m, self.result.sigma)

    @cached_property
    def information(self) -> FloatArray:
        """Information on the fitted parameters in units of `sizes`, initial states eliminated."""
        matrix = gauss_newton_information(self.problem, self.point, self.result.sigma).matrix
        return self._scaled(self.problem, matrix)

    def information_of(self, record: int) -> FloatArray:
        """Return what one record alone says, its own initial states eliminated.

        In units of `sizes`; the flow map is left out.
        """
        own = tuple(s for s in self.problem.segments if s.record == record)
        # Held by their bounds, not fixed: the functions know the same free parameters.
        held = self.problem.parameters.with_values(self.point.theta)
        for name in self.names:
            held = held.bounded(name, held[name].value, held[name].value)
        part = replace(self.problem, segments=own, anchor=None, parameters=held)
        solution = solve_from(self, part, replace(part.start(), theta=self.point.theta))
        if solution.status != "converged":
            raise FitError(
                f"record {self.records[record].name}: no initial state at the optimum "
                f"({solution.status})",
                self.result,
            )
        return self._scaled(
            part, gauss_newton_information(part, solution.point, self.result.sigma).matrix
        )

    def information_of_map(self) -> FloatArray:
        """Return what the flow map alone says, in units of `sizes`; zeros without one."""
        matrix, _ = anchor_normal_equations(self.problem, self.point.theta)
        return self._scaled(self.problem, matrix)

    def _scaled(self, problem: Problem, matrix: FloatArray) -> FloatArray:
        change = self.sizes / problem.free_scales
        scaled: FloatArray = matrix * np.outer(change, change)
        return scaled

    def refined(self, problem: Problem, theta: FloatArray) -> Problem:
        """Return the problem, written with finer steps where θ (friction above all) needs them."""
        dt = self.records[0].dt
        axis = self.result.axis.with_parameters(self.result.parameters.with_values(theta))
        if substeps_for(axis, dt) <= FINER * substeps_for(problem.axis, dt):
            return problem
        return write_problem(axis, self.records, self.flow_map, self.options)


def solve_from(optimum: Optimum, problem: Problem, point: Unknowns) -> Solution:
    """Solve a problem from a point with the noise held at the fit's estimate.

    Where the start does not lead to an optimum, smoothed measurements are tried instead of its
    states.
    """
    limit = optimum.options.max_iterations
    sigma = optimum.result.sigma
    solution = solve_gauss_newton(problem, point, sigma, False, limit)
    if solution.status == "converged":
        return solution
    again = replace(problem.start(), theta=point.theta)
    cold = solve_gauss_newton(problem, again, sigma, False, limit)
    return cold if cold.status == "converged" else solution
