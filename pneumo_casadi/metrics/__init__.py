"""Noise floor, gap and closure: the one definition of each."""

from pneumo_casadi.metrics.gap import (
    closure,
    closure_interval,
    combined_gap,
    gap,
    resampling_weights,
)
from pneumo_casadi.metrics.noise_floor import (
    RowGains,
    balance_noise,
    exact_row_gains,
    output_noise,
    sampled_row_gains,
    signal_std,
)

__all__ = [
    "RowGains",
    "balance_noise",
    "closure",
    "closure_interval",
    "combined_gap",
    "exact_row_gains",
    "gap",
    "output_noise",
    "resampling_weights",
    "sampled_row_gains",
    "signal_std",
]
