"""The catalogue of effects: one file an effect or family, one line here each."""

from pneumo_casadi.effect import Effect
from pneumo_casadi.effects.asymmetric_viscous_friction import AsymmetricViscousFriction
from pneumo_casadi.effects.stribeck import Stribeck
from pneumo_casadi.effects.valve_lag import ValveLag

#: All effects, by name.
CATALOGUE: dict[str, type[Effect]] = {
    effect.name: effect for effect in (AsymmetricViscousFriction, Stribeck, ValveLag)
}

__all__ = ["CATALOGUE", "AsymmetricViscousFriction", "Stribeck", "ValveLag"]
