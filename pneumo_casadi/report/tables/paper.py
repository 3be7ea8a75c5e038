"""Table 1 of the paper: what its authors identified on their bench."""

from collections.abc import Mapping
from types import MappingProxyType

#: Parameter: (estimate, 2 sigma), in SI units.
TABLE_1: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "X_s1": (3.49e-9, 8.62e-12),
        "X_s2": (9.95e-9, 6.41e-11),
        "X_s3": (1.04e-8, 2.74e-11),
        "X_s4": (1.78e-9, 2.74e-11),
        "X_s5": (7.00e-9, 2.89e-10),
        "X_s6": (7.17e-9, 8.30e-11),
        "M": (16.9, 7.40e-2),
        "f_v": (11.0, 0.875),
        "F_c_plus": (10.3, 0.480),
        "F_c_minus": (23.8, 0.455),
    }
)
