"""Errors with which a flow map may have been metered."""

from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve import FlowMap


@dataclass(frozen=True, slots=True)
class MeteringErrors:
    """Errors put on a flow map; none by default.

    Parameters
    ----------
    gain : float
        Relative error of all flows [1]: 0.01 meters 1 % too much.
    gain_filling, gain_exhaust : float
        Relative error of the flows into the chamber, and of those out of it [1]; an instrument
        for each direction may err differently.
    noise : float
        Standard deviation of one flow as a share of the largest [1].
    pressure_offset : float
        Error of the pressure transducer at the outlet [Pa].
    seed : int
        Of the noise.

    Raises
    ------
    ModelError
        If a gain would turn a flow round or noise is negative.

    Examples
    --------
    >>> table = FlowMap([-1, 1, 1], [4e5, 4e5, 5e5], [-4e-3, 4e-3, 3e-3])
    >>> MeteringErrors(gain_filling=0.01).of(table).q_m.tolist()
    [-0.004, 0.00404, 0.00303]
    """

    gain: float = 0.0
    gain_filling: float = 0.0
    gain_exhaust: float = 0.0
    noise: float = 0.0
    pressure_offset: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.gain, self.gain_filling, self.gain_exhaust) <= -1 or self.noise < 0:
            raise ModelError(
                f"{self}: gain errors are shares above -1 (0.01 is 1 %), noise is not negative"
            )

    def flow_error(self, table: FlowMap) -> FloatArray:
        """Return metered minus given flow at the points of a table [kg/s], shape (n,)."""
        q = table.q_m
        one_way = np.where(q > 0, self.gain_filling, self.gain_exhaust)
        drawn = np.random.default_rng(self.seed).normal(size=table.n)
        systematic: FloatArray = q * ((1 + self.gain) * (1 + one_way) - 1)
        return systematic + self.noise * table.q_max * drawn

    def of(self, table: FlowMap) -> FlowMap:
        """Return the table as it would have been metered."""
        return replace(
            table, q_m=table.q_m + self.flow_error(table), p=table.p + self.pressure_offset
        )

    def __str__(self) -> str:
        parts = [
            (self.gain, f"gain {100 * self.gain:+g} %"),
            (self.gain_filling, f"filling {100 * self.gain_filling:+g} %"),
            (self.gain_exhaust, f"exhaust {100 * self.gain_exhaust:+g} %"),
            (self.noise, f"noise {100 * self.noise:g} % (seed {self.seed})"),
            (self.pressure_offset, f"pressure {self.pressure_offset:+g} Pa"),
        ]
        return ", ".join(text for value, text in parts if value) or "as metered"
