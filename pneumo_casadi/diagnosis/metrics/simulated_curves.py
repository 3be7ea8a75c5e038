"""Held-out records over time beside their simulations, without effects and with them."""

from collections.abc import Sequence

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.diagnosis.metrics.simulations import Simulations
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.validation.simulations import window_curves

#: Names of the simulations.
BEFORE, AFTER = "without effects", "with effects"
WITH_TERM = "with the discovered term"


def simulated_curves(
    simulations: Simulations,
    nominal: FittedModel,
    final: FittedModel | None = None,
    effects: Sequence[Effect] = (),
    with_term: tuple[FittedModel, Sequence[Effect]] | None = None,
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
    with_term : (FittedModel, sequence of Effect), optional
        The fit with a discovered term, and its effects.

    Returns
    -------
    tuple of Curves
        One a record; a simulation that fails is left out, and without any there is none.
    """
    models: dict[str, tuple[FittedModel, Sequence[Effect]]] = {BEFORE: (nominal, ())}
    if final is not None:
        models[AFTER] = (final, effects)
    if with_term is not None:
        models[WITH_TERM] = with_term
    runs = {name: simulations.trajectories(*model) for name, model in models.items()}
    # Of a simulation that fails a note of `simulated_gap` says why.
    return window_curves(simulations.study.axis, {name: run for name, run in runs.items() if run})
