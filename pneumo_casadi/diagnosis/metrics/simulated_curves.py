"""Held-out records over time beside their simulations, without effects and with them."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.data.recording.curves import MEASURED, Curves
from pneumo_casadi.diagnosis.metrics.simulated_gap import Simulations
from pneumo_casadi.diagnosis.prepare.study import FittedModel
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.metrics import output_noise
from pneumo_casadi.model.effect import Effect

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
    axis, records = simulations.study.axis, simulations.study.held_out
    models = {BEFORE: (nominal, ())} | ({} if final is None else {AFTER: (final, effects)})
    runs = {}
    for name, model in models.items():
        try:
            runs[name] = simulations.trajectories(*model)
        except (FitError, ModelError):  # a note of `simulated_gap` says so
            continue
    if not runs:
        return ()
    noise = {output: output_noise(axis, records, output) for output in axis.outputs}
    curves = []
    for several in zip(*runs.values(), strict=True):
        # Windows that one model cannot start in are no windows of the other either.
        common = np.intersect1d(several[0][1], several[-1][1])
        record = several[0][0]
        values = {output: {MEASURED: record[output][common]} for output in axis.outputs}
        for name, (_, rows, run) in zip(runs, several, strict=True):
            for output in axis.outputs:
                values[output][name] = run[output][np.isin(rows, common)]
        units = {output: axis.unit(output) for output in axis.outputs}
        curves.append(Curves(record.name, record.t[common], units, noise, values))
    return tuple(curves)
