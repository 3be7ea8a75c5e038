"""Units in which a column of a file may be given, and their size in SI units.

The factors of pressures and lengths come from the table of mistaken units in
`pneumo_casadi.data.bench.quantities`. Error messages about the bench guess these units from an
implausible value, so that a unit which a message suggests is also one that the readers accept.
"""

from collections.abc import Mapping
from types import MappingProxyType

from pneumo_casadi.data.bench.load import GRAVITY
from pneumo_casadi.data.bench.quantities import LENGTHS, PRESSURES

SI_FACTORS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
        "V": {"V": 1.0, "mV": 1e-3},
        "Pa": {"Pa": 1.0, "hPa": 100.0} | {unit: scale for unit, (scale, _) in PRESSURES.items()},
        "m": {"m": 1.0, "um": 1e-6, "inch": 0.0254}
        | {unit: scale for unit, (scale, _) in LENGTHS.items()},
        "N": {"N": 1.0, "kN": 1e3},
        "m/s": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2},
        "m/s2": {"m/s2": 1.0, "mm/s2": 1e-3, "g": GRAVITY},
    }
)
"""SI unit of a channel -> other units of the same kind and the factor that converts them to SI."""
