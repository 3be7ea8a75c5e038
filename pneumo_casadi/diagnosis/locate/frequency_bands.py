"""Residuals by frequency: spectra compared with that of the balance's signal."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.diagnosis.locate.signatures import noise_variance
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, Regime, RegimeKind
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.estimation.equation_error.smoothed_motion import SmoothedMotion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: Random permutations, or sign changes, of a test.
SHUFFLES = 999
#: Frequency bands [Hz].
BANDS = (0.0, 0.5, 2.0, 8.0, np.inf)
#: Length of the stretches of which spectra are taken [s].
STRETCH = 4.0


def band_regimes(
    study: Study, fit: FittedModel, balance: Location, rng: np.random.Generator
) -> list[Regime]:
    """Compare the spectrum of a balance's residual with that of its signal."""
    i = study.axis.equations.index(balance)
    residual, signal = [], []
    used = (*fit.used_train, *fit.used_held_out)
    for data, r, counts in zip(study.all_smoothed, (*fit.train, *fit.held_out), used, strict=True):
        drive = data.averaged(_signal(study.axis, data, balance))
        length = round(STRETCH * data.row_rate)
        if data.m < length:
            continue
        bands = _bands(length, data.row_rate)
        noise = bands @ _noise_spectrum(study, fit, i, data, length)
        for first in range(0, data.m - length + 1, length):
            part = slice(first, first + length)
            mask = counts[i, part]
            if mask.mean() > 0.3:
                residual.append(bands @ _spectrum(r[i, part], mask) - noise)
                signal.append(bands @ _spectrum(drive[part], mask))
    if len(residual) < 6:
        return []
    R, S = np.array(residual), np.array(signal)
    if R.sum() <= 0:
        return []
    regimes = []
    for (low, high), own, usual in zip(pairwise(BANDS), R.T, S.sum(axis=0) / S.sum(), strict=True):
        share = own.sum() / R.sum()
        excess = (own - usual * R.sum(axis=1)) / R.sum()
        signs = rng.choice([-1.0, 1.0], size=(SHUFFLES, excess.size))
        p = (1 + np.sum(signs @ excess >= excess.sum())) / (SHUFFLES + 1)
        band = Condition(RegimeKind.BAND, low, high)
        regimes.append(Regime(band, balance, float(share), float(usual), float(p)))
    return regimes


def _bands(length: int, rate: float) -> FloatArray:
    """Return what sums a spectrum over every band, as mean squares, (bands, length // 2 + 1).

    Rows of records with other sampling rates follow each other at other rates [1/s].
    """
    f = np.fft.rfftfreq(length, 1 / rate)
    return np.array([(f >= low) & (f < high) for low, high in pairwise(BANDS)]) / length**2


def _noise_spectrum(
    study: Study, fit: FittedModel, i: int, data: SmoothedMotion, length: int
) -> FloatArray:
    """Return what the sensors' noise adds to the spectrum of balance `i`, (length // 2 + 1,)."""
    order = 2 if study.axis.equations[i] == "force" else 1
    white = data.smooth(np.random.default_rng(0).standard_normal(data.N))
    for _ in range(order):
        white = data.derivative(white)
    rows = data.averaged(white)
    every = [rows[k : k + length] for k in range(0, data.m - length + 1, length)]
    shape = np.mean([_spectrum(part, np.ones(length, dtype=bool)) for part in every], axis=0)
    variance = noise_variance(study.axis, fit.values, data)[i]
    return np.asarray(shape * variance / np.var(rows))


def _signal(axis: Axis, data: SmoothedMotion, balance: str) -> FloatArray:
    if balance != "force":
        return np.asarray(data.dx[axis.motion_states.index(f"p_{balance[-1]}")])
    return axis.driving_force(data.x, data.u)


def _spectrum(values: FloatArray, mask: NDArray[np.bool_]) -> FloatArray:
    centred = np.where(mask, values - values[mask].mean(), 0.0)
    return np.asarray(np.abs(np.fft.rfft(centred * np.hanning(centred.size))) ** 2)
