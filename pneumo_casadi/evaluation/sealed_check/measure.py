"""What the labels allow to measure: whether a cause shows, an oracle, and simple rivals.

All of it is done with the machinery of the diagnosis, fits of the balances along the smoothed
motion that begin where its screen says, on the case and on its *twin*: the same axis, references,
noise and background without the causes.

- A cause is *visible* where the residual of the nominal axis on the held-out record exceeds that
  of the twin `VISIBLE` times in some balance.
- A clean pair is measured without each of its causes too: whether either shows beside the other.
- Which effect among weak ones has the largest gap is measured where there is one cause, see
  `largest`.
- The gap is that of all balances of the held-out record, in units of the residuals of the twin,
  which are its noise floor (`pneumo_casadi.metrics`). The oracle's closure is that of the axis with
  the true effects; it is compared with that of the axis with the effects named. Neither uses
  figures that the diagnosis states.
- Rivals see the training record alone: the ranking of single effects by training error, and forward
  selection by AIC. The cost of a fit is a concentrated negative log-likelihood L, AIC/2 = L + n.
  After its first step the selection goes on among the `BEAM` best only.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.data import read_case
from pneumo_casadi.diagnosis import applicable, prepare_study
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.screen.background import background
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Start
from pneumo_casadi.diagnosis.select.forms import cause_of, causes_of
from pneumo_casadi.effects import without_causes
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.evaluation.sealed_check.draw import Draw, Kind
from pneumo_casadi.evaluation.sealed_check.largest import gaps_without, nominal_rms
from pneumo_casadi.metrics import closure, combined_gap, gap
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.runtime.interruption import is_ending
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.threads import one_thread

#: A cause shows where it more than doubles the energy of a residual (1.5² = 2.25): what is missing
#: then outweighs all that noise, filters and the model's form leave.
VISIBLE = 1.5
#: Effects that forward selection adds at most: as many as a case has; and those that it tries after
#: its first step, since every new pair is a model to compile.
MOST, BEAM = 2, 4


@one_thread
def measure_one(
    folder: Path, case: Path, draw: Draw, named: Collection[str], duration: float, fs: float
) -> None:
    """Measure one case and write the figures to ``folder/NAME.json``."""

    def figures() -> dict[str, Any]:
        with draft_folder() as scratch:
            floor = nominal_rms(replace(draw, effects={}), scratch / "twin", duration, fs)
        content = measured(prepare_study(read_case(case))[0], floor, draw, named)
        if draw.background and len(draw.effects) == 1 and draw.kind is not Kind.ABSORBED:
            content["gap_without"] = gaps_without(draw, floor, duration, fs)
        if draw.kind is Kind.PAIR and not draw.background:
            content["shows_beside"] = shows_beside(draw, content["rms"], duration, fs)
        return content

    _write(figures, folder, draw)


@one_thread
def rivals_of_one(folder: Path, case: Path, draw: Draw) -> None:
    """Write what simple rivals make of one case to ``folder/NAME.json``."""
    _write(lambda: rivals(Models.of(prepare_study(read_case(case))[0], draw.without)), folder, draw)


def _write(figures: Callable[[], dict[str, Any]], folder: Path, draw: Draw) -> None:
    try:
        content = figures()
    except (PneumoError, np.linalg.LinAlgError) as error:
        if is_ending():
            raise
        content = {"failure": f"{type(error).__name__}: {error}"}
    write_json(content, folder / f"{draw.name}.json")


def measured(study: Study, floor: FloatArray, draw: Draw, named: Collection[str]) -> dict[str, Any]:
    """Return the figures of one case.

    Parameters
    ----------
    study : Study
        The case.
    floor : (ne,) array
        Held-out residuals of the twin, root mean square.
    draw : Draw
        Its label.
    named : collection of str
        Effects that the verdict stands for.
    """
    models = Models.of(study, draw.without)
    before = residual_rms(models.nominal)

    def shrink(names: Iterable[str]) -> float | None:
        after = models.fitted(names)
        return None if after is None else closure_above_twin(before, residual_rms(after), floor)

    knows = bool(draw.effects) and draw.listed
    return {
        "rms": dict(zip(study.axis.equations, before.tolist(), strict=True)),
        "twin_rms": dict(zip(study.axis.equations, floor.tolist(), strict=True)),
        "visible": shows(before, floor),
        "oracle_shrink": shrink(draw.effects) if knows else None,
        "named_shrink": shrink(named) if knows else None,
    }


def shows(rms: FloatArray, floor: FloatArray) -> bool:
    """Return whether residuals exceed those without a cause `VISIBLE` times in some balance.

    Examples
    --------
    >>> shows(np.array([1.0, 1.6]), np.array([1.0, 1.0]))
    True
    """
    return bool(np.any(rms > VISIBLE * floor))


def shows_beside(
    draw: Draw, rms: Mapping[str, float], duration: float, fs: float
) -> dict[str, bool]:
    """Return which causes are visible beside the other ones, by what is left without them."""
    before, shown = np.array(list(rms.values())), {}
    for cause in draw.effects:
        others = {name: size for name, size in draw.effects.items() if name != cause}
        with draft_folder() as scratch:
            floor = nominal_rms(replace(draw, effects=others), scratch / cause, duration, fs)
        shown[cause] = shows(before, floor)
    return shown


def closure_above_twin(before: FloatArray, after: FloatArray, floor: FloatArray) -> float:
    """Return the closure of the gap of all balances, the residuals of the twin being the noise.

    Examples
    --------
    >>> floor = np.array([1.0, 1.0])
    >>> closure_above_twin(np.array([3.0, 1.0]), np.array([1.0, 0.9]), floor)
    1.0
    """
    return closure(*(combined_gap(gap((rms / floor) ** 2, 1.0)) for rms in (before, after)))


@dataclass(frozen=True, eq=False)
class Models:
    """All models of a case that were asked for.

    Parameters
    ----------
    ledger : FitLedger
        Fits them.
    nominal : FittedModel
        Without effects.
    screen : mapping of str to ScreenResult
        Where the fits of single effects begin.
    """

    ledger: FitLedger
    nominal: FittedModel
    screen: Mapping[str, ScreenResult]

    @staticmethod
    def of(study: Study, without: Collection[str] = ()) -> "Models":
        """Fit the nominal model and screen a catalogue that lacks some effects."""
        catalogue = applicable(study, without_causes(without))
        ledger, nominal = FitLedger(study, catalogue), fit_model(study, ())
        ledger.screen_all(nominal)
        return Models(ledger, nominal, ledger.over(background(study, nominal, nominal)))

    def fitted(self, names: Iterable[str]) -> FittedModel | None:
        """Return the fit with some causes, each in its best form; None where there is none.

        Several effects begin at the best single one of them, the others as screened.
        """
        return self._fitted(self.ledger.key(self._form(name) for name in names))

    @property
    def causes(self) -> tuple[str, ...]:
        """All causes of the catalogue."""
        return causes_of(self.ledger.catalogue, self.ledger.catalogue)

    def _form(self, cause: str) -> str:
        """Return the form of a cause that fits best alone."""
        known = self.ledger.catalogue
        fits = {n: self._fitted((n,)) for n in known if cause_of(n, known) == cause}
        costs = {name: fitted.cost for name, fitted in fits.items() if fitted is not None}
        return min(costs, key=lambda name: costs[name], default=cause)

    def _fitted(self, key: tuple[str, ...]) -> FittedModel | None:
        if not key:
            return self.nominal
        if key not in self.ledger.fits and key not in self.ledger.failures:
            origin = self.nominal
            if len(key) > 1:
                alone = [fit for fit in (self._fitted((name,)) for name in key) if fit is not None]
                origin = min(alone, key=lambda fit: fit.cost, default=origin)
            screened = [self.screen[name].starts for name in key if name in self.screen]
            if len(key) == 1:
                shapes = screened[0] if screened else ()
                self.ledger.fit_all({key: Start(origin.values, shapes, origin.cost)})
            else:
                begin = {k: v for starts in screened for k, v in starts[0].items()}
                self.ledger.fit_all({key: Start({**begin, **origin.values}, (), origin.cost)})
        return self.ledger.fits.get(key)


def rivals(models: Models) -> dict[str, Any]:
    """Return what ranking by training error, and forward selection by AIC, make of a case."""

    def criterion(names: tuple[str, ...]) -> float:
        fitted = models.fitted(names)
        return np.inf if fitted is None else fitted.cost + len(fitted.std)

    single = {name: criterion((name,)) for name in models.causes}
    alone = {name: models.fitted((name,)) for name in models.causes}
    costs = {name: fit.cost for name, fit in alone.items() if fit is not None}
    return {
        "by_error": sorted(costs, key=lambda name: costs[name]),
        "by_aic": forward(single, criterion(()), criterion),
    }


def forward(
    single: Mapping[str, float], without: float, cost: Callable[[tuple[str, ...]], float]
) -> list[str]:
    """Add effects while a criterion falls, each time the best.

    Parameters
    ----------
    single : mapping of str to float
        Criterion of each effect alone.
    without : float
        Criterion without effects.
    cost : callable
        Criterion of several.

    Examples
    --------
    >>> forward({"a": 5.0, "b": 4.0, "c": 9.0}, 8.0, lambda names: 3.0 if "a" in names else 6.0)
    ['b', 'a']
    """
    chosen: list[str] = []
    best, beam = without, sorted(single, key=lambda name: single[name])[:BEAM]
    while len(chosen) < MOST:
        rest = [name for name in beam if name not in chosen]
        costs = {n: single[n] if not chosen else cost((*chosen, n)) for n in rest}
        name = min(costs, key=lambda key: costs[key], default=None)
        if name is None or not costs[name] < best:
            break
        chosen.append(name)
        best = costs[name]
    return chosen
