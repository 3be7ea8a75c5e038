"""The catalogue of effects: one file an effect or family, one line here each.

An import below is an entry of the catalogue.
"""

from collections.abc import Collection

from pneumo_casadi.effects.air.exhaust_restriction import ExhaustRestriction as ExhaustRestriction
from pneumo_casadi.effects.air.heat_transfer import HeatTransfer as HeatTransfer
from pneumo_casadi.effects.air.heat_transfer import (
    HeatTransferForced as HeatTransferForced,
)
from pneumo_casadi.effects.air.hose import Hose as Hose
from pneumo_casadi.effects.air.hose import HosePerChamber as HosePerChamber
from pneumo_casadi.effects.air.hose_sensor_at_valve import (
    HoseSensorAtValve as HoseSensorAtValve,
)
from pneumo_casadi.effects.air.hose_travel_time import HoseTravelTime as HoseTravelTime
from pneumo_casadi.effects.air.hose_travel_time import (
    HoseTravelTimePerChamber as HoseTravelTimePerChamber,
)
from pneumo_casadi.effects.air.hose_volume import HoseVolume as HoseVolume
from pneumo_casadi.effects.air.hose_volume import (
    HoseVolumePerChamber as HoseVolumePerChamber,
)
from pneumo_casadi.effects.air.leakage import LeakageN as LeakageN
from pneumo_casadi.effects.air.leakage import LeakageP as LeakageP
from pneumo_casadi.effects.air.leakage import PistonSealLeakage as PistonSealLeakage
from pneumo_casadi.effects.air.leakage import (
    PistonSealLeakagePerDirection as PistonSealLeakagePerDirection,
)
from pneumo_casadi.effects.air.leakage import PistonSealLeakageScored as PistonSealLeakageScored
from pneumo_casadi.effects.air.supply_droop import SupplyDroop as SupplyDroop
from pneumo_casadi.effects.air.supply_droop_proportional import (
    SupplyDroopProportional as SupplyDroopProportional,
)
from pneumo_casadi.effects.drive.drive import DriveLag as DriveLag
from pneumo_casadi.effects.drive.drive import GainError as GainError
from pneumo_casadi.effects.friction.asymmetric_viscous_friction import (
    AsymmetricViscousFriction as AsymmetricViscousFriction,
)
from pneumo_casadi.effects.friction.position_friction import PositionFriction as PositionFriction
from pneumo_casadi.effects.friction.position_friction_curve import (
    PositionFrictionCurve as PositionFrictionCurve,
)
from pneumo_casadi.effects.friction.position_friction_step import (
    PositionFrictionStep as PositionFrictionStep,
)
from pneumo_casadi.effects.friction.presliding import Presliding as Presliding
from pneumo_casadi.effects.friction.presliding_dahl import PreslidingDahl as PreslidingDahl
from pneumo_casadi.effects.friction.presliding_maxwell import (
    PreslidingMaxwell as PreslidingMaxwell,
)
from pneumo_casadi.effects.friction.pressure_friction import PressureFriction as PressureFriction
from pneumo_casadi.effects.friction.pressure_friction_per_seal import (
    PressureFrictionPerSeal as PressureFrictionPerSeal,
)
from pneumo_casadi.effects.friction.quadratic_drag import QuadraticDrag as QuadraticDrag
from pneumo_casadi.effects.friction.quadratic_drag import (
    QuadraticDragPerDirection as QuadraticDragPerDirection,
)
from pneumo_casadi.effects.friction.stribeck import Stribeck as Stribeck
from pneumo_casadi.effects.friction.stribeck_film import StribeckFilm as StribeckFilm
from pneumo_casadi.effects.friction.stribeck_rational import StribeckRational as StribeckRational
from pneumo_casadi.effects.load.backlash_before_load import (
    BacklashBeforeLoad as BacklashBeforeLoad,
)
from pneumo_casadi.effects.load.constant_force import ConstantForce as ConstantForce
from pneumo_casadi.effects.load.elastic_load import ElasticLoad as ElasticLoad
from pneumo_casadi.effects.load.elastic_load import (
    ElasticLoadProgressive as ElasticLoadProgressive,
)
from pneumo_casadi.effects.load.position_on_elastic_load import (
    PositionOnElasticLoad as PositionOnElasticLoad,
)
from pneumo_casadi.effects.load.position_on_elastic_load import (
    PositionOnGuidedLoad as PositionOnGuidedLoad,
)
from pneumo_casadi.effects.load.position_on_elastic_load import (
    PositionOnLoadWithPlay as PositionOnLoadWithPlay,
)
from pneumo_casadi.effects.load.position_on_elastic_load import (
    PositionOnProgressiveLoad as PositionOnProgressiveLoad,
)
from pneumo_casadi.effects.load.spring_load import SpringLoad as SpringLoad
from pneumo_casadi.effects.load.spring_load import SpringLoadProgressive as SpringLoadProgressive
from pneumo_casadi.effects.load.spring_load import SpringLoadTwoSided as SpringLoadTwoSided
from pneumo_casadi.effects.sensors.backlash import Backlash as Backlash
from pneumo_casadi.effects.sensors.position_delay import PositionDelay as PositionDelay
from pneumo_casadi.effects.sensors.pressure_sensor_second_order import (
    PressureSensorSecondOrder as PressureSensorSecondOrder,
)
from pneumo_casadi.effects.sensors.pressure_sensors import PressureSensorBias as PressureSensorBias
from pneumo_casadi.effects.sensors.pressure_sensors import PressureSensorLag as PressureSensorLag
from pneumo_casadi.effects.sensors.pressure_sensors import (
    PressureSensorLagPerSensor as PressureSensorLagPerSensor,
)
from pneumo_casadi.effects.table import EffectRow as EffectRow
from pneumo_casadi.effects.table import effect_row as effect_row
from pneumo_casadi.effects.valve.flow_map_shape import FlowMapShape as FlowMapShape
from pneumo_casadi.effects.valve.flow_map_shape_fittings import (
    FlowMapShapeFittings as FlowMapShapeFittings,
)
from pneumo_casadi.effects.valve.valve_dead_time import ValveDeadTime as ValveDeadTime
from pneumo_casadi.effects.valve.valve_dead_zone import ValveDeadZone as ValveDeadZone
from pneumo_casadi.effects.valve.valve_dead_zone import (
    ValveDeadZonePerEdge as ValveDeadZonePerEdge,
)
from pneumo_casadi.effects.valve.valve_dead_zone_edges import (
    ValveDeadZoneEdges as ValveDeadZoneEdges,
)
from pneumo_casadi.effects.valve.valve_dynamics import ValveDynamics as ValveDynamics
from pneumo_casadi.effects.valve.valve_dynamics import (
    ValveDynamicsLimited as ValveDynamicsLimited,
)
from pneumo_casadi.effects.valve.valve_dynamics import (
    ValveDynamicsPerValve as ValveDynamicsPerValve,
)
from pneumo_casadi.effects.valve.valve_hysteresis import ValveHysteresis as ValveHysteresis
from pneumo_casadi.effects.valve.valve_hysteresis import (
    ValveHysteresisPerValve as ValveHysteresisPerValve,
)
from pneumo_casadi.effects.valve.valve_mismatch import ValveMismatch as ValveMismatch
from pneumo_casadi.effects.valve.valve_mismatch_edges import (
    ValveMismatchEdges as ValveMismatchEdges,
)
from pneumo_casadi.effects.valve.valve_null_shift import ValveNullShift as ValveNullShift
from pneumo_casadi.effects.valve.valve_null_shift_warming import (
    ValveNullShiftWarming as ValveNullShiftWarming,
)
from pneumo_casadi.effects.valve.valve_stiction import ValveStiction as ValveStiction
from pneumo_casadi.model.effect import Effect

#: All effects, by name. Models and results list effects in this order, that of the files' names
#: whatever their folders.
EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in sorted(
        (
            item
            for item in tuple(vars().values())
            if isinstance(item, type) and issubclass(item, Effect) and item is not Effect
        ),
        key=lambda effect: effect.__module__.rpartition(".")[2],
    )
}


def without_causes(causes: Collection[str]) -> dict[str, type[Effect]]:
    """Return the effects but those of some causes, in all their forms.

    Examples
    --------
    >>> set(EFFECTS) - set(without_causes(["pressure_sensor_bias"]))
    {'pressure_sensor_bias'}
    """
    return {name: effect for name, effect in EFFECTS.items() if effect.cause not in causes}


def catalogue_table() -> tuple[EffectRow, ...]:
    """Return the catalogue as data, one row an effect, for reports and docs to print.

    Examples
    --------
    >>> [row.equation for row in catalogue_table() if row.name == "stribeck"]
    ['F = ΔF exp(−(v/v_st)²) sign(v)']
    """
    return tuple(effect_row(effect) for effect in EFFECTS.values())
