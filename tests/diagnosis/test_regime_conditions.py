"""Conditions and bands of records that differ in their clocks and sampling rates."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.locate import frequency_bands
from pneumo_casadi.diagnosis.locate.frequency_bands import band_regimes
from pneumo_casadi.diagnosis.locate.regime_conditions import balance_rows, conditions_of
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import RegimeKind
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel

HUM = 7.0  # [Hz]


def humming(rate):
    """A record of 40 s with so many rows a second, and a residual that hums."""
    m = round(40 * rate)
    drive = np.random.default_rng(0).normal(size=m)
    data = SimpleNamespace(row_rate=rate, m=m, averaged=lambda values: drive)
    return data, np.sin(2 * np.pi * HUM * np.arange(m) / rate)[None]


def test_a_residual_of_one_frequency_is_in_its_band_at_every_sampling_rate(monkeypatch):
    """Rows of records at 1 kHz follow each other at 62.5 Hz, those of slow ones at 50 Hz."""
    monkeypatch.setattr(frequency_bands, "_signal", lambda *given: None)
    monkeypatch.setattr(
        frequency_bands, "_noise_spectrum", lambda *given: np.zeros(given[-1] // 2 + 1)
    )
    (fast, first), (slow, second) = humming(62.5), humming(50.0)
    study = SimpleNamespace(axis=SimpleNamespace(equations=("force",)), all_smoothed=(fast, slow))
    used = [(np.ones_like(r, dtype=bool),) for r in (first, second)]
    fitted = FittedModel((), {}, {}, 0.0, (first,), (second,), *used, True)
    bands = band_regimes(study, fitted, Location.FORCE, np.random.default_rng(0))
    (share,) = (band.share for band in bands if band.condition.lower <= HUM < band.condition.upper)
    assert share > 0.99


@pytest.mark.parametrize("apart", [0.0, 3600.0])
def test_thirds_are_those_of_each_record(sound_study, apart):
    """Of one log all rows of the first record were in the first third, of the second none."""
    moved = tuple(replace(record, t=record.t + apart) for record in sound_study.held_out)
    study = replace(sound_study, held_out=moved)
    train, held_out = study.smoothed
    used = [tuple(data.used(study.axis) for data in part) for part in (train, held_out)]
    r = [tuple(np.ones(mask.shape) for mask in part) for part in used]
    rows = next(balance_rows(study, FittedModel((), {}, {}, 0.0, *r, *used, True)))
    masks = {condition.kind: mask for condition, mask in conditions_of(rows, study.axis)}
    number = int(sum(mask[0].sum() for mask in used[0]))
    for kind in (RegimeKind.FIRST_THIRD, RegimeKind.LAST_THIRD):
        for part in (masks[kind][:number], masks[kind][number:]):
            assert 0.25 < part.mean() < 0.45
