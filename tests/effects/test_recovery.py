"""Recovery: each effect's parameters come back inside their intervals from data made with it."""

import numpy as np
import pytest

from pneumo_casadi.effects import (
    AsymmetricViscousFriction,
    Backlash,
    ConstantForce,
    DriveLag,
    ElasticLoad,
    GainError,
    PositionDelay,
    PositionFriction,
    Presliding,
    PressureFriction,
    PressureSensorBias,
    PressureSensorLag,
    QuadraticDrag,
    SpringLoad,
    Stribeck,
)

#: Effects on the servo axis, and what must be held because it absorbs them.
SERVO = {
    Stribeck: (),
    Presliding: (),
    PressureFriction: (),
    PositionFriction: (),
    QuadraticDrag: (),
    AsymmetricViscousFriction: (),
    ConstantForce: ("F_c_minus",),
    SpringLoad: (),
    ElasticLoad: (),
    Backlash: (),
    PressureSensorLag: (),
    PressureSensorBias: (),
    PositionDelay: (),
}
FORCE_DRIVEN = {DriveLag: (), GainError: ("M",)}
#: Twenty-five parameters: one of a right model lies outside by chance in one of 600 suites.
LEVEL = 4.0


@pytest.mark.parametrize("effect", [*SERVO, *FORCE_DRIVEN], ids=lambda effect: effect.name)
def test_an_effect_is_recovered_within_its_interval_beside_all_nominal_parameters(recover, effect):
    found = recover(
        effect(),
        force_driven=effect in FORCE_DRIVEN,
        hold=(SERVO | FORCE_DRIVEN)[effect],
    )
    assert np.isfinite(found.std).all() and (found.std > 0).all()
    assert np.abs(found.deviations).max() < LEVEL
    sizes = np.abs(found.truth - found.null)
    amplitudes = sizes > 0
    assert (sizes[amplitudes] > 2 * LEVEL * found.std[amplitudes]).all()
