"""Held-out records over time beside their simulations, without effects and with them."""

from collections.abc import Sequence
from contextlib import suppress

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.diagnosis.metrics.simulated_gap import Simulations
from pneumo_casadi.diagnosis.prepare.study import FittedModel
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.validation import window_curves

#: Names of the simulations.
BEFORE, AFTER = "without effects", "with effects"


def simulated_curves(
    simulations: Simulations,
    nominal: FittedModel,
    final: FittedModel | None = None,
    effects: Sequence[Effect] = (),
) -> tuple[Curves, ...]:
    """Return the outputs of the held-out records, measured and simulated over the gap's windows.

    Parameters
    ----------
    simulations : Simulations
        Of the study.
    nominal : FittedModel
        The fit without effects.
    final : FittedModel, optional
        The fit with effects.
    effects : sequence of Effect
        Those of `final`, in the order of its model.

    Returns
    -------
    tuple of Curves
        One a record; a simulation that fails is left out, and without any there is none.
    """
    models = {BEFORE: (nominal, ())} | ({} if final is None else {AFTER: (final, effects)})
    runs = {}
    for name, model in models.items():
        with suppress(FitError, ModelError):  # a note of `simulated_gap` says so
            runs[name] = simulations.trajectories(*model)
    return window_curves(simulations.study.axis, runs)
