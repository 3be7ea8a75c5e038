"""The verdict of a diagnosis, from the selection and the parameter checks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pneumo_casadi.diagnosis.checks.absorbed import absorbed_candidates
from pneumo_casadi.diagnosis.decide.credibility import near_noise, review_verdict
from pneumo_casadi.diagnosis.decide.judgement import Judgement, doubted, judge
from pneumo_casadi.diagnosis.metrics.findings import Check
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.select.fit_ledger import Names
from pneumo_casadi.diagnosis.select.forms import cause_of, causes_of
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.model.effect import EffectFactory

#: Verdicts that name effects of the final model.
NAMING = (Verdict.EFFECT, Verdict.AMBIGUOUS)


@dataclass(frozen=True, slots=True)
class Decision:
    """A verdict with its grounds.

    Parameters
    ----------
    verdict : Verdict
        Final.
    judgement : Judgement
        Verdict and probabilities before the parameter checks.
    absorbed : tuple of str
        Effects that the parameters may have absorbed, the most likely first; beside effects that
        are named, those that they have absorbed.
    """

    verdict: Verdict
    judgement: Judgement
    absorbed: tuple[str, ...]

    @property
    def names_effects(self) -> bool:
        """Whether the verdict names effects of the final model."""
        return self.verdict in NAMING

    @property
    def has_gap(self) -> bool:
        """Whether simulation and measurement disagree by more than noise."""
        with_gap = self.names_effects or self.verdict is Verdict.UNKNOWN
        return with_gap or not near_noise(self.judgement)

    @property
    def alternatives(self) -> tuple[Names, ...]:
        """Models among which the data cannot decide, the most probable first."""
        if self.names_effects:
            return self.judgement.alike
        return tuple((name,) for name in self.absorbed)

    @property
    def is_open(self) -> bool:
        """Whether these models are told as alternatives, and not by what is undecided."""
        if self.verdict is Verdict.EFFECT and self.judgement.undecided:
            return False
        return len(self.alternatives) > 1 or (bool(self.absorbed) and not self.names_effects)


def decide_verdict(
    selection: Selection,
    checks: Sequence[Check],
    catalogue: Mapping[str, EffectFactory],
    surpassed: bool = False,
) -> Decision:
    """Return the verdict: from the selection first, then reviewed by the parameter checks.

    `is_unknown` decides in both stages when the verdict is ``unknown``; with `surpassed` it is.

    Parameters
    ----------
    selection : Selection
        From `select_effects`.
    checks : sequence of Check
        From `check_fit`, of its final model.
    catalogue : mapping of str to effect class
        All effects that were fitted, and those that the parameters may have absorbed.
    surpassed : bool, optional
        Whether something outside the catalogue explains the gap better than the effects named.
    """
    named = tuple(catalogue[name]() for name in selection.named)
    corrections = {name for name, make in catalogue.items() if make().metered}
    judgement = judge(selection, named, surpassed, corrections)
    if selection.balances_show_nothing and judgement.verdict in NAMING:
        verdict, absorbed = judgement.verdict, absorbed_candidates(checks, catalogue)
    else:
        verdict, absorbed = review_verdict(judgement, checks, catalogue)
    if verdict in NAMING:  # of those fitted, and of other forms of those named, the model tells
        causes = causes_of(selection.named, catalogue)
        absorbed = tuple(
            name
            for name in absorbed
            if name not in selection.chosen and cause_of(name, catalogue) not in causes
        )
    if verdict is Verdict.UNKNOWN:
        judgement = doubted(judgement)
    return Decision(verdict, judgement, absorbed)
