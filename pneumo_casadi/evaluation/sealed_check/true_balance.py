"""In which balance an effect acts: the true answer to the question where."""

from collections.abc import Iterable
from typing import Any

import casadi as ca

from pneumo_casadi.data import PNEUMATIC
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.balances import write_balances
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import Parameters

MEASUREMENT = "measurement"
_FLOWS = frozenset({"mass_flow_P", "mass_flow_N"})

#: Balances of the bench's forms that no catalogue has.
UNLISTED = {
    "cogging": frozenset({"force"}),
    "vibration": frozenset({"force"}),
    "supply_pulsation": _FLOWS,
    "position_nonlinearity": frozenset({MEASUREMENT}),
    "flow_drift": _FLOWS,
    "pressure_crosstalk": frozenset({MEASUREMENT}),
    "magnetic_latch": frozenset({"force"}),
    "periodic_leak": frozenset({"mass_flow_P"}),
    "square_root_friction": frozenset({"force"}),
    "friction_fade": frozenset({"force"}),
}
#: Forms of the bench that act elsewhere than the usual form of their cause, as where sensors sit
#: elsewhere, by the effect of the catalogue that says so.
ACTING_ELSEWHERE = {
    "elastic_load_measured": "position_on_elastic_load",
    "hose_volume_at_valve": "hose_sensor_at_valve",
    "backlash_two_masses": "backlash_before_load",
    "backlash_two_masses_measured": "position_on_load_with_play",
}
_NOMINAL = (*(f"X_s{i}" for i in range(1, 7)), "M", "f_v", "F_c_plus", "F_c_minus", "v_s")


def balances_of(names: Iterable[str], forms: Iterable[str] = ()) -> frozenset[str]:
    """Return the balances in which any of some effects acts.

    Where an effect acts on both chambers, either mass flow is a right answer; where it acts on
    what a sensor shows, ``measurement`` is.

    Parameters
    ----------
    names : iterable of str
        The causes.
    forms : iterable of str, optional
        The forms of the bench that were recorded, where these are not the usual ones.

    Raises
    ------
    ModelError
        If neither the catalogue nor the bench has one of that name.

    Examples
    --------
    >>> sorted(balances_of(["stribeck", "leakage_N"]))
    ['force', 'mass_flow_N']
    >>> sorted(balances_of(["position_delay"]))
    ['measurement']
    """
    balances: frozenset[str] = frozenset()
    for form in ACTING_ELSEWHERE.keys() & set(forms):
        balances |= {MEASUREMENT} | acting_in(EFFECTS[ACTING_ELSEWHERE[form]]())
    for name in names:
        if name in EFFECTS:
            balances |= acting_in(EFFECTS[name]())
        elif name in UNLISTED:
            balances |= UNLISTED[name]
        else:
            raise ModelError(f"no effect {name!r}: its balance is unknown")
    return balances


def acting_in(effect: Effect) -> frozenset[str]:
    """Return the balances of a servo axis whose residuals, or sensors, depend on an effect."""
    sym: Any = ca.SX.sym
    own = [f"{effect.name}.{item.name}" for item in effect.parameters]
    own += [f"{effect.name}.{item.name}" for item in effect.states]
    known = (*PNEUMATIC.states, *_NOMINAL, *PNEUMATIC.constants, *own)
    symbols: dict[str, Any] = {name: sym(name) for name in known}
    written = write_balances(
        PNEUMATIC,
        symbols,
        {name: sym(f"d{name}") for name in PNEUMATIC.states},
        {name: sym(name) for name in PNEUMATIC.inputs},
        symbols,
        {name: symbols[name] for name in PNEUMATIC.constants},
        (effect,),
        _AnyFlow(),
    )
    mine = ca.vertcat(*(symbols[name] for name in own))
    balances = {name for name, r in written.residual.items() if ca.depends_on(r, mine)}
    if any(ca.depends_on(y, mine) for y in written.output.values()):
        balances.add(MEASUREMENT)
    return frozenset(balances)


class _AnyFlow:
    """A flow that depends on all that a valve's flow may depend on."""

    parameters = Parameters(())

    def expression(self, u: Any, p: Any, theta: Any) -> Any:
        return u * p

    def expression_at(self, u: Any, p: Any, theta: Any, filling: Any, emptying: Any) -> Any:
        return u * p * filling * emptying
