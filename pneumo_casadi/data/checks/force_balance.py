"""The force balance with a free constant force: which area belongs to which pressure.

S_P p_P − S_N p_N = M ẍ + f_v ẋ + F_c sign ẋ + constant. The constant takes up ambient pressure,
weight and every other constant load, so that none of them passes for a swapped area.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import AnyBench, ForceBench, PressureBench
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.smoothed import SmoothedRecord, least_squares
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.parameters import FloatArray

SLOWEST = 0.02
"""Speed from which friction has its sign [m/s]."""
LESS = 1.3
"""Ratio of what two explanations leave from which the smaller one is taken. On 30 records with
hidden effects, pieces of 4 s included, the right areas left at most 1.2 times as much."""
CLEAR = 0.5
"""Negative friction over what the balance leaves, from which it is no misfit."""
SINGLE_ROD = 0.03
"""Difference of the areas, relative, below which a cylinder counts as double rod."""
FEWEST_BLOCKS = 50
OTHER_MASS = 5.0
"""Ratio of the mass that the force balance gives to that of the data sheet, either way, from which
one of them is wrong. Of 70 axes with hidden effects it was 0.5 to 1.1."""


def check_force_balance(
    record: SmoothedRecord, bench: Bench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield where the force balance holds better with the areas swapped, or with another mass."""
    yield from check_measured_force(record, bench, entries)
    drive = _pressure_force(record, bench.S_P, bench.S_N)
    fit = _fit(record, drive)
    if fit is None:
        return
    yield from _other_mass(record, bench, drive, fit)
    if abs(bench.S_P / bench.S_N - 1) < SINGLE_ROD:
        return
    given, swapped = fit.left, _left(record, _pressure_force(record, bench.S_N, bench.S_P))
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


def check_driven_mass(
    record: SmoothedRecord, bench: PressureBench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield what the force balance alone says of an axis that is driven by measured pressures."""
    yield from check_measured_force(record, bench, entries)
    drive = _pressure_force(record, bench.S_P, bench.S_N)
    fit = _fit(record, drive)
    if fit is None:
        return
    yield from _other_mass(record, bench, drive, fit)
    source = record.recording.name
    if fit.friction < -CLEAR * fit.left and fit.M < 0:
        yield Finding(
            Grade.SEVERE,
            "swapped chambers",
            "p_P, p_N, F_load",
            f"the force balance gives a friction of {fit.friction:.3g} N and a mass of {fit.M:.3g} "
            "kg: are `p_P_Pa` and `p_N_Pa` swapped, does `x_m` count the wrong way, or has "
            "`F_load_N` the other sign?",
            source=source,
        )
    elif effort_looks_gauge(record, bench):
        p_ext, feigned = bench.p_ext, -(bench.S_P - bench.S_N) * bench.p_ext
        yield Finding(
            Grade.CAUTION,
            "gauge pressures",
            "p_P, p_N",
            f"a constant force of about {feigned:.3g} N is left over, as gauge pressures leave it; "
            "give absolute pressures, or state the load in bench.json.",
            "columns.json",
            {
                channel: entry
                for name in record.chambers
                for channel, entry in entries.corrected(f"p_{name}", offset=p_ext).items()
            },
            source,
        )


def check_measured_force(
    record: SmoothedRecord, bench: AnyBench, entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield a finding where the force balance holds better with a measured force turned round."""
    if "F_load" not in record.recording:
        return
    if isinstance(bench, ForceBench):
        drive = record.smooth(record.recording["F"])
    else:
        drive = _pressure_force(record, bench.S_P, bench.S_N)
    given, turned = (_left(record, drive, sign) for sign in (1.0, -1.0))
    if given > LESS * turned:
        yield Finding(
            Grade.SEVERE,
            "sign of the force",
            "F_load",
            f"`F_load` has the other sign: the force balance leaves {given:.3g} N with it and "
            f"{turned:.3g} N with its negative; it counts as a force on the mass in +x.",
            "columns.json",
            entries.corrected("F_load", factor=-1.0),
            record.recording.name,
        )


def _other_mass(
    record: SmoothedRecord, bench: Bench | PressureBench, drive: FloatArray, fit: "_Fit"
) -> Iterator[Finding]:
    """Yield a finding where the record shows quite another mass than the data sheet states."""
    stated = bench.datasheet.get("M_kg")
    if not stated or fit.M <= 0 or 1 / OTHER_MASS < fit.M / stated < OTHER_MASS:
        return
    without = _fit(record, drive, mass=False)
    if without is None or without.left <= LESS * fit.left:
        return  # the mass does not show
    yield Finding(
        Grade.SEVERE,
        "mass",
        "M_kg",
        f"`datasheet.M_kg` = {stated:g} kg, the force balance gives {fit.M:.3g} kg: is it in kg "
        "and of all that moves, are `x_m` in m, the pressures in Pa and the areas in m²? Weigh "
        "it, or leave it out of bench.json.",
        source=record.recording.name,
    )


def effort_looks_gauge(
    record: SmoothedRecord, bench: Bench | PressureBench, chambers: str = "PN"
) -> bool:
    """Return whether the constant force of the record is the one that gauge pressures feign.

    With gauge pressures of some `chambers` read as absolute ones, −(S_P − S_N) p_ext is left over
    (eq. 2), or the share of these chambers. The load that the bench states is allowed for.
    """
    areas = {"P": bench.S_P, "N": -bench.S_N}
    feigned = -sum(areas[chamber] for chamber in chambers) * bench.p_ext
    fit = _fit(record, _pressure_force(record, bench.S_P, bench.S_N))
    if fit is None or abs(feigned) < SINGLE_ROD * bench.S_P * bench.p_ext:
        return False
    ambient = sum(areas.values()) * bench.p_ext
    constant = fit.constant - ambient + bench.load.force + fit.M * bench.load.acceleration
    return abs(constant - feigned) < abs(constant)


def _pressure_force(record: SmoothedRecord, S_P: float, S_N: float) -> FloatArray:
    """Return S_P p_P − S_N p_N [N]."""
    areas = {"P": S_P, "N": -S_N}
    force: FloatArray = np.sum([areas[n] * c.p for n, c in record.chambers.items()], axis=0)
    return force


def _left(record: SmoothedRecord, drive: FloatArray, force_sign: float = 1.0) -> float:
    fit = _fit(record, drive, force_sign)
    return 0.0 if fit is None else fit.left


@dataclass(frozen=True, slots=True)
class _Fit:
    """Coefficients of the force balance: constant [N], mass [kg], friction [N]; what is left [N].

    The friction is that at the mean speed of the moving time.
    """

    constant: float
    M: float
    friction: float
    left: float


def _fit(
    record: SmoothedRecord, drive: FloatArray, force_sign: float = 1.0, mass: bool = True
) -> _Fit | None:
    inner = record.inner
    moving = np.abs(record.v[inner]) > SLOWEST
    if int(moving.sum()) < FEWEST_BLOCKS:
        return None
    v, a = record.v[inner][moving], record.a[inner][moving]
    effort = drive[inner][moving]
    if "F_load" in record.recording:
        measured = record.smooth(record.recording["F_load"])[inner][moving]
        effort = effort + force_sign * measured
    columns = [np.ones_like(v), v, np.sign(v), *([a] if mass else [])]
    (constant, f_v, F_c, *M), share = least_squares(columns, effort)
    friction = F_c + f_v * float(np.abs(v).mean())
    left = float(np.sqrt(share * effort.var()))
    return _Fit(float(constant), float(M[0]) if mass else 0.0, float(friction), left)
