"""The force balance with a free constant force: which area belongs to which pressure.

S_P p_P − S_N p_N = M ẍ + f_v ẋ + F_c sign ẋ + constant. The constant takes up ambient pressure,
weight and every other constant load, so that none of them passes for a swapped area.
"""

from collections.abc import Iterator

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.smoothed import SmoothedRecord, least_squares

SLOWEST = 0.02
"""Speed from which friction has its sign [m/s]."""
LESS = 1.3
"""Ratio of what two explanations leave from which the smaller one is taken. On 30 records with
hidden effects, pieces of 4 s included, the right areas left at most 1.2 times as much."""
SINGLE_ROD = 0.03
"""Difference of the areas, relative, below which a cylinder counts as double rod."""
FEWEST_BLOCKS = 50


def check_force_balance(record: SmoothedRecord, bench: Bench) -> Iterator[Finding]:
    """Yield a finding where the force balance holds better with the areas swapped."""
    if abs(bench.S_P / bench.S_N - 1) < SINGLE_ROD:
        return
    given, swapped = (_left(record, *areas) for areas in _both(bench))
    if given > LESS * swapped:
        yield Finding(
            Grade.SEVERE,
            "swapped areas",
            "S_P, S_N",
            f"`S_P` = {bench.S_P:g} m² and `S_N` = {bench.S_N:g} m² look swapped: the force "
            f"balance leaves {given:.3g} N with them and {swapped:.3g} N the other way round.",
            "bench.json",
            {"S_P_m2": bench.S_N, "S_N_m2": bench.S_P},
            record.recording.name,
        )


def effort_looks_gauge(record: SmoothedRecord, bench: Bench) -> bool:
    """Return whether the constant force of the record is the one that gauge pressures feign.

    With gauge pressures read as absolute ones, −(S_P − S_N) p_ext is left over (eq. 2).
    """
    feigned = -(bench.S_P - bench.S_N) * bench.p_ext
    fit = _fit(record, bench.S_P, bench.S_N)
    if fit is None or abs(bench.S_P / bench.S_N - 1) < SINGLE_ROD:
        return False
    constant = fit[0] + feigned
    return abs(constant - feigned) < abs(constant)


def _both(bench: Bench) -> tuple[tuple[float, float], tuple[float, float]]:
    return (bench.S_P, bench.S_N), (bench.S_N, bench.S_P)


def _left(record: SmoothedRecord, S_P: float, S_N: float) -> float:
    fit = _fit(record, S_P, S_N)
    return 0.0 if fit is None else fit[1]


def _fit(record: SmoothedRecord, S_P: float, S_N: float) -> tuple[float, float] | None:
    """Return the constant of S_P p_P − S_N p_N, and the standard deviation left [N]."""
    inner = record.inner
    moving = np.abs(record.v[inner]) > SLOWEST
    if int(moving.sum()) < FEWEST_BLOCKS:
        return None
    v, a = record.v[inner][moving], record.a[inner][moving]
    p_P, p_N = (record.chambers[name].p[inner][moving] for name in "PN")
    effort = S_P * p_P - S_N * p_N
    coefficients, share = least_squares([np.ones_like(v), a, v, np.sign(v)], effort)
    return float(coefficients[0]), float(np.sqrt(share * effort.var()))
