"""The final model completed: by what else the likelihood asks for, and without what it need not.

Forward selection stops at the effects that are large enough to be named. Weak ones besides are
still in the records, and a model without them lends what they do to an effect that is not there:
a shifted null stands for two leaks while the lag of a sensor is missing. So the final model takes
up whatever the records ask for, and each of its effects is then dropped or exchanged if the others
no longer need it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels, gain_on_all_records
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.screen.screen import background
from pneumo_casadi.diagnosis.select.acceptance import accepted, only_corrects_map
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.hidden_motion import hides
from pneumo_casadi.diagnosis.select.plausibility import implausible_properties

#: Largest number of effects in the final model: one or two that are named, and six weak ones.
MAX_ACTING = 8
#: Credible fits where an effect is to be added or exchanged, the most promising first.
TRIED = 2
#: Rounds of adding and reviewing.
ROUNDS = 3
#: Share of what a model loses without an effect that another one must promise to be tried instead.
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
    work = _Completion(ledger, nominal, levels)
    acting = work.reviewed(work.grown(final))
    for _ in range(ROUNDS - 1):
        grown = work.grown(acting)
        if grown == acting:
            break
        acting = work.reviewed(grown)
    ledger.refine(acting)
    return Completed(acting, work.those_that_matter(acting))


@dataclass(eq=False)
class _Completion:
    """What adding and reviewing share.

    Parameters
    ----------
    refused : set of str
        Effects that were not credible beside others: they are not tried again.
    """

    ledger: FitLedger
    nominal: FittedModel
    levels: BalanceLevels
    refused: set[str] = field(default_factory=set)

    def grown(self, names: Names) -> Names:
        """Return a model with all further effects that the likelihood asks for, one by one."""
        least = self.levels.criteria.plausible_gain
        while len(names) < MAX_ACTING:
            better = self._with_one_more(names, least, least, names)
            if better is None:
                break
            names = better
        return names

    def reviewed(self, names: Names) -> Names:
        """Return a model without the effects that it does not need, others in place of some."""
        criteria = self.levels.criteria
        without = self._fit_without(names)
        for name in sorted(without, key=lambda name: without[name].cost):
            rest, fitted, current = self._rest(names, name), without[name], self._fit_of(names)
            loss = min(_gains(fitted, current))
            if not rest or (
                accepted(self.nominal, fitted, current, self.levels)
                and (loss < criteria.plausible_gain)
            ):
                continue
            if loss < criteria.plausible_gain:
                return self.reviewed(rest)
            promise = PROMISED * loss
            better = self._with_one_more(rest, promise, loss + criteria.form_gain, names)
            if better is not None:
                return self.reviewed(better)
        return names

    def those_that_matter(self, acting: Names) -> Names:
        """Return the effects that are `accepted` beside all others, or the one that is most.

        An effect of the metered valve that only corrects a coarse flow map is none of them.
        """
        without, fit, beside = self._fit_without(acting), self._fit_of(acting), len(acting) > 1
        named = tuple(
            name
            for name, fitted in without.items()
            if accepted(self.nominal, fitted, fit, self.levels)
            and not only_corrects_map(self.ledger.effects((name,)), fitted, self.levels, beside)
        )
        return named or (max(without, key=lambda name: without[name].cost),)

    def _with_one_more(
        self, known: Names, promise: float, least: float, present: Names
    ) -> Names | None:
        """Return a model with the first effect that gains enough; `TRIED` that promise it are.

        What makes a plausible property of the axis implausible stands for something else.

        Parameters
        ----------
        promise, least : float
            Log-likelihood that an effect must promise in the screen, and gain once it is fitted.
        present : tuple of str
            The model so far, whose effects are not meant.
        """
        base, tried = self._fit_of(known), 0
        for name, start in self._promising(known, promise, present).items():
            key = self.ledger.key((*known, name))
            self.ledger.fit_all({key: start})
            if key not in self.ledger.fits:
                self.refused.add(name)
                continue
            tried += 1
            gains = min(_gains(base, self._fit_of(key)))
            if gains >= least and self._implausible(key) <= self._implausible(present):
                return key
            if tried == TRIED:
                break
        return None

    def _implausible(self, names: Names) -> set[str]:
        return implausible_properties(self.ledger, names, self._fit_of(names))

    def _promising(self, known: Names, promise: float, present: Names) -> Mapping[str, Start]:
        """Return where the fits of effects may begin that promise enough, the best first.

        What would hide the motion is left out: there the balances do not tell.
        """
        ledger, base = self.ledger, self._fit_of(known)
        behind = background(ledger.study, self.nominal, base, ledger.effects(known))
        return {
            name: Start(base.values, trials=[result.sizes, *result.starts])
            for name, result in ledger.over(behind, (*present, *self.refused)).items()
            if result.gain > promise and not hides(ledger.catalogue[name](), result.sizes)
        }

    def _fit_without(self, names: Names) -> dict[str, FittedModel]:
        """Return the fits of a model without each of its effects; a failed one is left out."""
        keys = {name: self._rest(names, name) for name in names}
        values = self._fit_of(names).values
        self.ledger.fit_all({key: Start(values) for key in keys.values() if key})
        return {
            name: self._fit_of(key)
            for name, key in keys.items()
            if not key or key in self.ledger.fits
        }

    def _rest(self, names: Names, name: str) -> Names:
        return self.ledger.key(set(names) - {name})

    def _fit_of(self, names: Names) -> FittedModel:
        return self.ledger.fits[names] if names else self.nominal


def _gains(before: FittedModel, after: FittedModel) -> tuple[float, float]:
    """Return the log-likelihood gained of the records fitted, and of these and those held out."""
    return before.cost - after.cost, gain_on_all_records(before, after)
