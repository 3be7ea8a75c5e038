"""Completion of the final model, stepwise: weak effects join it, needless ones are eliminated.

Forward selection stops at the effects that are large enough to be named. Weak ones besides are
still in the records; without them in the model another effect takes up what they do, one that is
not there: a shifted null stands for two leaks while the lag of a sensor is missing. So the model is
completed by whatever the likelihood asks for, and each of its effects is then eliminated or
exchanged where the others no longer need it.
"""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field, replace

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, gain_on_all_records
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.starting_values import values_of
from pneumo_casadi.diagnosis.screen.background import Background, background, lost_likelihood
from pneumo_casadi.diagnosis.select.acceptance import accepted, only_corrects_map
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.hidden_motion import hides
from pneumo_casadi.diagnosis.select.propose import where_to_begin

#: Largest number of effects in the final model: one or two large ones, and six weak ones.
MAX_ACTING = 8
#: Credible fits where an effect is to be added or exchanged, the most promising first.
TRIED = 2
#: Rounds of adding and reviewing.
ROUNDS = 3
#: An effect is tried in place of another one if the screen promises this share of what the other
#: does while all else stays as it is.
PROMISED = 0.7


@dataclass(frozen=True)
class Completed:
    """A completed model.

    Parameters
    ----------
    acting : tuple of str
        All its effects.
    named : tuple of str
        Those large enough to be named.
    """

    acting: Names
    named: Names


def complete(
    ledger: FitLedger, nominal: FittedModel, final: Names, levels: BalanceLevels
) -> Completed:
    """Return the final model completed, with the effects that matter in it.

    Parameters
    ----------
    final : tuple of str
        Effects that the selection has found.
    """
    acting = find_acting(ledger, nominal, final, levels)
    work = _Completion(ledger, nominal, levels, final)
    return Completed(acting, work.select_named(acting))


def find_acting(
    ledger: FitLedger,
    nominal: FittedModel,
    final: Names,
    levels: BalanceLevels,
    required: Names = (),
) -> Names:
    """Return the effects, large and weak, of the model completed, which the ledger refines.

    The search ends where one of those `required` is no longer among them; that model is returned
    as it is, of no use to who requires them.
    """
    work = _Completion(ledger, nominal, levels, final, frozenset(required))
    acting = work.review(work.grow(final))
    for _ in range(ROUNDS - 1):
        grown = work.grow(acting) if work.required <= set(acting) else acting
        if grown == acting:
            break
        acting = work.review(grown)
    if work.required <= set(acting):
        ledger.refine(acting)
    return acting


@dataclass(eq=False)
class _Completion:
    """What adding and reviewing share.

    Parameters
    ----------
    selected : tuple of str
        Effects that the selection has found.
    required : frozenset of str
        Effects without which a model is of no use.
    refused : set of str
        Effects that were not credible where they were to be added: they are not tried again.
    """

    ledger: FitLedger
    nominal: FittedModel
    levels: BalanceLevels
    selected: Names
    required: frozenset[str] = frozenset()
    refused: set[str] = field(default_factory=set)

    def grow(self, names: Names) -> Names:
        """Return a model with all further effects that the likelihood asks for, one by one."""
        least = self.levels.criteria.plausible_gain
        while len(names) < MAX_ACTING:
            better = next(
                (key for gain, key in self._extended(names, names, least) if gain >= least), None
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
            better = self._improve(names) if self.required <= set(names) else None
        return names

    def select_named(self, acting: Names) -> Names:
        """Return the effects that are `accepted` beside all others, or the one that is most.

        So is an effect that was selected, if without it the model is not credible: what others take
        up then says nothing against it. An effect of the metered valve that only corrects a coarse
        flow map is not among them.
        """
        without = self._fit_without(acting)
        named = tuple(
            name for name, fitted in without.items() if self._matters(name, acting, fitted)
        )
        losses = {name: fitted.cost for name, fitted in without.items() if fitted is not None}
        return named or (max(losses, key=lambda name: losses[name]),)

    def _matters(self, name: str, names: Names, without: FittedModel | None) -> bool:
        """Return whether an effect of a model is large enough to be named."""
        if without is None:
            return True
        added, rest = self.ledger.effects((name,)), self._rest(names, name)
        if only_corrects_map(added, without, self.levels, beside=bool(rest)):
            return False
        needed = name in self.selected and rest in self.ledger.failures
        return needed or accepted(self.nominal, without, self._fit_of(names), self.levels)

    def _improve(self, names: Names) -> Names | None:
        """Return a model without its weakest needless effect, or with a better one; else None."""
        criteria = self.levels.criteria
        if len(names) == 1:
            return None
        fits = {name: fit for name, fit in self._fit_without(names).items() if fit is not None}
        present, effects = self._fit_of(names), self.ledger.effects(names)
        whole = background(self.ledger.study, self.nominal, present, effects)
        for name, fitted in sorted(fits.items(), key=lambda item: item[1].cost):
            rest, loss = self._rest(names, name), min(_gains(fitted, self._fit_of(names)))
            if rest not in self.ledger.fits:
                continue
            if loss < criteria.plausible_gain and not accepted(
                self.nominal, fitted, self._fit_of(names), self.levels
            ):
                return rest
            better = self._exchange(rest, names, whole)
            if better is not None:
                return better
        return None

    def _exchange(self, rest: Names, names: Names, whole: Background) -> Names | None:
        """Return a better model in which one other effect stands for the one that `rest` lacks.

        Or two: a shifted null does in both chambers what a leak does in each. A pair with no more
        free parameters than the effect that it replaces need gain no more than a single one, but
        its second effect must be missed: a later review would take it away. `whole` is the
        background of the model with `names`.
        """
        criteria, ledger, present = self.levels.criteria, self.ledger, self._fit_of(names)
        (gone,) = set(names) - set(rest)
        own = values_of(gone, present.values)
        values = {name: value for name, value in present.values.items() if name not in own}
        left = replace(present, effects=rest, values=values)
        behind = background(ledger.study, self.nominal, left, ledger.effects(rest))
        starts = self._starts(behind, values, set(names), PROMISED * lost_likelihood(whole, behind))
        keys = {ledger.key((*rest, name)): start for name, start in starts.items()}
        ledger.fit_against(present, dict(list(keys.items())[:TRIED]))
        known = sorted((ledger.fits[key].cost, key) for key in keys if key in ledger.fits)
        for _, key in known:
            gain = min(_gains(present, self._fit_of(key)))
            if gain >= criteria.form_gain:
                return key
            if len(names) < MAX_ACTING:
                least = self._least(self._estimated(key) + 1, names)
                pairs = [
                    (more, pair)
                    for more, pair in self._extended(key, names, PROMISED * (least - gain))
                    if more >= self._least(self._estimated(pair), names)
                    and more - gain >= criteria.plausible_gain
                ]
                if pairs:
                    return max(pairs)[1]
        return None

    def _least(self, estimated: int, than: Names) -> float:
        """Return what a model with so many parameters estimated must gain over another one."""
        criteria = self.levels.criteria
        return criteria.plausible_gain if estimated > self._estimated(than) else criteria.form_gain

    def _estimated(self, names: Names) -> int:
        """Return how many parameters some effects have that every fit estimates."""
        return sum(
            item.free or item.name in effect.staircase
            for effect in self.ledger.effects(names)
            for item in effect.parameters
        )

    def _extended(
        self, known: Names, present: Names, promise: float
    ) -> Iterator[tuple[float, Names]]:
        """Yield what models with one effect more gain over the present model, and their effects.

        The fits that may be next begin side by side.

        Parameters
        ----------
        known, present : tuple of str
            The model to be extended, and the one so far, whose effects are left out.
        promise : float
            Log-likelihood that an effect must promise in the screen.
        """
        ledger, tried = self.ledger, 0
        starts = {
            (name, ledger.key((*known, name))): start
            for name, start in self._promising(known, present, promise).items()
        }
        for (_, key), start in list(starts.items())[:TRIED]:
            ledger.begin_fit(key, start)
        for (name, key), start in starts.items():
            ledger.fit_against(self._fit_of(present), {key: start})
            if key not in ledger.fits:
                self.refused |= {name} if known == present else set()
                continue
            tried += 1
            yield min(_gains(self._fit_of(present), self._fit_of(key))), key
            if tried == TRIED:
                break

    def _promising(self, known: Names, present: Names, promise: float) -> Mapping[str, Start]:
        """Return where the fits of effects may begin that promise enough, the best first.

        What would hide the motion is left out: there the balances do not tell.
        """
        base, effects = self._fit_of(known), self.ledger.effects(known)
        behind = background(self.ledger.study, self.nominal, base, effects)
        return self._starts(behind, base.values, {*known, *present}, promise)

    def _starts(
        self, behind: Background, values: Mapping[str, float], present: Set[str], promise: float
    ) -> dict[str, Start]:
        ledger = self.ledger
        return {
            name: Start(values, trials=where_to_begin(ledger, result))
            for name, result in ledger.over(behind, (*present, *self.refused)).items()
            if result.gain > promise and not hides(ledger.catalogue[name](), result.sizes)
        }

    def _fit_without(self, names: Names) -> dict[str, FittedModel | None]:
        """Return the fits of a model without each of its effects; None where there is none."""
        if len(names) == 1:
            return {names[0]: self.nominal}
        return self.ledger.fit_without(names, names)

    def _rest(self, names: Names, name: str) -> Names:
        return self.ledger.key(set(names) - {name})

    def _fit_of(self, names: Names) -> FittedModel:
        return self.ledger.fits[names] if names else self.nominal


def _gains(before: FittedModel, after: FittedModel) -> tuple[float, float]:
    """Return the log-likelihood gained of the records fitted, and of these and those held out."""
    return before.cost - after.cost, gain_on_all_records(before, after)
