"""Which effects, and how many: forward from the nominal model, with second thoughts."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import (
    COARSE_MAP,
    NEAR_NULL,
    Yardstick,
    gaps,
    size,
    yardstick,
)
from pneumo_casadi.diagnosis.metrics.simulated_gap import Simulations
from pneumo_casadi.diagnosis.prepare.fit_store import Store
from pneumo_casadi.diagnosis.prepare.study import Fitted, Study, fit
from pneumo_casadi.diagnosis.screen.screen import Screened, background
from pneumo_casadi.diagnosis.select.acceptance import accepted
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, Failed, Names, Searcher, Start
from pneumo_casadi.diagnosis.select.plausibility import mended
from pneumo_casadi.diagnosis.select.sensor_effects import beside_sensors, sensed, settled
from pneumo_casadi.estimation.equation_error.balance_functions import remembers
from pneumo_casadi.runtime.progress import Progress, no_progress

#: So many effects together at most.
MOST = 3
#: Effects refitted in later rounds, in the order of the screen. In the first it is all of them: a
#: line from the nominal fit does not lead to a large effect whose share of it points elsewhere.
LATER_ROUNDS = 5
#: So many effects besides that were accepted alone, whatever the screen thinks of them later, and
#: so many that are tried in pairs: of two causes the first choice may stand for both.
ALONE, PAIRED = 3, 5
#: A shape of the valve that the metered map contradicts is tried beside so many others: it may be
#: right once it need not stand for them.
CONTRADICTED = 4


@dataclass(frozen=True, eq=False)
class Search:
    """All that was fitted, and the path taken.

    Parameters
    ----------
    nominal : Fitted
        Without effects.
    fits : mapping of tuple of str to Fitted
        Every model with effects, by their sorted names.
    failures : tuple of Failed
        Fits that did not come about.
    screen : mapping of str to Screened
        What the screen said over the nominal model.
    path : tuple of tuple of str
        Models accepted one after another, the last one final; empty if none was.
    by : Yardstick
        Noise and signal of the held-out records.
    polished : mapping of tuple of str to Fitted
        Models that were taken as output error has refined them; see `beside_sensors`.
    settled : mapping of tuple of str to float
        Share of the simulated gap left by those, and by the final model.
    trials : mapping of tuple of str to float
        Share of the simulated gap left by every model that output error has refined.
    simulations : Simulations
        Of the held-out records, those already done.
    """

    nominal: Fitted
    fits: Mapping[Names, Fitted]
    failures: tuple[Failed, ...]
    screen: Mapping[str, Screened]
    path: tuple[Names, ...]
    by: Yardstick
    polished: Mapping[Names, Fitted]
    settled: Mapping[Names, float]
    trials: Mapping[Names, float]
    simulations: Simulations

    @property
    def chosen(self) -> Names:
        """Effects of the final model."""
        return self.path[-1] if self.path else ()

    @property
    def final(self) -> Fitted:
        """The final model."""
        if not self.path:
            return self.nominal
        return self.polished.get(self.chosen, self.fits[self.chosen])


def search(
    one: Study,
    catalogue: Catalogue,
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep: Path | None = None,
) -> Search:
    """Find the effects that close the held-out gap of a study.

    Parameters
    ----------
    keep : path, optional
        Folder of finished fits, see `Store`.
    """
    report = progress or no_progress
    store = None if keep is None else Store.of(keep, one)
    worker = Searcher(one, catalogue, executor, store)
    report("nominal model", 0.0)
    nominal = fit(one, ())
    by = yardstick(one)
    report("screening the catalogue", 0.1)
    worker.screen_all(nominal)
    first = worker.over(background(one, nominal, nominal))
    report("refitting single effects", 0.3)
    _fit_beside(worker, (), nominal, first, list(first))
    path = _forward(worker, nominal, by, report)
    failures = tuple(worker.failures.values())
    return Search(
        nominal,
        {k: fitted for k, (fitted, left) in worker.trials.items() if left < np.inf} | worker.fits,
        failures,
        first,
        path,
        by,
        worker.polished,
        worker.settled,
        {key: share for key, (_, share) in worker.trials.items()},
        worker.simulations,
    )


def _forward(
    worker: Searcher, nominal: Fitted, by: Yardstick, report: Progress
) -> tuple[Names, ...]:
    path: list[Names] = []
    current = nominal
    for round_ in range(MOST):
        known: Names = path[-1] if path else ()
        if round_:
            report(f"looking for effect {round_ + 1}", 0.4 + 0.15 * round_)
            _extend(worker, nominal, current, known)
        if round_ == 1:
            _pair_up(worker)
        options = [
            (fitted.cost, key)
            for key, fitted in worker.fits.items()
            if len(key) == round_ + 1
            and (round_ < 2 or len(set(key) & set(known)) >= round_)
            and accepted(nominal, current, fitted, by)
            and not _coarse(worker, current, known, key, by)
        ]
        if not round_:
            worker.alone = tuple(key[0] for _, key in sorted(options))
        mending = None if options else mended(worker, current, known)
        if not options and mending is None:
            more = sensed(worker, nominal, current, known, by)
            path += [] if more is None else [more]
            break
        best = mending or min(options)[1]
        if round_ == 1 and mending is None:
            best = _second_thoughts(worker, nominal, best, by, current)
        path.append(best)
        worker.refine(best)
        if settled(worker, nominal, best) or not np.any(gaps(size(worker.fits[best]), by)):
            break
        if round_ and remembers(worker.effects(best)):
            break  # what the balances say while a sensor hides the motion goes no further
        current = worker.fits[best]
    report("comparing simulations", 0.85)
    taken = beside_sensors(worker, nominal, tuple(path), MOST)
    if taken and taken[-1] not in worker.settled:
        final, effects = worker.fits[taken[-1]], worker.effects(taken[-1])
        worker.settled[taken[-1]] = worker.simulations.share(nominal, final, effects)
    return taken


def _coarse(worker: Searcher, current: Fitted, known: Names, names: Names, by: Yardstick) -> bool:
    """Tell whether what is added only draws anew a metered map whose rest is no more than coarse.

    Beside an effect in another balance the rest of the map may be all that is left to be gained:
    there it must be more than any coarse map leaves.
    """
    limit = NEAR_NULL if known else COARSE_MAP
    coarse = bool(np.all((size(current) < limit * by.noise)[:-1]))  # the force has no map
    added = [name for name in names if name not in known]
    return coarse and all(effect.metered for effect in worker.effects(added))


def _extend(worker: Searcher, nominal: Fitted, current: Fitted, known: Names) -> None:
    """Fit the most promising additions to a model."""
    behind = background(worker.study, nominal, current, worker.effects(known))
    screened = worker.over(behind, known)
    tried = list(screened)[:LATER_ROUNDS]
    alone = [name for name in worker.alone if name in screened and name not in tried][:ALONE]
    _fit_beside(worker, known, current, screened, (*tried, *alone))


def _fit_beside(
    worker: Searcher,
    known: Names,
    current: Fitted,
    screened: Mapping[str, Screened],
    names: Sequence[str],
) -> None:
    """Fit a model with each of some effects more, and each that is not felt where it is small."""
    unfelt = [name for name, one in screened.items() if not one.felt]
    worker.fit_all(
        {
            worker.key((*known, name)): (
                current.values,
                screened[name].starts,
                None if screened[name].felt else current.cost,
            )
            for name in dict.fromkeys((*names, *unfelt))
        }
    )


def _pair_up(worker: Searcher) -> None:
    """Fit the best effects in pairs, each beginning where it ended alone.

    A third effect may stand for two, and no pair with it is right; and where two that it stood for
    have another form than the usual, only that form shows it.
    """
    starts: dict[Names, Start] = {}
    for one, other in combinations(worker.alone[:PAIRED], 2):
        better, added = (worker.fits[name,] for name in (one, other))
        own = {n: v for n, v in added.values.items() if n.startswith(f"{other}.")}
        starts[worker.key((one, other))] = {**better.values, **own}, (), None
    worker.fit_all(starts | _contradicted(worker))
    pairs = [key for key in worker.fits if len(key) == 2]
    if pairs:
        worker.refine(min(pairs, key=lambda key: worker.fits[key].cost))


def _contradicted(worker: Searcher) -> dict[Names, Start]:
    """Return starts of shapes of the valve beside the effects that fit best alone."""
    refused = [k[0] for k in worker.failures if len(k) == 1 and worker.effects(k)[0].metered]
    alone = sorted((f.cost, key) for key, f in worker.fits.items() if len(key) == 1)
    return {
        worker.key((name, other)): (worker.fits[other,].values, (), None)
        for name in refused
        for _, (other,) in alone[:CONTRADICTED]
    }


def _second_thoughts(
    worker: Searcher, nominal: Fitted, pair: Names, by: Yardstick, single: Fitted
) -> Names:
    """Let each partner of a pair look for a better one: the first choice stood for two."""
    for name in pair:
        alone = worker.fits.get((name,))
        if alone is not None and alone is not single:
            _extend(worker, nominal, alone, (name,))
    options = [
        (fitted.cost, key)
        for key, fitted in worker.fits.items()
        if len(key) == 2 and accepted(nominal, single, fitted, by)
    ]
    return min(options)[1]
