"""The mass balances of both chambers (eq. 5, 6), with the pressures or the position read otherwise.

Each balance is fitted by least squares to the record as it is read, and once more as it would be
read without a common mistake: one ambient pressure added to gauge pressures, half the stroke taken
from a position that counts from one end. Loads do not enter these balances. The mistakes are whole
steps, far beyond what leaks, lags or friction do; the explanation that leaves less is right.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.checks.column_entries import ColumnEntries
from pneumo_casadi.data.checks.finding import Finding, Grade
from pneumo_casadi.data.checks.force_balance import effort_looks_gauge
from pneumo_casadi.data.checks.metered_flow import MeteredFlow
from pneumo_casadi.data.checks.smoothed import SmoothedChamber, SmoothedRecord, least_squares
from pneumo_casadi.parameters import FloatArray

DEAD_VOLUME = 0.1
"""Dead volume over S l, for the position: between a cushion and a hose of a metre."""
LEAST_PRESSURE = 1e3
"""Keeps a wrong offset from dividing by zero [Pa]."""
CRITICAL_RATIO = 0.3
"""Of a valve that was not metered: between a sharp edge (0.2) and a nozzle (0.53)."""
LESS = 1.15
"""Ratio of what two explanations leave from which the smaller one is taken. On 30 records with
hidden leaks, lags, hoses and dead zones, rightly read, the wrong explanation never left less than
0.99 times as much."""
SMALLEST_TRAVEL = 0.02
"""Share of the stroke: a record with less motion says nothing about volumes."""
MUCH_LESS = 2.0
"""The same where the valve was not metered and the force balance says nothing: a valve whose flow
is not that of ISO 6358 has left 1.4 times as much with the right pressures."""
GAIN_CAUTION, GAIN_SEVERE = 0.10, 0.30
"""Deviation of the areas that map and record give from those of the bench. Dead zones, leaks and
lags of the pressures shift them by up to 16 % in the records named above, so that only more is
certain."""
RATIO_CAUTION, RATIO_SEVERE = 0.10, 0.25
"""Deviation of the ratio of the areas. Both chambers share the motion and mostly the faults of the
valves: hidden effects shift the ratio by up to 6 % there, two unequal valves by up to 15 %."""
SLOPE_STEP = 0.02
"""Step of the command for the slope of the map, over its largest command."""


@dataclass(frozen=True, slots=True)
class MassBalances:
    """Both balances of one record.

    Parameters
    ----------
    record : SmoothedRecord
        The record.
    bench : Bench
        Its bench.
    flows : mapping of str to MeteredFlow
        Metered flow by chamber; empty where the valve was not metered.
    """

    record: SmoothedRecord
    bench: Bench
    flows: Mapping[str, MeteredFlow]

    @property
    def metered(self) -> bool:
        """Whether the valves of both chambers were metered."""
        return {"P", "N"} <= self.flows.keys()

    def left(
        self, pressure_offset: float = 0.0, position_offset: float | None = None
    ) -> tuple[float, float]:
        """Return the shares of both balances that no parameter explains.

        Parameters
        ----------
        pressure_offset : float, optional
            Added to both pressures [Pa].
        position_offset : float, optional
            Added to the position [m]; by default the volumes are free, and with them the position.
        """
        left_P, left_N = (
            self._fit(chamber, pressure_offset, position_offset)[1]
            for chamber in self.record.chambers.values()
        )
        return left_P, left_N

    def area_gains(self, chamber: str, pressure_offset: float = 0.0) -> tuple[float, float]:
        """Return the area by map and record over that of the bench, X_s3 r T / S_P, in two ways.

        The second allows the valve a lag, a null shift and a dead zone, at the cost of precision.
        `pressure_offset` is added to the pressure [Pa].
        """
        area = getattr(self.bench, f"S_{chamber}") / (self.bench.r * self.bench.T)
        side = self.record.chambers[chamber]
        fits = (
            self._fit(side, pressure_offset, None),
            self._fit(side, pressure_offset, None, self._valve_faults(side, pressure_offset)),
        )
        plain, tolerant = (float(coefficients[0] / area) for coefficients, _ in fits)
        return plain, tolerant

    def _fit(
        self,
        chamber: SmoothedChamber,
        pressure_offset: float,
        position_offset: float | None,
        further: Sequence[FloatArray] = (),
    ) -> tuple[FloatArray, float]:
        record, inner = self.record, self.record.inner
        x = chamber.sign * record.x
        swept = chamber.sign * record.v * (chamber.p + pressure_offset)
        if position_offset is None:
            volume = [chamber.p_rate, x * chamber.p_rate]
        else:
            length = (0.5 + DEAD_VOLUME) * self.bench.stroke
            volume = [(length + x + chamber.sign * position_offset) * chamber.p_rate]
        if chamber.name in self.flows:
            y = record.flow(self.flows[chamber.name], chamber.name, pressure_offset)
            columns = [swept, *volume, *further]
        else:
            y, columns = swept, [*volume, *self._orifices(chamber, pressure_offset)]
        return least_squares([column[inner] for column in columns], y[inner])

    def _orifices(self, chamber: SmoothedChamber, pressure_offset: float) -> list[FloatArray]:
        """Return flows of ISO 6358 for openings that go with 1, |u|, u² and |u|³, per direction."""
        p_supply, p_ext = self.bench.p_supply, self.bench.p_ext

        def flow(u: FloatArray, p: FloatArray, direction: int, power: int) -> FloatArray:
            p = np.maximum(p, LEAST_PRESSURE)
            opening = np.maximum(direction * u, 0.0) ** power if power else np.ones_like(u)
            if direction > 0:
                return opening * p_supply * _flow_function(p / p_supply)
            return opening * p * _flow_function(p_ext / p)

        return [
            self.record.flow(partial(flow, direction=d, power=n), chamber.name, pressure_offset)
            for d in (1, -1)
            for n in range(4)
        ]

    def _valve_faults(self, chamber: SmoothedChamber, pressure_offset: float) -> list[FloatArray]:
        """Return what a small lag, null shift and dead zone would add to the metered flow."""
        metered = self.flows[chamber.name]
        step = SLOPE_STEP * float(np.abs(metered.u).max())

        def slope(u: FloatArray, p: FloatArray) -> FloatArray:
            return (metered(u + step, p) - metered(u - step, p)) / (2 * step)

        def dead_zone(u: FloatArray, p: FloatArray) -> FloatArray:
            return np.sign(u) * slope(u, p)

        flow, slopes, dead_zones = (
            self.record.flow(function, chamber.name, pressure_offset)
            for function in (metered, slope, dead_zone)
        )
        return [np.gradient(flow, self.record.smooth.dt), slopes, dead_zones]


def _flow_function(ratio: FloatArray) -> FloatArray:
    """Return the flow over the choked one at a ratio of downstream to upstream pressure."""
    subsonic = np.clip((ratio - CRITICAL_RATIO) / (1 - CRITICAL_RATIO), 0.0, 1.0)
    return np.sqrt(1.0 - subsonic**2)


def check_mass_balances(
    record: SmoothedRecord, bench: Bench, flows: Mapping[str, MeteredFlow], entries: ColumnEntries
) -> Iterator[Finding]:
    """Yield what the mass balances say of gauge pressures, the zero of x, the map and the areas."""
    if float(np.ptp(record.x)) < SMALLEST_TRAVEL * bench.stroke:
        return
    balances = MassBalances(record, bench, flows)
    mistakes = [*_gauge_pressures(balances, entries), *_position_from_end(balances, entries)]
    yield from mistakes
    if not mistakes and balances.metered:
        yield from _areas(balances)


def _gauge_pressures(balances: MassBalances, entries: ColumnEntries) -> Iterator[Finding]:
    p_ext = balances.bench.p_ext
    as_read, absolute = balances.left(), balances.left(pressure_offset=p_ext)
    better = _times_less(absolute, as_read)
    if better <= LESS:
        return
    measured = (
        f"with the ambient pressure {p_ext:g} Pa added the mass balances leave "
        f"{_percent(absolute)} of their variance unexplained, as read {_percent(as_read)}"
    )
    grade: Grade | None = Grade.SEVERE
    if balances.metered:
        gains, gains_absolute = (
            [balances.area_gains(name, offset)[0] for name in "PN"] for offset in (0.0, p_ext)
        )
        if _distance(*gains_absolute) > _distance(*gains):
            # The areas fit worse for it: the shape of the map is wrong, not the pressures.
            yield _map_or_gauge(balances, measured, gains_absolute)
            return
    elif not effort_looks_gauge(balances.record, balances.bench):
        grade = Grade.CAUTION if better > MUCH_LESS else None
    if grade is not None:
        yield Finding(
            grade,
            "gauge pressures",
            "p_P, p_N",
            f"`p_P` and `p_N` look like gauge pressures: {measured}; give absolute pressures.",
            "columns.json",
            entries.corrected("p_P", offset=p_ext) | entries.corrected("p_N", offset=p_ext),
            balances.record.recording.name,
        )


def _map_or_gauge(balances: MassBalances, measured: str, gains: Sequence[float]) -> Finding:
    return Finding(
        Grade.SEVERE,
        "map of another valve",
        "flow_map",
        f"{_map_names(balances)}: the map of another valve, or gauge pressures: {measured}, but "
        f"then the record needs {gains[0]:.2f} times the area S_P and {gains[1]:.2f} times S_N.",
        source=balances.record.recording.name,
    )


def _position_from_end(balances: MassBalances, entries: ColumnEntries) -> Iterator[Finding]:
    bench, x = balances.bench, balances.record.recording["x"]
    lower, upper = bench.stroke_limits
    as_read = balances.left(position_offset=0.0)
    for offset, end in ((-bench.stroke / 2, "P"), (bench.stroke / 2, "N")):
        if x.min() + offset < 1.01 * lower or x.max() + offset > 1.01 * upper:
            continue
        shifted = balances.left(position_offset=offset)
        if _times_less(shifted, as_read) > LESS:
            moved = [channel for channel in ("x", "x_ref") if channel in balances.record.recording]
            suggestion: dict[str, object] = {}
            for channel in moved:
                suggestion |= entries.corrected(channel, offset=offset)
            yield Finding(
                Grade.SEVERE,
                "position from the end",
                ", ".join(moved),
                f"`x` counts from the end of the stroke at which chamber {end} is closed: with "
                f"{offset:+g} m the mass balances leave {_percent(shifted)} of their variance "
                f"unexplained, as read {_percent(as_read)}; x = 0 is mid-stroke.",
                "columns.json",
                suggestion,
                balances.record.recording.name,
            )


def _times_less(explained: tuple[float, float], as_read: tuple[float, float]) -> float:
    """Return how many times less an explanation leaves; 0 unless it helps both chambers.

    What concerns one chamber alone, a leak for example, is no mistake in reading both.
    """
    helps = all(after < before for after, before in zip(explained, as_read, strict=True))
    return sum(as_read) / max(sum(explained), 1e-300) if helps else 0.0


def _percent(shares: tuple[float, float]) -> str:
    return f"{100 * sum(shares) / 2:.2g} %"


def _areas(balances: MassBalances) -> Iterator[Finding]:
    bench, source = balances.bench, balances.record.recording.name
    (P_plain, P_tolerant), (N_plain, N_tolerant) = (balances.area_gains(name) for name in "PN")
    swapped = 2 * float(np.log(bench.S_N / bench.S_P))
    # Each way of estimating is misled by other faults: that nearer to the bench decides.
    gain_P, gain_N = min(
        ((P_plain, N_plain), (P_tolerant, N_tolerant)), key=lambda pair: _distance(*pair)
    )
    if min(gain_P, gain_N) <= 0:
        yield _other_valve(balances, gain_P, gain_N, Grade.SEVERE)
        return
    ratio = float(np.log(gain_P / gain_N))
    if abs(swapped) > RATIO_CAUTION and abs(ratio - swapped) < abs(ratio) / 2:
        yield Finding(
            Grade.SEVERE,
            "swapped areas",
            "S_P, S_N",
            f"`S_P` = {bench.S_P:g} m² and `S_N` = {bench.S_N:g} m² look swapped: flow map and "
            f"record give {gain_P:.2f} times the one and {gain_N:.2f} times the other.",
            "bench.json",
            {"S_P_m2": bench.S_N, "S_N_m2": bench.S_P},
            source,
        )
    elif abs(ratio) > RATIO_CAUTION:
        measured = gain_P * bench.S_P / (gain_N * bench.S_N)
        yield Finding(
            Grade.SEVERE if abs(ratio) > RATIO_SEVERE else Grade.CAUTION,
            "ratio of the areas",
            "S_P, S_N",
            f"Flow map and record give S_P/S_N = {measured:.3g}, the bench "
            f"{bench.S_P / bench.S_N:.3g}; check the diameters of piston and rod (a double rod has "
            "equal areas), or whether the two valves are alike.",
            source=source,
        )
    else:
        gain = abs(float(np.log(gain_P * gain_N))) / 2
        if gain > np.log(1 + GAIN_CAUTION):
            grade = Grade.SEVERE if gain > np.log(1 + GAIN_SEVERE) else Grade.CAUTION
            yield _other_valve(balances, gain_P, gain_N, grade)


def _distance(gain_P: float, gain_N: float) -> float:
    """Return how far two ratios of areas are from 1, in logarithms."""
    least = min(gain_P, gain_N)
    return abs(float(np.log(gain_P))) + abs(float(np.log(gain_N))) if least > 0 else float("inf")


def _other_valve(balances: MassBalances, gain_P: float, gain_N: float, grade: Grade) -> Finding:
    doubt = "" if grade is Grade.SEVERE else " A dead zone or a leak of the valve does this too."
    return Finding(
        grade,
        "map of another valve",
        "flow_map",
        f"{_map_names(balances)}: is it the map of this valve, at this supply pressure, in kg/s "
        f"(reference of the flow meter)? With its flow the record needs {gain_P:.2f} times the "
        f"area S_P and {gain_N:.2f} times S_N.{doubt}",
        source=balances.record.recording.name,
    )


def _map_names(balances: MassBalances) -> str:
    return " and ".join(sorted({flow.path.name for flow in balances.flows.values()}))
