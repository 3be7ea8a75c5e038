"""Models next to one: with an effect more, with one less, or with another in its place."""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, field, replace

from pneumo_casadi.diagnosis.metrics.residual_size import gain_on_all_records
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.starting_values import values_of
from pneumo_casadi.diagnosis.screen.background import Background, background, lost_likelihood
from pneumo_casadi.diagnosis.select.fit_ledger import FitLedger, Names, Start
from pneumo_casadi.diagnosis.select.hidden_motion import hides
from pneumo_casadi.diagnosis.select.propose import where_to_begin

#: Credible fits where an effect is to be added or exchanged, the most promising first.
TRIED = 2
#: An effect is tried in place of another one if the screen promises this share of what the other
#: does while all else stays as it is.
PROMISED = 0.7


@dataclass(eq=False)
class Neighbours:
    """Propose models next to one, and have the ledger fit them.

    Parameters
    ----------
    ledger : FitLedger
        The fits.
    nominal : FittedModel
        The model without effects.
    refused : set of str
        Effects that were not credible where they were to be added: they are not tried again.
    """

    ledger: FitLedger
    nominal: FittedModel
    refused: set[str] = field(default_factory=set)

    def fit_of(self, names: Names) -> FittedModel:
        """Return the fit of a model."""
        return self.ledger.fits[names] if names else self.nominal

    def rest(self, names: Names, name: str) -> Names:
        """Return the effects of a model but for one."""
        return self.ledger.key(set(names) - {name})

    def without_each(self, names: Names) -> dict[str, FittedModel | None]:
        """Return the fits of a model without each of its effects; None where there is none."""
        if len(names) == 1:
            return {names[0]: self.nominal}
        return self.ledger.fit_without(names, names)

    def background_of(self, names: Names) -> Background:
        """Return what a model leaves, as the screen of further effects needs it."""
        return self._behind(names, self.fit_of(names))

    def estimated(self, names: Names) -> int:
        """Return how many parameters some effects have that every fit estimates."""
        return sum(
            item.free or item.name in effect.staircase
            for effect in self.ledger.effects(names)
            for item in effect.parameters
        )

    def extended(
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
            ledger.fit_against(self.fit_of(present), {key: start})
            if key not in ledger.fits:
                self.refused |= {name} if known == present else set()
                continue
            tried += 1
            yield gained(self.fit_of(present), self.fit_of(key)), key
            if tried == TRIED:
                break

    def _promising(self, known: Names, present: Names, promise: float) -> Mapping[str, Start]:
        """Return where the fits of effects may begin that promise enough, the best first.

        What would hide the motion is left out: there the balances do not tell.
        """
        values = self.fit_of(known).values
        return self._starts(self.background_of(known), values, {*known, *present}, promise)

    def _behind(self, names: Names, fitted: FittedModel) -> Background:
        return background(self.ledger.study, self.nominal, fitted, self.ledger.effects(names))

    def _starts(
        self, behind: Background, values: Mapping[str, float], present: Set[str], promise: float
    ) -> dict[str, Start]:
        ledger = self.ledger
        return {
            name: Start(values, trials=where_to_begin(ledger, result))
            for name, result in ledger.over(behind, (*present, *self.refused)).items()
            if result.gain > promise and not hides(ledger.catalogue[name](), result.sizes)
        }

    def begin_exchange(self, name: str, names: Names, whole: Background) -> Mapping[Names, Start]:
        """Begin the fits of models in which another effect stands for one; return their starts.

        `whole` is the background of the model with `names`.
        """
        ledger, present = self.ledger, self.fit_of(names)
        own, rest = values_of(name, present.values), self.rest(names, name)
        values = {name: value for name, value in present.values.items() if name not in own}
        behind = self._behind(rest, replace(present, effects=rest, values=values))
        starts = self._starts(behind, values, set(names), PROMISED * lost_likelihood(whole, behind))
        keys = {ledger.key((*rest, other)): start for other, start in starts.items()}
        for key in list(keys)[:TRIED]:
            ledger.begin_fit(key, keys[key])
        return keys


def gained(before: FittedModel, after: FittedModel) -> float:
    """Return the log-likelihood gained of the records fitted, or of all if that is less."""
    return min(before.cost - after.cost, gain_on_all_records(before, after))
