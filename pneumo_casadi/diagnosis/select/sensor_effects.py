"""Effects of sensors and beside them, which only simulations show to be better.

The smoothed motion knows nothing of a play that is being crossed: the best fit of the records
fitted may be no better on those held out until it is refined by output error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneumo_casadi.diagnosis.metrics.residual_size import Yardstick, size
from pneumo_casadi.diagnosis.metrics.simulated_gap import Simulations
from pneumo_casadi.diagnosis.prepare.study import FORM, Fitted, Study, refuse_unbelievable
from pneumo_casadi.diagnosis.select.fit_ledger import FAULTS, Failed, Names, Searcher
from pneumo_casadi.diagnosis.select.output_error_refinement import polished
from pneumo_casadi.estimation.equation_error.balance_functions import remembers, senses
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray

#: A model that leaves less than this share of the simulated gap needs no further effect.
SETTLED = 0.35
#: An effect of a sensor is worth a simulation where the held-out residuals of some balance are so
#: many times the noise, and accepted where it leaves less than this share of what was left.
SENSED, CLOSED = 1.3, 0.7
#: Beside a sensor an effect must close the first share of the simulated gap, which at least must be
#: left; a third effect is sought where two leave more than the second.
LEAST, UNEXPLAINED = 0.05, 0.5
#: So many of the best pairs, and of the best effects alone, are tried beside a sensor.
TRIED = 3


def sensed(
    worker: Searcher, nominal: Fitted, current: Fitted, known: Names, by: Yardstick
) -> Names | None:
    """Return a model with one more effect, of a sensor, that only simulations show to be better.

    Parameters
    ----------
    current : Fitted
        The best model so far, with the effects `known`.
    """
    fits = worker.extensions(known)
    best = min(fits, key=lambda key: fits[key].cost, default=None)
    if best is None or np.all(size(current) < SENSED * by.noise):
        return None
    effects, before = worker.effects(best), worker.effects(known)
    if fits[best].cost > current.cost - FORM or not remembers(effects) or senses(before):
        return None
    _try_all(worker, nominal, {best: fits[best]})
    if worker.trials[best][1] > CLOSED * worker.simulations.share(nominal, current, before):
        return None
    worker.take(best)
    return best


def settled(worker: Searcher, nominal: Fitted, names: Names) -> bool:
    """Tell whether a model with a sensor that remembers closes the gap once it is simulated."""
    if not remembers(worker.effects(names)):
        return False
    _try_all(worker, nominal, {names: worker.fits[names]})
    if worker.trials[names][1] < SETTLED:
        worker.take(names)
        return True
    return False


def beside_sensors(
    worker: Searcher, nominal: Fitted, path: tuple[Names, ...], most: int
) -> tuple[Names, ...]:
    """Go on by simulations where a sensor that remembers was found, and return the path taken.

    Where what the balances say of further effects does not settle in simulations, what grows from
    the sensor alone is tried, and taken if it leaves no more.
    """
    if not path or not remembers(worker.effects(path[-1])):
        return path
    _try_all(worker, nominal, {path[-1]: worker.fits[path[-1]]})
    first = path[-1]
    if worker.trials[first][1] >= SETTLED:
        alone = worker.key(n for n in first if remembers(worker.effects((n,))))
        first = alone if alone in worker.fits else first
    grown = [first]
    while len(grown[-1]) < most:
        more = _grown(worker, nominal, grown[-1])
        if more is None:
            break
        grown.append(more)
    if len(grown) == 1 or worker.trials[grown[-1]][1] > worker.trials[path[-1]][1]:
        return path
    worker.take(grown[-1])
    return (*(names for names in path if set(names) < set(first)), *grown)


def _grown(worker: Searcher, nominal: Fitted, known: Names) -> Names | None:
    """Return a model with one more effect that simulations show to be better, or None."""
    _try_all(worker, nominal, {known: worker.fits[known]})
    base, share = worker.trials[known]
    if share < (LEAST if len(known) == 1 else UNEXPLAINED):
        return None
    keys = {name: worker.key((*known, name)) for name in _candidates(worker, known)}
    starts = {
        key: _beside(worker, base, known, name)
        for name, key in keys.items()
        if key not in worker.failures  # refused with a reason
    }
    _try_all(worker, nominal, starts)
    shares = {key: worker.trials[key][1] for key in starts}
    best = min(shares, key=lambda key: shares[key], default=None)
    if best is None or shares[best] > min(CLOSED * share, share - LEAST, 1.0):
        return None
    _try_again(worker, nominal, best)
    worker.fits.setdefault(best, worker.trials[best][0])
    return best


def _candidates(worker: Searcher, known: Names) -> Sequence[str]:
    """Name what may act beside sensors: what fits say, and what these sensors are confused with.

    A fit along the smoothed motion may drive to nothing what acts in the motion that they hide.
    """

    def best(fits: dict[Names, Fitted]) -> list[Names]:
        return sorted(fits, key=lambda key: fits[key].cost)[:TRIED]

    alone = {key: f for key, f in worker.extensions(()).items() if not set(key) & set(known)}
    names = {name for key in (*best(worker.extensions(known)), *best(alone)) for name in key}
    for one in worker.effects(known):
        if remembers((one,)):
            names |= {n for n in one.confused_with if n in worker.catalogue}
    made = {name: worker.catalogue[name]() for name in worker.key(names - set(known))}
    # A refinement holds the flow map, and with it what is metered of a valve. A second sensor that
    # hides the motion is tried only where it gains in fits too: the first may stand for it.
    return [
        name
        for name, effect in made.items()
        if not effect.metered and (_gains(worker, known, name) or not remembers((effect,)))
    ]


def _gains(worker: Searcher, known: Names, name: str) -> bool:
    """Tell whether an effect more was fitted beside the known ones, and gained something."""
    fitted = worker.fits.get(worker.key((*known, name)))
    return fitted is not None and fitted.cost < worker.fits[known].cost - FORM


def _beside(worker: Searcher, base: Fitted, known: Names, name: str) -> Fitted:
    """Return a fit with an effect more: as fitted where that gained something, or at its start."""
    key = worker.key((*known, name))
    axis = worker.study.axis.with_effects(*worker.effects(key)).at_starting_values()
    values = axis.with_parameters(dict(base.values)).parameters.as_dict()
    if _gains(worker, known, name):
        fitted = worker.fits[key].values
        values |= {n: v for n, v in fitted.items() if n.startswith(f"{name}.")}
    return replace(base, effects=key, values=values)


def _try_all(worker: Searcher, nominal: Fitted, starts: Mapping[Names, Fitted]) -> None:
    """Refine models by output error and simulate them, those that were not tried already."""
    jobs = {
        key: worker.run(_tried, start, worker.effects(key))
        for key, start in starts.items()
        if key not in worker.trials
    }
    for key, job in jobs.items():
        try:
            better, windows = job.result()
        except FAULTS as error:
            worker.trials[key] = starts[key], np.inf
            if key not in worker.fits:
                worker.failures[key] = Failed(key, f"refined by output error: {error}")
            continue
        worker.simulations.keep(better, windows)
        share = worker.simulations.share(nominal, better, worker.effects(key))
        worker.trials[key] = better, share


def _try_again(worker: Searcher, nominal: Fitted, names: Names) -> None:
    """Let a fit that may have been cut short go on from where it ended, if that leaves less."""
    before = worker.trials.pop(names)
    _try_all(worker, nominal, {names: before[0]})
    worker.trials[names] = min(before, worker.trials[names], key=lambda one: one[1])
    worker.failures.pop(names, None)  # where only the second refinement failed


def _tried(one: Study, start: Fitted, effects: Sequence[Effect]) -> tuple[Fitted, FloatArray | str]:
    better = polished(one, start, effects)
    refuse_unbelievable(one, effects, better)
    return better, Simulations(one).windows(better, effects)
