"""Completion of the final model, stepwise: weak effects join it, needless ones are eliminated.

Forward selection stops at the effects that are large enough to be named. Weak ones besides are
still in the records; without them in the model another effect takes up what they do, one that is
not there: a shifted null stands for two leaks while the lag of a sensor is missing. So the model is
completed by whatever the likelihood asks for, and each of its effects is then eliminated or
exchanged where the others no longer need it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select.acceptance import accepted, only_corrects_map, surely_gains
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.neighbours import PROMISED, TRIED, Neighbours, gained

#: Largest number of effects in the final model: one or two large ones, and six weak ones.
MAX_ACTING = 8
#: Rounds of adding and reviewing.
ROUNDS = 3


def always(names: Names) -> bool:
    """Tell that a model is of use, whatever its effects."""
    return True


@dataclass(frozen=True)
class Completed:
    """A completed model.

    Parameters
    ----------
    acting : tuple of str
        All its effects.
    named : tuple of str
        Those large enough to be named.
    idle : tuple of str
        Those of no size, without which another one would not be credible, and those for which
        held-out data do not ask. Nothing is said of them.
    """

    acting: Names
    named: Names
    idle: Names = ()


def complete(
    ledger: FitLedger,
    nominal: FittedModel,
    final: Names,
    levels: BalanceLevels,
    useful: Callable[[Names], bool] = always,
) -> Completed:
    """Return the final model completed, with the effects that matter in it.

    Parameters
    ----------
    final : tuple of str
        Effects that the selection has found.
    useful : callable, optional
        As of `find_acting`. Of a model that is of no use no effect is named.
    """
    acting = find_acting(ledger, nominal, final, levels, useful)
    if not useful(acting):
        return Completed(acting, ())
    work = _Completion(ledger, nominal, levels, final)
    named = work.select_named(acting)
    return Completed(acting, named, work.select_idle(acting, named))


def find_acting(
    ledger: FitLedger,
    nominal: FittedModel,
    final: Names,
    levels: BalanceLevels,
    useful: Callable[[Names], bool] = always,
) -> Names:
    """Return the effects, large and weak, of the model completed, which the ledger refines.

    Parameters
    ----------
    useful : callable, optional
        Tells of a model whether it may still become one that is asked for. The search ends where it
        does not; that model is returned as it is.
    """
    work = _Completion(ledger, nominal, levels, final, useful)
    acting = work.review(work.grow(final))
    for _ in range(ROUNDS - 1):
        grown = work.grow(acting) if useful(acting) else acting
        if grown == acting:
            break
        acting = work.review(grown)
    if useful(acting):
        ledger.refine(acting)
    return acting


@dataclass(eq=False)
class _Completion:
    """What adding and reviewing share.

    Parameters
    ----------
    selected : tuple of str
        Effects that the selection has found.
    useful : callable
        As of `find_acting`.
    """

    ledger: FitLedger
    nominal: FittedModel
    levels: BalanceLevels
    selected: Names
    useful: Callable[[Names], bool] = always

    def __post_init__(self) -> None:
        self.near = Neighbours(self.ledger, self.nominal)

    def grow(self, names: Names) -> Names:
        """Return a model with all further effects that the likelihood asks for, one by one."""
        least = self.levels.criteria.plausible_gain
        while len(names) < MAX_ACTING:
            better = next(
                (key for gain, key in self.near.extended(names, names, least) if gain >= least),
                None,
            )
            if better is None:
                break
            names = better
        return names

    def review(self, names: Names) -> Names:
        """Return a model without the effects that it does not need, others in place of some.

        It ends where no model is better, where one comes again, or where it is of no use.
        """
        seen: set[Names] = set()
        better: Names | None = names
        while better is not None and better not in seen:
            seen.add(better)
            names = better
            better = self._improve(names) if self.useful(names) else None
            self.ledger.begun_fits.cancel_all()  # another model's neighbours are others
        return names

    def select_named(self, acting: Names) -> Names:
        """Return the effects that are `accepted` beside all others, or the one that is most.

        So is an effect that was selected, if without it the model is not credible: what others take
        up then says nothing against it. It must gain what any effect of the model must: one of no
        size may keep another one credible. An effect of the metered valve that only corrects a
        coarse flow map is not among them.
        """
        without = self.near.without_each(acting)
        named = tuple(
            name for name, fitted in without.items() if self._matters(name, acting, fitted)
        )
        losses = {name: fitted.cost for name, fitted in without.items() if fitted is not None}
        return named or (max(losses, key=lambda name: losses[name]),)

    def select_idle(self, acting: Names, named: Names) -> Names:
        """Return the effects that stay in the model, and of which nothing is said.

        They gain less than any effect of the model must, or nothing that is sure on held-out data:
        a flexible effect may fit what another law has left in the records fitted, and only there.
        """
        return tuple(
            name
            for name, without in self.near.without_each(acting).items()
            if name not in named and without is not None and not self._is_asked_for(acting, without)
        )

    def _is_asked_for(self, names: Names, without: FittedModel) -> bool:
        """Return whether a model gains enough over one without an effect, and surely anywhere."""
        present = self.near.fit_of(names)
        return self._gains_enough(without, present) and surely_gains(without, present, self.levels)

    def _gains_enough(self, before: FittedModel, after: FittedModel) -> bool:
        """Return whether a model gains what any effect of it must."""
        return gained(before, after) >= self.levels.criteria.plausible_gain

    def _matters(self, name: str, names: Names, without: FittedModel | None) -> bool:
        """Return whether an effect of a model is large enough to be named."""
        if without is None:
            return True
        added, rest = self.ledger.effects((name,)), self.near.rest(names, name)
        if only_corrects_map(added, without, self.levels, beside=bool(rest)):
            return False
        present = self.near.fit_of(names)
        needed = name in self.selected and rest in self.ledger.failures
        if needed and self._gains_enough(without, present):
            return True
        return accepted(self.nominal, without, present, self.levels)

    def _improve(self, names: Names) -> Names | None:
        """Return a model without its weakest needless effect, or with a better one; else None."""
        if len(names) == 1:
            return None
        starts: dict[str, Mapping[Names, Start]] = {}
        fits = {name: fit for name, fit in self.near.without_each(names).items() if fit is not None}
        present, whole = self.near.fit_of(names), self.near.background_of(names)
        weakest = [
            (name, fitted)
            for name, fitted in sorted(fits.items(), key=lambda item: item[1].cost)
            if self.near.rest(names, name) in self.ledger.fits
        ]
        for k, (name, fitted) in enumerate(weakest):
            needless = not self._gains_enough(fitted, present)
            if needless and not accepted(self.nominal, fitted, present, self.levels):
                return self.near.rest(names, name)
            # The fits of the next one begin as well, so that no process waits in between.
            for other, _ in weakest[k : k + 1 + self.ledger.begins_ahead]:
                if other not in starts:
                    starts[other] = self.near.begin_exchange(other, names, whole)
            better = self._exchange(starts[name], names)
            if better is not None:
                return better
        return None

    def _exchange(self, starts: Mapping[Names, Start], names: Names) -> Names | None:
        """Return a better model of those that begin with some starts; None where none is.

        In each another effect stands for one of `names`. Or two: a shifted null does in both
        chambers what a leak does in each. A pair with no more free parameters than the effect that
        it replaces need gain no more than a single one, but its second effect must be missed: a
        later review would take it away.
        """
        criteria, ledger, present = self.levels.criteria, self.ledger, self.near.fit_of(names)
        ledger.fit_against(present, dict(list(starts.items())[:TRIED]))
        known = sorted((ledger.fits[key].cost, key) for key in starts if key in ledger.fits)
        for _, key in known:
            gain = gained(present, self.near.fit_of(key))
            if gain >= criteria.form_gain:
                return key
            if len(names) < MAX_ACTING:
                least = self._least(self.near.estimated(key) + 1, names)
                pairs = [
                    (more, pair)
                    for more, pair in self.near.extended(key, names, PROMISED * (least - gain))
                    if more >= self._least(self.near.estimated(pair), names)
                    and more - gain >= criteria.plausible_gain
                ]
                if pairs:
                    return max(pairs)[1]
        return None

    def _least(self, estimated: int, than: Names) -> float:
        """Return what a model with so many parameters estimated must gain over another one."""
        criteria = self.levels.criteria
        return (
            criteria.plausible_gain if estimated > self.near.estimated(than) else criteria.form_gain
        )
