"""How estimates move with the flow map: its form, its metering, and how far it is trusted."""

from pneumo_casadi.sensitivity.first_order import MapSensitivity, map_sensitivity
from pneumo_casadi.sensitivity.metering import MeteringErrors
from pneumo_casadi.sensitivity.study import FlowSensitivity, flow_sensitivity
from pneumo_casadi.sensitivity.variants import Estimate, Row, Treatment, Variant

__all__ = [
    "Estimate",
    "FlowSensitivity",
    "MapSensitivity",
    "MeteringErrors",
    "Row",
    "Treatment",
    "Variant",
    "flow_sensitivity",
    "map_sensitivity",
]
