"""Simulations of held-out records, each done once, and the gap that they show."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.diagnosis.metrics.findings import Closure
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, residual_rms
from pneumo_casadi.diagnosis.metrics.simulated_fit import (
    WINDOW,
    Simulated,
    signal_stds,
    simulate_fit,
    simulate_loop,
)
from pneumo_casadi.diagnosis.prepare.criteria import Criteria, in_floors
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import StudyJobs
from pneumo_casadi.metrics import closure, closure_interval, combined_gap, gap, output_noise
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.validation.simulations import Rows

REPLICATES = 1000
#: Windows of which an interval is worth its name; a record of 20 s has 40.
FEWEST_WINDOWS = 10


@dataclass(eq=False)
class Simulations:
    """Simulations of a study's held-out records, each done once.

    Parameters
    ----------
    study : Study
        The case.
    """

    study: Study

    def __post_init__(self) -> None:
        self._kept: dict[tuple[FittedModel, float], Simulated] = {}
        self._begun: dict[tuple[FittedModel, float], Future[Simulated]] = {}
        self._loops: dict[FittedModel, Future[dict[str, float] | str]] = {}

    def of(
        self, fitted: FittedModel, effects: Sequence[Effect], window: float = WINDOW
    ) -> Simulated:
        """Return the simulations of a fit in windows [s], initial states estimated."""
        key = fitted, window
        if key in self._begun:
            self._kept[key] = self._begun.pop(key).result()
        elif key not in self._kept:
            self._kept[key] = simulate_fit(self.study, fitted, effects, window)
        return self._kept[key]

    def knows(self, fitted: FittedModel, window: float = WINDOW) -> bool:
        """Tell whether a fit was simulated, or will be."""
        return (fitted, window) in self._kept or (fitted, window) in self._begun

    def keep(self, fitted: FittedModel, simulated: Simulated, window: float = WINDOW) -> None:
        """Remember what was simulated elsewhere."""
        self._kept[fitted, window] = simulated

    def expect(self, fitted: FittedModel, job: "Future[Simulated]", window: float = WINDOW) -> None:
        """Remember what is simulated elsewhere; who asks for it waits."""
        self._begun[fitted, window] = job

    def windows(
        self, fitted: FittedModel, effects: Sequence[Effect], window: float = WINDOW
    ) -> FloatArray | str:
        """Return squared errors of every window, or why it cannot be simulated."""
        return self.of(fitted, effects, window).windows

    def trajectories(
        self, fitted: FittedModel, effects: Sequence[Effect]
    ) -> list[tuple[Recording, Rows, Trajectory]]:
        """Return records, samples and simulations of their windows; none where they fail."""
        simulated = self.of(fitted, effects)
        if isinstance(simulated.windows, str):
            return []
        return [
            (record, *run) for record, run in zip(self.study.held_out, simulated.runs, strict=True)
        ]

    @property
    def have_loop(self) -> bool:
        """Whether controller and references are known, so that the closed loop can be simulated."""
        study = self.study
        known = all("x_ref" in record for record in study.held_out)
        return known and study.axis.bench.controller.closes_loop

    def begin_loops(self, models: Mapping[FittedModel, Sequence[Effect]], jobs: StudyJobs) -> None:
        """Begin to simulate closed loops where there is an executor; `loop` waits for them."""
        if jobs.executor is not None and self.have_loop:
            for fitted, effects in models.items():
                if fitted not in self._loops:
                    self._loops[fitted] = jobs.run(simulate_loop, fitted, effects)

    def loop(self, fitted: FittedModel, effects: Sequence[Effect]) -> dict[str, float] | str:
        """Return the gap of every output under the controller, or why there is none."""
        if fitted in self._loops:
            return self._loops[fitted].result()
        return simulate_loop(self.study, fitted, effects)

    def tells(
        self,
        nominal: FittedModel,
        fitted: FittedModel,
        effects: Sequence[Effect],
        window: float = WINDOW,
    ) -> bool:
        """Return whether there is a gap, and both fits can be simulated: else `share` is 1."""
        before, after = self.windows(nominal, (), window), self.windows(fitted, effects, window)
        if isinstance(before, str) or isinstance(after, str):
            return False
        return self.leave_gap(nominal, (), window)

    def leave_gap(
        self, fitted: FittedModel, effects: Sequence[Effect], window: float = WINDOW
    ) -> bool:
        """Return whether windows of a fit leave what calls for a cause, as in balances (`clean`).

        One that cannot be simulated leaves all.
        """
        squares = self.windows(fitted, effects, window)
        return isinstance(squares, str) or _shows(squares, self.floor, self.study.criteria.clean)

    def alone_show_gap(
        self, fitted: FittedModel, effects: Sequence[Effect], levels: BalanceLevels
    ) -> bool:
        """Return whether windows of a fit show a gap, and its balances show none."""
        visible = levels.criteria.visible
        if np.any(levels.exceeded(residual_rms(fitted), visible)):
            return False
        squares, floor = self.windows(fitted, effects), self.floor
        return not isinstance(squares, str) and _shows(squares, floor, visible)

    def surely_explained(
        self,
        nominal: FittedModel,
        fitted: FittedModel,
        effects: Sequence[Effect],
        criteria: Criteria,
    ) -> bool:
        """Return whether a fit surely closes a visible gap of the windows, in every output.

        It leaves less than `simulated` by the 95 % interval, and of each output half at most, or
        nothing visible. Few windows have no interval.
        """
        before, after, floor = self.windows(nominal, ()), self.windows(fitted, effects), self.floor
        if isinstance(before, str) or isinstance(after, str) or len(before) < FEWEST_WINDOWS:
            return False
        if not _shows(before, floor, criteria.visible):
            return False
        old, new = (gap(squares.mean(axis=0), floor) for squares in (before, after))
        kept = (new > criteria.unexplained * old) & (new > criteria.visible * floor)
        closed = closure_of(before, after, floor)
        return closed.lower > 1.0 - criteria.simulated and not np.any(kept)

    @property
    def floor(self) -> FloatArray:
        """What the noise of each output leaves [%]."""
        return np.array(list(noise_percent(self.study).values()))

    @property
    def _right_model(self) -> FloatArray:
        """What a right model leaves of each output [%]: a tenth more than noise, as of balances.

        Of 38 axes of the virtual bench without an effect, windows held 0.2 to 0.8 floors beside the
        noise, in the middle 0.4.
        """
        return in_floors(self.study.criteria.background) * self.floor

    def share(
        self,
        nominal: FittedModel,
        fitted: FittedModel,
        effects: Sequence[Effect],
        window: float = WINDOW,
    ) -> float:
        """Return the share of the windows' gap that a fit leaves, beyond what a right model does.

        1 if it cannot be simulated, or where there is no gap to be closed.
        """
        before, after = self.windows(nominal, (), window), self.windows(fitted, effects, window)
        if isinstance(before, str) or isinstance(after, str):
            return 1.0
        if not self.leave_gap(nominal, (), window):
            return 1.0
        floor = self._right_model
        return 1.0 - closure(overall_gap(before, floor), overall_gap(after, floor))

    def closure(
        self,
        base: FittedModel,
        fitted: FittedModel,
        effects: Sequence[Effect],
        of_base: Sequence[Effect] = (),
    ) -> Closure:
        """Return the share of the gap of a base model that a fit closes, with its interval."""
        before, after = self.windows(base, of_base), self.windows(fitted, effects)
        if isinstance(before, str) or isinstance(after, str):
            return Closure(0.0, 0.0, 0.0)
        return closure_of(before, after, self._right_model)


def _shows(squares: FloatArray, floor: FloatArray, visible: float) -> bool:
    """Return whether squared errors show a gap, beside the noise [floors]."""
    return overall_gap(squares, floor) > visible * combined_gap(floor)


def noise_percent(study: Study) -> dict[str, float]:
    """Return the noise of each output [% of its signal]."""
    return {
        name: 100 * output_noise(study.axis, study.held_out, name) / std
        for name, std in zip(study.axis.outputs, signal_stds(study).tolist(), strict=True)
    }


def overall_gap(squares: FloatArray, floor: FloatArray) -> float:
    """Return the gap of all outputs together [%], of squared errors by window and output [%²]."""
    return combined_gap(gap(squares.mean(axis=0), floor))


def closure_of(before: FloatArray, after: FloatArray, floor: FloatArray) -> Closure:
    """Return the closure with its interval from resampled windows."""
    outputs = np.ones(before.shape[1])
    interval = closure_interval(
        before.T, after.T, np.ones_like(before.T), floor, outputs, REPLICATES
    )
    return Closure(closure(overall_gap(before, floor), overall_gap(after, floor)), *interval)
