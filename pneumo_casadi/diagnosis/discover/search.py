"""The search: all sites by a smooth curve and by a sine, the best of them by every formula."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.diagnosis.discover.curves import fit_curve
from pneumo_casadi.diagnosis.discover.formula_fits import FormulaFit, fit_formula
from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised
from pneumo_casadi.diagnosis.discover.linear.rows import Basis
from pneumo_casadi.diagnosis.discover.linear.sensor_errors import SENSORS
from pneumo_casadi.diagnosis.discover.linear.sites import Site, all_sites
from pneumo_casadi.diagnosis.discover.periods import best_periods
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.effects.term.formula import FORMULAS
from pneumo_casadi.metrics import gap
from pneumo_casadi.parameters import FloatArray

#: Sites on which all formulas are tried: those of the best curves.
SITES = 5
#: What a formula may close more than a curve at its site: a step or a kink is sharper than splines.
SHARPER = 0.15
#: Largest error of a sensor, standard deviation over that of what it shows: larger ones show in any
#: calibration.
LARGEST_SENSOR_ERROR = 0.05
#: Drivers over which a term may repeat: the position (teeth, turns of a screw) and time. A leak
#: that repeats has a mean besides, which no parameter of the model takes up.
REPEATS = ("x", "t")
#: Errors of sensors repeat over the position (scale marks), not over time.
NEVER_REPEAT = tuple(("t", sensor) for sensor in SENSORS)


#: Formulas over time that no form of the catalogue can be: what drifts. A bump at one moment is an
#: accident.
DRIFTS = ("line", "line with level", "exponential", "exponential with level")


@dataclass(frozen=True, eq=False)
class Scored:
    """A formula with the share of the held-out gap that it closes.

    Parameters
    ----------
    fit : FormulaFit
        The formula at its site.
    closure : float
        Of the held-out gap of all balances [1].
    """

    fit: FormulaFit
    closure: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        formula = self.fit.formula
        return len(formula.parameters) - len(formula.held)


def search(linear: Linearised, levels: BalanceLevels, foreign: bool = False) -> tuple[Scored, ...]:
    """Return the formulas tried, the one to take first.

    Parameters
    ----------
    linear : Linearised
        The fit whose residuals are to be explained.
    levels : BalanceLevels
        Noise of the held-out records.
    foreign : bool, optional
        Whether only terms are looked for that no form of the catalogue can be: those that repeat
        (a level besides would be a leak), and drifts of the force.
    """
    kind = linear.train.signals[0].axis.kind
    high = levels.exceeded(linear.held_out.rms, levels.criteria.clean)
    visible = {name for name, is_high in zip(linear.train.equations, high, strict=True) if is_high}
    sites = [
        site
        for site in all_sites(kind)
        if all(rows.driver(site) is not None for rows in (linear.train, linear.held_out))
        and (visible & set(site.balances) or site.balances[0] in SENSORS)
    ]
    score = GapScore(linear, levels)
    # A vibration has a phase of its own in each record: it is looked for in one.
    alone = linear.in_longest_record
    looked_for = {"t": (alone, GapScore(alone, levels)), "x": (linear, score)}
    leaks = ("sine",) if foreign else ("sine", "sine with level")
    scored: list[Scored | None] = []
    for driver in REPEATS:
        repeating = [
            site
            for site in sites
            if site.driver == driver and (driver, site.balances[0]) not in NEVER_REPEAT
        ]
        part, score_of = looked_for[driver]
        for site, period in best_periods(part, repeating).items():
            for name in leaks if site.factor == "p" else ("sine",):
                scored.append(_scored(part, score_of, site, name, period))
    names = [name for name, formula in FORMULAS.items() if not formula.periodic]
    if foreign:
        sites = [site for site in sites if site.driver == "t" and site.balances == ("force",)]
        names = [name for name in names if name in DRIFTS]
    least = 1 - levels.criteria.unexplained if foreign else levels.criteria.share
    near = max([least, *(x.closure for x in scored if x)])
    scored += _search_curves(linear, score, sites, names, near)
    return in_order([item for item in scored if item is not None], levels.criteria.matters)


def _search_curves(
    linear: Linearised,
    score: "GapScore",
    sites: Sequence[Site],
    names: Sequence[str],
    near: float,
) -> list[Scored | None]:
    """Return formulas at the sites whose smooth curves close most, and come near a closure."""
    curves = [(fit_curve(linear, site), site) for site in sites]
    closures = {
        site: score(site, curve.basis, curve.coefficients)
        for curve, site in curves
        if curve is not None
        and is_small(linear, site, curve)
        and linear.keeps_mass(site, curve.basis, curve.coefficients)
    }
    most = max([*closures.values(), near])
    ranked = sorted(closures, key=lambda site: -closures[site])
    return [
        _scored(linear, score, site, name)
        for site in ranked[:SITES]
        if closures[site] > most - SHARPER
        for name in names
    ]


def _scored(
    linear: Linearised, score: "GapScore", site: Site, name: str, period: float | None = None
) -> Scored | None:
    fit = fit_formula(linear, site, FORMULAS[name], period)
    if fit is None or not is_small(linear, site, lambda d: fit.basis(d) @ fit.coefficients):
        return None
    if not linear.keeps_mass(site, fit.basis, fit.coefficients):
        return None
    return Scored(fit, score.of(fit))


def is_small(linear: Linearised, site: Site, f: Callable[[FloatArray], FloatArray]) -> bool:
    """Return whether a function is small enough where its site is a sensor's error.

    There it acts by a linearisation; a sensor that shows nothing of the motion would explain all.
    """
    if site.balances[0] not in SENSORS:
        return True
    d = linear.train.driver(site)
    assert d is not None  # sites without a driver are left out before
    shown = np.concatenate(
        [signals.sensor(name) for name in site.balances for signals in linear.train.signals]
    )
    return bool(np.std(f(d)) < LARGEST_SENSOR_ERROR * np.std(shown))


def in_order(scored: Sequence[Scored], matters: float) -> tuple[Scored, ...]:
    """Return formulas, the simplest of those that close as much as the best first.

    Parameters
    ----------
    matters : float
        Least difference of two closures that matters.
    """
    most = max((item.closure for item in scored), default=0.0)
    return tuple(
        sorted(
            scored,
            key=lambda item: (
                (0, item.size, -item.closure)
                if item.closure >= most - matters
                else (1, 0, -item.closure)
            ),
        )
    )


@dataclass(frozen=True, eq=False)
class GapScore:
    """The share of the held-out gap that a term closes, parameters refitted and frozen."""

    linear: Linearised
    levels: BalanceLevels

    def __call__(self, site: Site, basis: Basis, c: FloatArray) -> float:
        """Return the closure by a function of a site's driver."""
        return self._closure(self.linear.predicted(site, basis, c)[1])

    def of(self, fit: FormulaFit) -> float:
        """Return the closure by a formula, the phase of a vibration as each held-out one has it."""
        return self._closure(predicted_by(self.linear, fit)[1])

    def _closure(self, e: FloatArray) -> float:
        before, after = (self._gap(part) for part in (self.linear.held_out.e, e))
        return 1 - after / before if before > 0 else 0.0

    def _gap(self, e: FloatArray) -> float:
        """Return the gap of all balances, weighted as in `balance_closure`."""
        rows, noise, signal = self.linear.held_out, self.levels.noise, self.levels.signal
        left = gap(rows.rms_of(e) ** 2, noise)
        importance = gap(rows.rms**2, noise, signal) ** 2 / signal**2
        return float(np.sqrt(importance @ left**2))


def predicted_by(
    linear: Linearised, fit: FormulaFit, refitted: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of both sets of records with a formula.

    With `refitted`, the parameters are refitted to it on the records fitted. In each of those held
    out a vibration has its amplitude, and the phase that suits this record.
    """
    train, held_out = linear.predicted(fit.site, fit.basis, fit.coefficients, refitted)
    if not fit.phase_free:
        return train, held_out
    rows = linear.held_out
    D = rows.columns(fit.site, fit.basis)
    rest = held_out - D @ fit.coefficients
    ends = np.cumsum([int(used.sum()) for used in rows.used])[:-1]
    pairs = zip(np.split(D, ends), np.split(rest, ends), strict=True)
    return train, np.concatenate([_turned(*pair, fit.coefficients) for pair in pairs])


def _turned(D: FloatArray, rest: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Return the residuals of one record (r,) with a sine (r, k), the phase as it suits it."""
    c, *_ = np.linalg.lstsq(D[:, :2], -rest, rcond=None)
    amplitude = np.hypot(*coefficients[:2])
    turned = np.concatenate([c * amplitude / max(np.hypot(*c), 1e-300), coefficients[2:]])
    return np.asarray(rest + D @ turned)
