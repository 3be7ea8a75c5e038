"""Cross-validation of flows and effort on records that were not used (Figs. 4 and 5)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.wls.arrays import read_only
from pneumo_casadi.estimation.wls.linear import relative_error_percent
from pneumo_casadi.estimation.wls.regressor import Observation, StickPhases, observe
from pneumo_casadi.estimation.wls.result import WLSResult
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prediction(Brief):
    """Measured and predicted sides of the balances on one record (Figs. 4 and 5).

    Parameters
    ----------
    name : str
        Of the record.
    t : (m,) array
        Instants of the decimated rows [s].
    measured, predicted : mapping of str to (m,) array
        By equation: ``mass_flow_P``, ``mass_flow_N`` [kg/s], ``force`` [N]; as the fit counts
        them, so that of force nothing remains of a rest.
    used : mapping of str to (m,) array of bool
        Rows that count, by the treatment of samples at rest.
    relative_error_percent : mapping of str to float
        100 ‖measured - predicted‖ / ‖measured‖ over the rows that count.
    relative_error_percent_all : mapping of str to float
        Over all rows, samples at rest included.
    """

    name: str
    t: FloatArray
    measured: Mapping[str, FloatArray]
    predicted: Mapping[str, FloatArray]
    used: Mapping[str, NDArray[np.bool_]]
    relative_error_percent: Mapping[str, float]
    relative_error_percent_all: Mapping[str, float]


def cross_validate(
    result: WLSResult, records: Recording | Iterable[Recording]
) -> tuple[Prediction, ...]:
    """Predict flows and effort on records that were not used, and compare (Figs. 4 and 5).

    Parameters
    ----------
    result : WLSResult
        Supplies estimates, filters and treatment of samples at rest, its threshold included.
    records : Recording or iterable of Recording
        Best not those of the fit.

    Returns
    -------
    tuple of Prediction
        One for each record.

    Raises
    ------
    CaseError, ModelError
        If a record lacks a channel, or is too short for the filters.
    """
    recordings = (records,) if isinstance(records, Recording) else tuple(records)
    return tuple(_predict(result, record) for record in recordings)


def _predict(result: WLSResult, recording: Recording) -> Prediction:
    counted = _observe(result, recording, result.stick)
    all_alike = result.stick is StickPhases.KEEP
    whole = counted if all_alike else _observe(result, recording, StickPhases.KEEP)
    predicted, names = counted.W @ result.estimate, counted.equations
    return Prediction(
        name=recording.name,
        t=counted.t,
        measured=dict(zip(names, map(read_only, counted.Y), strict=True)),
        predicted=dict(zip(names, map(read_only, predicted), strict=True)),
        used=dict(zip(names, counted.used, strict=True)),
        relative_error_percent=_relative_errors(counted, result.estimate),
        relative_error_percent_all=_relative_errors(whole, result.estimate),
    )


def _observe(result: WLSResult, recording: Recording, stick: StickPhases) -> Observation:
    return observe(
        result.model,
        recording,
        result.names,
        result.plan,
        stick=stick,
        velocity_threshold=max(result.velocity_threshold.values()),
        pairing=result.pairing,
    )


def _relative_errors(o: Observation, estimate: FloatArray) -> dict[str, float]:
    rho, used = o.Y - o.W @ estimate, o.used
    return {
        name: relative_error_percent(rho[e, used[e]], o.Y[e, used[e]])
        for e, name in enumerate(o.equations)
    }
