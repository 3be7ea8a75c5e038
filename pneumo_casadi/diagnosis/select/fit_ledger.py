"""Fits of one study, run in parallel and stored."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from pneumo_casadi.diagnosis.metrics.simulated_fit import WINDOW, simulate_fit
from pneumo_casadi.diagnosis.metrics.simulations import Simulations
from pneumo_casadi.diagnosis.prepare.begun_jobs import BegunJobs
from pneumo_casadi.diagnosis.prepare.credible import require_credible
from pneumo_casadi.diagnosis.prepare.fit_store import Store
from pneumo_casadi.diagnosis.prepare.fitted_model import (
    FAULTS,
    FittedModel,
    fit_model,
    refine_model,
)
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import StudyJobs
from pneumo_casadi.diagnosis.screen.background import Background
from pneumo_casadi.diagnosis.screen.directions import Direction, perturbation
from pneumo_casadi.diagnosis.screen.screen import ScreenResult, screened
from pneumo_casadi.estimation.equation_error.fit import MAX_ITERATIONS
from pneumo_casadi.model.effect import Effect, EffectFactory

Catalogue = Mapping[str, EffectFactory]
Names = tuple[str, ...]

#: Iterations that every candidate gets. Of 68 fits of an axis with hoses and weak effects five
#: needed more, and took half the time of all; none of them came near the best.
SEARCH_ITERATIONS = 8


@dataclass(frozen=True, slots=True)
class Start:
    """Where a fit begins; see `fit_model`."""

    values: Mapping[str, float]
    shapes: Sequence[Mapping[str, float]] = ()
    base: float | None = None
    trials: Sequence[Mapping[str, float]] = ()


@dataclass(frozen=True, slots=True)
class Failed:
    """A fit that failed, with the reason."""

    effects: Names
    reason: str


@dataclass(eq=False)
class FitLedger:
    """Run the fits of one study and store them.

    Parameters
    ----------
    study : Study
        The case.
    catalogue : mapping of str to effect class
        What may be the cause.
    executor : Executor or None
        Where the fits run; None for this process.
    store : Store or None
        Finished fits on disk.
    fits, failures, output_error_fits, gap_left
        Results so far; see `Selection`.
    directions : dict of str to tuple of Direction
        The perturbations by each effect, those left out included.
    left_out : set of str
        Effects of the catalogue that no further model has.
    trials : dict of tuple of str to (FittedModel, float)
        Models refined by output error, and the share of the simulated gap that they leave.
    begun_fits, begun_refinements : BegunJobs
        Fits, and refinements by output error, for which nobody has asked yet.
    by_simulation : bool
        Whether simulations alone show the gap by which an effect was found; see `Selection`.
    reduced : dict of tuple of str to FittedModel
        Models from which an effect was taken, where they are not credible; see `fit_without`.
    """

    study: Study
    catalogue: Catalogue
    executor: Executor | None = None
    store: Store | None = None
    fits: dict[Names, FittedModel] = field(default_factory=dict)
    failures: dict[Names, Failed] = field(default_factory=dict)
    directions: dict[str, tuple[Direction, ...]] = field(default_factory=dict)
    output_error_fits: dict[Names, FittedModel] = field(default_factory=dict)
    gap_left: dict[Names, float] = field(default_factory=dict)
    trials: dict[Names, tuple[FittedModel, float]] = field(default_factory=dict)
    begun_fits: BegunJobs = field(default_factory=BegunJobs)
    begun_refinements: BegunJobs = field(default_factory=BegunJobs)
    left_out: set[str] = field(default_factory=set)
    by_simulation: bool = False
    reduced: dict[Names, FittedModel] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._jobs = StudyJobs(self.study, self.executor)
        self._refined: set[Names] = set()
        self.simulations = Simulations(self.study)

    def effects(self, names: Iterable[str]) -> tuple[Effect, ...]:
        """Make the named effects, in the catalogue's order: one model, one machine code."""
        return tuple(self.catalogue[name]() for name in self.key(names))

    def key(self, names: Iterable[str]) -> Names:
        """Return names in the catalogue's order."""
        wanted = set(names)
        return tuple(name for name in self.catalogue if name in wanted)

    def run(self, job: Callable[..., object], *given: object) -> "Future[Any]":
        """Have the executor call ``job(study, *given)``; without one it is done at once."""
        return self._jobs.run(job, *given)

    def begin_simulations(self, fits: Mapping[Names, FittedModel], window: float = WINDOW) -> None:
        """Begin to simulate the held-out records by fits in windows [s]; each once.

        Without an executor they are done at once.
        """
        for key, fitted in fits.items():
            if not self.simulations.knows(fitted, window):
                job = self.run(simulate_fit, fitted, self.effects(key), window)
                self.simulations.expect(fitted, job, window)

    def begin_report(self, names: Names, fitted: FittedModel) -> None:
        """Begin the simulations of a model that its report shows, if there is an executor.

        Its processes wait now and then.
        """
        if self.executor is not None:
            self.begin_simulations({names: fitted})
            self.simulations.begin_loops({fitted: self.effects(names)}, self._jobs)

    def begin_fit(self, key: Names, start: Start) -> None:
        """Begin a fit for which `fit_all` may be asked next, if there is an executor.

        What nobody asks for is no fit of the study, and no file in the store.
        """
        if self.begins_ahead and key not in self.fits and key not in self.failures:
            self.begun_fits.add(key, start, self._begin(key, start))

    def screen_all(self, nominal: FittedModel) -> None:
        """Work out the directions of all effects at the nominal fit.

        Those with states take longest; they are the first, so that no process waits at the end.
        """
        made = {name: make() for name, make in self.catalogue.items()}
        new = [name for name in made if name not in self.directions]
        jobs = {
            name: self.run(perturbation, nominal, made[name])
            for name in sorted(new, key=lambda name: -len(made[name].states))
        }
        for name in new:
            try:
                self.directions[name] = jobs[name].result()
            except FAULTS as error:
                self.failures[(name,)] = Failed((name,), f"screen: {error}")

    @property
    def begins_ahead(self) -> bool:
        """Whether fits can begin before they are asked for: not without other processes."""
        return self.executor is not None and self.store is None

    @property
    def offered(self) -> dict[str, tuple[Direction, ...]]:
        """Directions of the effects that further models may have."""
        return {name: each for name, each in self.directions.items() if name not in self.left_out}

    def over(self, behind: Background, without: Collection[str] = ()) -> dict[str, ScreenResult]:
        """Screen the effects offered, but for some, over a background; see `screen`."""
        return self.screen(behind, [name for name in self.offered if name not in without])

    def screen(self, behind: Background, names: Iterable[str]) -> dict[str, ScreenResult]:
        """Screen some effects over a background, the most promising first."""
        results = [screened(name, self.directions[name], behind) for name in names]
        results.sort(key=lambda result: -result.explained)
        return {result.name: result for result in results}

    def fit_all(self, models: Mapping[Names, Start], to_end: bool = False) -> None:
        """Fit models from their starts, those that are not known already.

        All get some iterations. Of those that need more, the best goes on, and those that would
        reach it at their pace; the others stay as they are. With `to_end` all go on, because each
        is compared with a larger model and not with the others: one cut short would seem to lose
        more than it does.
        """
        new = [key for key in models if key not in self.fits and key not in self.failures]
        self._submit({key: models[key] for key in new}, SEARCH_ITERATIONS)
        best = min((self.fits[key].cost for key in models if key in self.fits), default=0.0)
        unfinished = {
            key: self.fits[key] for key in new if key in self.fits and self.fits[key].pace
        }
        near = [
            key
            for key, fitted in unfinished.items()
            if to_end or fitted.cost - SEARCH_ITERATIONS * fitted.pace <= best
        ]
        self._submit({key: Start(unfinished[key].values) for key in near}, MAX_ITERATIONS)
        for key in unfinished:
            try:
                if key in self.fits:
                    self._require_credible(key, self.fits[key])
            except FAULTS as error:
                self.failures[key] = Failed(key, str(error))
                del self.fits[key]

    def _require_credible(self, key: Names, fitted: FittedModel) -> None:
        """Reject a fit that is not credible; `fit_model` has not asked it of one cut short."""
        if fitted.pace:
            require_credible(self.study, self.effects(key), fitted.values)

    def _begin(
        self,
        key: Names,
        start: Start,
        max_iterations: int = SEARCH_ITERATIONS,
        credible: bool = True,
    ) -> "Future[FittedModel]":
        given = (start.values, start.shapes, start.base, max_iterations, start.trials, credible)
        return self.run(fit_model, self.effects(key), *given)

    def _submit(self, models: Mapping[Names, Start], max_iterations: int) -> None:
        jobs, search = {}, max_iterations == SEARCH_ITERATIONS
        for key, start in models.items():
            effects = self.effects(key)
            kept = None if self.store is None else self.store.read(effects)
            if kept is None:
                begun = self.begun_fits.take(key, start) if search else None
                jobs[key] = begun or self._begin(key, start, max_iterations)
            else:
                self.fits[key] = kept
        for key, job in jobs.items():
            try:
                self.fits[key] = job.result()
                if self.store is not None and not self.fits[key].pace:
                    self.store.write(self.effects(key), self.fits[key])
            except FAULTS as error:
                self.failures[key] = Failed(key, str(error))
                self.fits.pop(key, None)

    def fit_without(self, names: Names, some: Iterable[str]) -> dict[str, FittedModel | None]:
        """Return the fits of a model without each of some effects; None where there is no fit.

        Without an effect another one may take up what it did with a value that is not credible.
        Such a fit is no model of the axis, but it tells how much is missed at least.
        """
        keys = {name: self.key(set(names) - {name}) for name in some}
        whole = self.fits[names]
        starts = {key: Start(whole.values) for key in keys.values() if key}
        self.fit_against(whole, starts, to_end=True)
        refused = [key for key in starts if key not in self.fits and key not in self.reduced]
        jobs = {
            key: self._begin(key, starts[key], MAX_ITERATIONS, credible=False) for key in refused
        }
        for key, job in jobs.items():
            with suppress(*FAULTS):
                self.reduced[key] = job.result()
        return {name: self.fits.get(key, self.reduced.get(key)) for name, key in keys.items()}

    def fit_against(
        self, whole: FittedModel, models: Mapping[Names, Start], to_end: bool = False
    ) -> None:
        """Fit models that are compared with another one, what it estimates estimated in them too.

        `refine` has released parameters of its effects. Models known from before hold them: they
        are fitted again from its values, and the better fit is kept. So are those that were cut
        short, with `to_end`.
        """
        known = {key: self.fits[key] for key in models if key in self.fits}
        again = [
            key
            for key, fitted in known.items()
            if _holds(whole, fitted) or (to_end and fitted.pace)
        ]
        self.fit_all(models, to_end)
        most = MAX_ITERATIONS if to_end else SEARCH_ITERATIONS
        jobs = {key: self._begin(key, models[key], most) for key in again}
        for key, job in jobs.items():
            with suppress(*FAULTS):
                fitted = job.result()
                self._require_credible(key, fitted)
                self.fits[key] = min(self.fits[key], fitted, key=lambda fit: fit.cost)

    def extensions(self, known: Names) -> dict[Names, FittedModel]:
        """Return the fits of models with one effect more than the known ones."""
        return {
            key: fitted
            for key, fitted in self.fits.items()
            if len(key) == len(known) + 1 and set(known) < set(key)
        }

    def take(self, names: Names) -> None:
        """Choose a model as refined by output error."""
        self.output_error_fits[names], self.gap_left[names] = self.trials[names]

    def leave_out(self, name: str) -> None:
        """Take an effect out of what is offered, and its fits alone out of what is known."""
        self.left_out.add(name)
        self.fits.pop((name,), None)
        self.trials.pop((name,), None)
        self.failures.pop((name,), None)

    def refine(self, names: Names) -> None:
        """Let the fit of a model go on to its minimum, in all its effects' parameters; once."""
        if names not in self._refined:
            self._refined.add(names)
            self.fits[names] = refine_model(self.study, self.fits[names], self.effects(names))


def _holds(whole: FittedModel, other: FittedModel) -> bool:
    """Return whether a model holds a parameter of an effect that another one estimates.

    Compared with it, whatever the other one has besides would seem to gain what this does.
    """
    held = [name for name in other.values if "." in name and name not in other.std]
    return any(name in whole.std and whole.values[name] != other.values[name] for name in held)
