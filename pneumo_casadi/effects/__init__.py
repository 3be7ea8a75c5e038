"""The catalogue of effects: one file an effect or family, one line here each.

An import below is an entry of the catalogue.
"""

from pneumo_casadi.effect import Effect
from pneumo_casadi.effects.asymmetric_viscous_friction import (
    AsymmetricViscousFriction as AsymmetricViscousFriction,
)
from pneumo_casadi.effects.stribeck import Stribeck as Stribeck
from pneumo_casadi.effects.table import EffectRow as EffectRow
from pneumo_casadi.effects.table import row_of as row_of
from pneumo_casadi.effects.valve_lag import ValveLag as ValveLag

#: All effects, by name.
CATALOGUE: dict[str, type[Effect]] = {
    found.name: found
    for found in tuple(vars().values())
    if isinstance(found, type) and issubclass(found, Effect) and found is not Effect
}


def catalogue_table() -> tuple[EffectRow, ...]:
    """Return the catalogue as data, one row an effect, for reports and docs to print.

    Examples
    --------
    >>> [row.equation for row in catalogue_table() if row.name == "stribeck"]
    ['F = ΔF exp(−(v/v_st)²) sign(v)']
    """
    return tuple(row_of(effect) for effect in CATALOGUE.values())
