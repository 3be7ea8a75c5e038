"""States of the effects of an axis along a record, driven by the measured motion."""

from collections.abc import Sequence

import numpy as np

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.smoothed_motion import smooth_motion
from pneumo_casadi.estimation.equation_error.true_motion import (
    remembered_before,
    simulate_effect_states,
    true_motions,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray


def states_along(axis: Axis, records: Sequence[Recording]) -> tuple[FloatArray, ...]:
    """Return the states of the effects at the samples of some records, (nz, N) of each.

    Empty for an axis whose effects have no states. They start at rest and follow the smoothed
    motion, so that what an effect remembers, such as the side of its play on which a spool rests,
    is that of the whole record before.

    Parameters
    ----------
    axis : Axis
        With its effects, all parameters known.
    records : sequence of Recording
        Of the same axis.

    Raises
    ------
    CaseError
        If a record is too short for the filters.
    """
    if axis.states == axis.motion_states:
        return ()
    model, theta = BalanceFunctions(axis), axis.parameters.values
    states = []
    for record in records:
        data = smooth_motion(axis, record)
        motion = true_motions(model, data, [theta])
        (z,) = simulate_effect_states(model, data, [theta], motion)
        course = np.stack([np.interp(record.t, data.t, row) for row in z])
        if model.sampled.any():  # then every column is a sample
            before = remembered_before(model, data, theta, motion[0])
            every = np.hstack([before[:, :-1], z])
            at = np.minimum(np.arange(record.N), every.shape[1] - 1)
            course[model.sampled] = every[np.ix_(model.sampled, at)]
        states.append(course)
    return tuple(states)
