"""The mass balances of both chambers (eq. 5, 6), fitted to a record by least squares."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.checks.metered_flow import MeteredFlow
from pneumo_casadi.data.checks.smoothed import SmoothedChamber, SmoothedRecord, least_squares
from pneumo_casadi.parameters import FloatArray

T = TypeVar("T")

DEAD_VOLUME = 0.1
"""Dead volume over S l, for the position: between a cushion and a hose of a metre."""
LEAST_PRESSURE = 1e3
"""Keeps a wrong offset from dividing by zero [Pa]."""
CRITICAL_RATIO = 0.3
"""Of a valve that was not metered: between a sharp edge (0.2) and a nozzle (0.53)."""
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
    _kept: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

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

    def area_gain(self, chamber: str, pressure_offset: float = 0.0) -> float:
        """Return the area by map and record over that of the bench, X_s3 r T / S_P.

        `pressure_offset` is added to the pressure [Pa].
        """
        coefficients, _ = self._fit(self.record.chambers[chamber], pressure_offset, None)
        return float(coefficients[0] / self._area(chamber))

    def dead_length(self, chamber: str) -> float:
        """Return the dead length of a metered chamber by map and record, X_s1/X_s2 - l/2 [m]."""
        coefficients, _ = self._fit(self.record.chambers[chamber], 0.0, None)
        _, volume, area = coefficients[:3]
        return float(volume / area) - self.bench.stroke / 2 if area > 0 else float("nan")

    def tolerant_area_gain(self, chamber: str) -> tuple[float, float]:
        """Return the same with a lag, a null shift and a dead zone of the valve, less precise.

        Also the dead zone over the standard deviation of the command.
        """
        side = self.record.chambers[chamber]
        coefficients, _ = self._fit_with(self._valve_faults(side), side, 0.0, None)
        spread = float(self.record.recording[f"u_{chamber}"].std())
        return float(coefficients[0] / self._area(chamber)), float(coefficients[-1]) / spread

    def _area(self, chamber: str) -> float:
        """Return X_s3 or X_s6 as the bench has it [kg/(s Pa m/s)]."""
        return float(getattr(self.bench, f"S_{chamber}") / (self.bench.r * self.bench.T))

    def _once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what was made before under a key: checks ask for the same fits again and again."""
        if key not in self._kept:
            self._kept[key] = make()
        kept: T = self._kept[key]
        return kept

    def _fit(
        self, chamber: SmoothedChamber, pressure_offset: float, position_offset: float | None
    ) -> tuple[FloatArray, float]:
        key = ("fit", chamber.name, pressure_offset, position_offset)
        return self._once(
            key, lambda: self._fit_with((), chamber, pressure_offset, position_offset)
        )

    def _metered_flow(self, chamber: SmoothedChamber, pressure_offset: float) -> FloatArray:
        flow = self.flows[chamber.name]
        return self._once(
            ("flow", chamber.name, pressure_offset),
            lambda: self.record.flow(flow, chamber.name, pressure_offset),
        )

    def _fit_with(
        self,
        further: Sequence[FloatArray],
        chamber: SmoothedChamber,
        pressure_offset: float,
        position_offset: float | None,
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
            y = self._metered_flow(chamber, pressure_offset)
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

    def _valve_faults(self, chamber: SmoothedChamber) -> list[FloatArray]:
        """Return what a small lag, null shift and dead zone would add to the metered flow."""
        metered = self.flows[chamber.name]
        step = SLOPE_STEP * float(np.abs(metered.u).max())

        def slope(u: FloatArray, p: FloatArray) -> FloatArray:
            return (metered(u + step, p) - metered(u - step, p)) / (2 * step)

        def dead_zone(u: FloatArray, p: FloatArray) -> FloatArray:
            return np.sign(u) * slope(u, p)

        flow = self._metered_flow(chamber, 0.0)
        slopes, dead_zones = (
            self.record.flow(function, chamber.name) for function in (slope, dead_zone)
        )
        return [np.gradient(flow, self.record.smooth.dt), slopes, dead_zones]


def _flow_function(ratio: FloatArray) -> FloatArray:
    """Return the flow over the choked one at a ratio of downstream to upstream pressure."""
    subsonic = np.clip((ratio - CRITICAL_RATIO) / (1 - CRITICAL_RATIO), 0.0, 1.0)
    return np.sqrt(1.0 - subsonic**2)
