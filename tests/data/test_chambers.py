"""Which chamber is which is asked only of records that can tell."""

import numpy as np

import pneumo_casadi as pc
from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.data.checks.chambers import (
    CLEAR,
    OWN,
    chamber_correlations,
    check_chambers,
    own_scatter,
)
from pneumo_casadi.data.checks.smoothed import smoothed_record
from pneumo_casadi.data.readers.column_entries import ColumnEntries

EXPECTED = np.array([[1, -1], [1, 1]])


def on_a_sine(lag, harmonic):
    """Return a record at 2 Hz, where pressures have a small harmonic besides."""
    t, w = np.arange(1500) / 1000.0, 2 * np.pi * 2.0
    u = 0.4 * np.cos(w * t + lag)
    dp = 1.2e5 * np.sin(w * t + 0.3) + harmonic * np.sin(2 * w * t + 1.0)
    channels = {"u_P": u, "u_N": -u, "p_P": 4e5 + dp, "p_N": 4e5 - dp, "x": 0.08 * np.sin(w * t)}
    return smoothed_record(Recording(t, channels, "sine", "made", InputHold.ZERO))


def test_a_sine_accuses_nobody_however_clear_its_correlations_seem():
    accused = 0
    for lag in (-0.3, 0.0, 0.3, 0.6):
        for harmonic in (-8e3, 8e3):
            record = on_a_sine(lag, harmonic)
            signs = chamber_correlations(record)
            accused += np.abs(signs).min() >= CLEAR and bool((signs * EXPECTED < 0).any())
            names = [finding.name for finding in check_chambers(record, ColumnEntries())]
            assert names == ["chambers not told apart"]
    assert accused >= 4


def test_varied_records_leave_each_signal_most_of_its_scatter():
    record = pc.example_case().identify[0]
    assert own_scatter(smoothed_record(record)).min() > 1.5 * OWN
