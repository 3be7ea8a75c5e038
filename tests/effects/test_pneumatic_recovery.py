"""Recovery of the pneumatic and valve effects from data made with them."""

import numpy as np
import pytest

from pneumo_casadi.effects import (
    ExhaustRestriction,
    FlowMapShape,
    HeatTransfer,
    Hose,
    LeakageN,
    LeakageP,
    PistonSealLeakage,
    SupplyDroop,
    SupplyDroopProportional,
    ValveDeadZone,
    ValveDynamics,
    ValveHysteresis,
    ValveMismatch,
    ValveMismatchEdges,
    ValveNullShift,
)

#: Effects that share a record and a fit, which is harder for each of them and quicker for all.
TOGETHER = [
    (PistonSealLeakage, SupplyDroop),
    (LeakageP, LeakageN, Hose),
    (ExhaustRestriction, ValveMismatchEdges),
    (HeatTransfer, ValveMismatch, ValveNullShift),
    (SupplyDroopProportional, LeakageN),
    (ValveDynamics, ValveDeadZone),
    (ValveHysteresis, FlowMapShape),
]
#: Held because an effect cannot be told from it, or because it is off.
HELD = {
    ValveMismatch: "X_s6",
    ValveDynamics: "valve_dynamics.slew",
    **{leak: f"{leak.name}.viscous" for leak in (PistonSealLeakage, LeakageP, LeakageN)},
}
#: A clean silencer is hardly felt at these pressures, where exhausts are choked: a clogged one.
VALUES = {
    ExhaustRestriction: {
        "exhaust_restriction.R": 3e11,
        "exhaust_restriction.tau": 0.03,
        "exhaust_restriction.C_leak": 3e-10,
    },
    SupplyDroop: {"supply_droop.C_leak": 1e-9},
    SupplyDroopProportional: {
        "supply_droop_proportional.G": 1e-8,
        "supply_droop_proportional.C_leak": 1e-9,
    },
    ValveHysteresis: {"valve_hysteresis.s": 0.2},
}
LEVEL = 4.0


@pytest.mark.slow
@pytest.mark.parametrize("effects", TOGETHER, ids=lambda some: " ".join(e.name for e in some))
def test_effects_are_recovered_within_their_intervals_beside_the_nominal_parameters(
    recover, effects
):
    recovered = recover(
        *(effect() for effect in effects),
        hold=[HELD[effect] for effect in effects if effect in HELD],
        values={k: v for effect in effects for k, v in VALUES.get(effect, {}).items()},
    )
    assert np.isfinite(recovered.std).all() and (recovered.std > 0).all()
    far = dict(zip(recovered.names, recovered.deviations, strict=True))
    assert np.abs(recovered.deviations).max() < LEVEL, far
    sizes = np.abs(recovered.truth - recovered.null)
    seen = sizes > 2 * LEVEL * recovered.std
    assert seen[sizes > 0].all(), "the record does not show the effect: the test could not fail"
