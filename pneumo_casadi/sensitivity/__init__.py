"""How estimates move with the flow map: its form, its metering, and how far it is trusted."""

from pneumo_casadi.sensitivity.first_order import MapSensitivity, map_sensitivity
from pneumo_casadi.sensitivity.metering import Metering
from pneumo_casadi.sensitivity.study import FlowSensitivity, flow_sensitivity
from pneumo_casadi.sensitivity.variants import Estimated, Row, Treatment, Variant

__all__ = [
    "Estimated",
    "FlowSensitivity",
    "MapSensitivity",
    "Metering",
    "Row",
    "Treatment",
    "Variant",
    "flow_sensitivity",
    "map_sensitivity",
]
