"""Filtering ahead of weighted least squares (section 4.2 of the paper)."""

from pneumo_casadi.signals.bandwidth import power_bandwidth, white_noise_std
from pneumo_casadi.signals.decimation import (
    Decimation,
    decimated_rows,
    parallel_decimate,
    passband_edge,
)
from pneumo_casadi.signals.filter_plan import FilterPlan, SamplingWarning, plan_filters
from pneumo_casadi.signals.filtered_recording import (
    FilteredRecording,
    InputPairing,
    filter_recording,
    plan_filters_for,
)
from pneumo_casadi.signals.zero_phase import (
    Distortion,
    amplitude_distortion,
    central_difference,
    least_cutoff,
    noise_gains,
    settling_samples,
    smooth_difference,
    zero_phase_lowpass,
)

__all__ = [
    "Decimation",
    "Distortion",
    "FilterPlan",
    "FilteredRecording",
    "InputPairing",
    "SamplingWarning",
    "amplitude_distortion",
    "central_difference",
    "decimated_rows",
    "filter_recording",
    "least_cutoff",
    "noise_gains",
    "parallel_decimate",
    "passband_edge",
    "plan_filters",
    "plan_filters_for",
    "power_bandwidth",
    "settling_samples",
    "smooth_difference",
    "white_noise_std",
    "zero_phase_lowpass",
]
