"""Noise floors and signals of the balances."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels


def test_the_noise_of_records_is_pooled_by_their_rows(sound_study):
    """Residuals are: the mean of both would be the floor of neither."""
    (record,) = sound_study.held_out
    noise = 1e-4 * np.random.default_rng(0).normal(size=record.N)
    quiet, noisy = (
        record,
        record.window(0.0, 1.2).with_channels({"x": (record["x"] + noise)[:1200]}),
    )
    parts = [balance_levels(replace(sound_study, held_out=(each,))) for each in (quiet, noisy)]
    both = replace(sound_study, held_out=(quiet, noisy))
    rows = np.array([data.used(both.axis).sum(axis=1) for data in both.smoothed[1]])
    for name in ("noise", "signal"):
        squares = [getattr(part, name) ** 2 for part in parts]
        pooled = np.sqrt(np.sum(rows * squares, axis=0) / rows.sum(axis=0))
        assert getattr(balance_levels(both), name) == pytest.approx(pooled)


def test_the_floor_of_the_force_has_a_mass_that_the_data_sheet_allows(sound_study):
    """A force that shakes the axis makes the start find less than half of the mass."""
    axis, sheet = sound_study.axis, sound_study.axis.bench.datasheet["M_kg"]
    right, shaken = (
        balance_levels(replace(sound_study, axis=axis.with_parameters({"M": share * sheet})))
        for share in (1.0, 0.4)
    )
    assert shaken.noise[-1] == pytest.approx(right.noise[-1], rel=0.06)
