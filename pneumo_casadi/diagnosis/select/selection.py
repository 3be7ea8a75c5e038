"""What a selection of effects has found: all that was fitted, and the path taken."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.metrics.simulations import Simulations
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.screen.directions import Direction
from pneumo_casadi.diagnosis.screen.screen import ScreenResult
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.fit_ledger import Failed, Names


@dataclass(frozen=True, eq=False)
class Selection:
    """All that was fitted, and the path taken.

    Parameters
    ----------
    nominal : FittedModel
        Without effects.
    fits : mapping of tuple of str to FittedModel
        Every model with effects, by their sorted names.
    failures : tuple of Failed
        Fits that failed.
    screen : mapping of str to ScreenResult
        Result of the screen at the nominal model.
    path : tuple of tuple of str
        Models accepted one after another; empty if none was.
    levels : BalanceLevels
        Noise and signal of the held-out records.
    output_error_fits : mapping of tuple of str to FittedModel
        Models that were taken as output error has refined them; see `extend_by_simulation`.
    gap_left : mapping of tuple of str to float
        Share of the simulated gap left by those, and by a final model that balances tell little of.
    trials : mapping of tuple of str to float
        Share of the simulated gap left by every model that output error has refined.
    simulations : Simulations
        Of the held-out records, those already done.
    forms : mapping of str to mapping of str to FittedModel
        By cause of which the catalogue has several forms: the fit of each form alone.
    contributions : mapping of str to float
        Share of the gap that comes back without each effect named, the most missed first.
    completed : Completed, optional
        The final model; by default the last of the path, of which all effects are named.
    directions : mapping of str to tuple of Direction
        The perturbations by each effect that further models may have.
    by_simulation : bool
        Whether simulations alone have found the effect selected last: the balances show no gap, or
        those selected before leave none there.
    simulated : bool
        Whether the final model surely explains simulations of the held-out records. A balance that
        keeps a small gap then casts no doubt on the effects named.
    """

    nominal: FittedModel
    fits: Mapping[Names, FittedModel]
    failures: tuple[Failed, ...]
    screen: Mapping[str, ScreenResult]
    path: tuple[Names, ...]
    levels: BalanceLevels
    output_error_fits: Mapping[Names, FittedModel]
    gap_left: Mapping[Names, float]
    trials: Mapping[Names, float]
    simulations: Simulations
    forms: Mapping[str, Mapping[str, FittedModel]] = field(default_factory=dict)
    contributions: Mapping[str, float] = field(default_factory=dict)
    completed: Completed | None = None
    directions: Mapping[str, tuple[Direction, ...]] = field(default_factory=dict)
    by_simulation: bool = False
    simulated: bool = False

    @property
    def accepted(self) -> Names:
        """Effects accepted by forward selection."""
        return self.path[-1] if self.path else ()

    @property
    def balances_show_nothing(self) -> bool:
        """Whether the balances of the nominal model show no gap, and simulations alone do."""
        return self.by_simulation and len(self.path) == 1

    @property
    def chosen(self) -> Names:
        """Effects of the final model."""
        return self.accepted if self.completed is None else self.completed.acting

    @property
    def named(self) -> Names:
        """Those of them that are large enough to be named."""
        return self.accepted if self.completed is None else self.completed.named

    @property
    def besides(self) -> Names:
        """Those that are not."""
        return tuple(name for name in self.chosen if name not in self.named)

    @property
    def idle(self) -> Names:
        """Those besides of which nothing is said; see `Completed`."""
        return () if self.completed is None else self.completed.idle

    @property
    def final(self) -> FittedModel:
        """The final model."""
        if not self.path:
            return self.nominal
        return self.output_error_fits.get(self.chosen, self.fits[self.chosen])

    def with_final(self, fitted: FittedModel) -> "Selection":
        """Return the selection with another fit of its final model."""
        if not self.path:
            return replace(self, nominal=fitted)
        if self.chosen in self.output_error_fits:
            return replace(self, output_error_fits={**self.output_error_fits, self.chosen: fitted})
        return replace(self, fits={**self.fits, self.chosen: fitted})
