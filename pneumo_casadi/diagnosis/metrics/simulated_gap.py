"""The gap of simulations on held-out records, before and after effects are added."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.diagnosis.metrics.findings import Closure, Gap
from pneumo_casadi.diagnosis.metrics.residual_size import (
    BalanceLevels,
    balance_closure,
    residual_rms,
)
from pneumo_casadi.diagnosis.metrics.simulated_fit import (
    WINDOW,
    Simulated,
    signal_stds,
    simulate_fit,
    simulate_loop,
)
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import StudyJobs
from pneumo_casadi.metrics import (
    closure,
    closure_interval,
    combined_gap,
    gap,
    output_noise,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.simulation import Trajectory
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.validation.simulations import Rows

REPLICATES = 1000

View = dict[str, dict[str, float]]


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
        return _overall_gap(before, self.floor) > 0

    def alone_show_gap(self, nominal: FittedModel, levels: BalanceLevels) -> bool:
        """Return whether windows of the nominal model show a gap, and its balances show none."""
        visible = levels.criteria.visible
        if np.any(levels.exceeded(residual_rms(nominal), visible)):
            return False
        before, floor = self.windows(nominal, ()), self.floor
        if isinstance(before, str):
            return False
        return _overall_gap(before, floor) > visible * combined_gap(floor)

    @property
    def floor(self) -> FloatArray:
        """What the noise of each output leaves [%]."""
        return np.array(list(_noise_percent(self.study).values()))

    def share(
        self,
        nominal: FittedModel,
        fitted: FittedModel,
        effects: Sequence[Effect],
        window: float = WINDOW,
    ) -> float:
        """Return the share of the windows' gap that a fit leaves.

        1 if it cannot be simulated, or where there is no gap to be closed.
        """
        floor = self.floor
        before, after = self.windows(nominal, (), window), self.windows(fitted, effects, window)
        if isinstance(before, str) or isinstance(after, str):
            return 1.0
        return 1.0 - closure(_overall_gap(before, floor), _overall_gap(after, floor))

    def closure(
        self, nominal: FittedModel, fitted: FittedModel, effects: Sequence[Effect]
    ) -> Closure:
        """Return the share of the windows' gap that a fit closes, with its interval."""
        before, after = self.windows(nominal, ()), self.windows(fitted, effects)
        if isinstance(before, str) or isinstance(after, str):
            return Closure(0.0, 0.0, 0.0)
        return _closure(before, after, self.floor)


def simulated_gap(
    done: Simulations,
    nominal: FittedModel,
    final: FittedModel,
    effects: Sequence[Effect],
    levels: BalanceLevels,
) -> tuple[Gap, tuple[str, ...]]:
    """Return the gap before and after, and notes on what it does not tell.

    Parameters
    ----------
    nominal, final : FittedModel
        Fits without and with effects.
    effects : sequence of Effect
        Those of `final`, in the order of its model.
    """
    study, models = done.study, ((nominal, ()), (final, effects))
    notes: list[str] = []
    views: dict[str, View] = {"balances": _balances(study, nominal, final, levels)}
    noise = _noise_percent(study)
    before, after = (done.windows(*model) for model in models)
    failed = [why for why in (before, after) if isinstance(why, str)]
    notes += [f"windows of {WINDOW:g} s cannot be simulated: {why}" for why in failed]
    if not isinstance(before, str) and not isinstance(after, str):
        views["windows"] = _view(study.axis.outputs, before, after, noise)
    if done.have_loop:
        loops = [done.loop(*model) for model in models]
        notes += [f"the closed loop cannot be simulated: {w}" for w in loops if isinstance(w, str)]
        b, a = loops
        if not isinstance(b, str) and not isinstance(a, str):
            views["closed_loop"] = {
                name: {"before": b[name], "after": a[name], "noise": noise[name]}
                for name in study.axis.outputs
            }
    if isinstance(before, str) or isinstance(after, str):
        shown = views["balances"]
        sizes = {
            k: combined_gap([v[k] for v in shown.values()]) for k in ("before", "after", "noise")
        }
        balances = balance_closure(nominal, final, levels)
        balance_gap = Gap(sizes["before"], sizes["after"], sizes["noise"], balances, views)
        return balance_gap, (*notes, "the gap is that of the balances")
    floor = done.floor
    closed = _closure(before, after, floor)
    gaps = _overall_gap(before, floor), _overall_gap(after, floor)
    if closed.upper < 0:
        notes.append(
            f"with the effects, simulations of held-out records are farther off ({gaps[1]:.2g} %) "
            f"than without ({gaps[0]:.2g} %), but balances are met better: do not use their sizes"
        )
    if final is nominal and done.alone_show_gap(nominal, levels):
        notes.append(
            f"the balances show no gap, but simulations of held-out records are {gaps[0]:.2g} % of "
            "the motion off, and no effect alone explains that"
        )
    return Gap(*gaps, combined_gap(floor), closed, views), tuple(notes)


def gap_with_term(
    done: Simulations,
    gap: Gap,
    with_term: tuple[FittedModel, Sequence[Effect]] | None,
    levels: BalanceLevels,
) -> Gap:
    """Return a gap to which that of the model with a discovered term is added, view by view.

    Parameters
    ----------
    gap : Gap
        As `simulated_gap` returns it.
    with_term : (FittedModel, sequence of Effect) or None
        The fit with the term, and its effects. Without one, or where it cannot be simulated, the
        gap stays as it is.
    """
    if with_term is None or "windows" not in gap.views:
        return gap
    squares = done.windows(*with_term)
    if isinstance(squares, str):
        return gap
    noise = _noise_percent(done.study)
    fitted, _ = with_term
    sizes = {
        "windows": _gaps(done.study.axis.outputs, squares, noise),
        "balances": _balance_gaps(done.study, fitted, levels),
    }
    if "closed_loop" in gap.views:
        loop = done.loop(*with_term)
        sizes |= {} if isinstance(loop, str) else {"closed_loop": loop}
    views = {
        view: {
            name: dict(values) | ({"with_term": sizes[view][name]} if view in sizes else {})
            for name, values in outputs.items()
        }
        for view, outputs in gap.views.items()
    }
    overall = _overall_gap(squares, done.floor)
    return replace(gap, views=views, with_term=overall)


def _noise_percent(study: Study) -> dict[str, float]:
    return {
        name: 100 * output_noise(study.axis, study.held_out, name) / std
        for name, std in zip(study.axis.outputs, signal_stds(study).tolist(), strict=True)
    }


def _view(
    outputs: Sequence[str], before: FloatArray, after: FloatArray, noise: Mapping[str, float]
) -> View:
    b, a = (_gaps(outputs, squares, noise) for squares in (before, after))
    return {name: {"before": b[name], "after": a[name], "noise": noise[name]} for name in outputs}


def _gaps(
    outputs: Sequence[str], squares: FloatArray, noise: Mapping[str, float]
) -> dict[str, float]:
    return {name: float(gap(squares[:, i].mean(), noise[name])) for i, name in enumerate(outputs)}


def _balances(
    study: Study, nominal: FittedModel, final: FittedModel, levels: BalanceLevels
) -> View:
    b, a = (_balance_gaps(study, fitted, levels) for fitted in (nominal, final))
    noise = 100 * levels.noise / levels.signal
    return {
        name: {"before": b[name], "after": a[name], "noise": float(noise[i])}
        for i, name in enumerate(study.axis.equations)
    }


def _balance_gaps(study: Study, fitted: FittedModel, levels: BalanceLevels) -> dict[str, float]:
    size, noise = (100 * part / levels.signal for part in (residual_rms(fitted), levels.noise))
    return {name: float(gap(size[i] ** 2, noise[i])) for i, name in enumerate(study.axis.equations)}


def _overall_gap(squares: FloatArray, floor: FloatArray) -> float:
    return combined_gap(gap(squares.mean(axis=0), floor))


def _closure(before: FloatArray, after: FloatArray, floor: FloatArray) -> Closure:
    """Return the closure with its interval from resampled windows."""
    outputs = np.ones(before.shape[1])
    interval = closure_interval(
        before.T, after.T, np.ones_like(before.T), floor, outputs, REPLICATES
    )
    return Closure(closure(_overall_gap(before, floor), _overall_gap(after, floor)), *interval)
