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

#: Effects that share a record and a fit, which is harder for each of them and quicker for all.
TOGETHER = [
    (Stribeck, PressureFriction, PressureSensorLag),
    (PositionFriction, QuadraticDrag, PositionDelay),
    (Presliding, AsymmetricViscousFriction, PressureSensorBias),
    (ElasticLoad, SpringLoad, Backlash, ConstantForce),
    (DriveLag, GainError),
]
FORCE_DRIVEN = {DriveLag, GainError}
#: Held because an effect cannot be told from it, exactly.
ABSORBING = {ConstantForce: "F_c_minus", GainError: "M"}
#: Twenty-five parameters: one of a right model lies outside by chance in one of 600 suites.
LEVEL = 4.0


@pytest.mark.slow
@pytest.mark.parametrize("effects", TOGETHER, ids=lambda some: " ".join(e.name for e in some))
def test_effects_are_recovered_within_their_intervals_beside_the_nominal_parameters(
    recover, effects
):
    recovered = recover(
        *(effect() for effect in effects),
        force_driven=set(effects) <= FORCE_DRIVEN,
        hold=[ABSORBING[effect] for effect in effects if effect in ABSORBING],
    )
    assert np.isfinite(recovered.std).all() and (recovered.std > 0).all()
    far = dict(zip(recovered.names, recovered.deviations, strict=True))
    assert np.abs(recovered.deviations).max() < LEVEL, far
    sizes = np.abs(recovered.truth - recovered.null)
    seen = sizes > 2 * LEVEL * recovered.std
    assert seen[sizes > 0].all(), "the record does not show the effect: the test could not fail"
