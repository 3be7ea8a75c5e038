"""The balances as functions along a given motion, made once for all axes of a kind.

Geometry, pressures and gas enter as numbers at run time, so that the functions of an effect
serve every case.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneumo_casadi.estimation.equation_error.balance_code import (
    BalanceCode,
    balance_code,
    constants_of,
)
from pneumo_casadi.model.along_record import RecordFunction, Recursion
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray, Parameters


@dataclass(frozen=True, eq=False)
class BalanceFunctions:
    """Residuals of the balances of an axis along a given motion.

    All functions take ``x (n,), dx (n,), u (nu,), z (nz,), c (nc,), θ (nθ,)``: nominal states and
    derivatives, inputs, states of the effects, constants and parameters.

    Parameters
    ----------
    axis : Axis
        With its effects.
    """

    axis: Axis

    @property
    def constants(self) -> dict[str, float]:
        """Numbers that the functions take at run time, by name."""
        return constants_of(self.axis)

    @cached_property
    def constant_values(self) -> FloatArray:
        """These numbers as the functions take them, (nc,)."""
        return np.array(list(self.constants.values()))

    @cached_property
    def _code(self) -> BalanceCode:
        return balance_code(self.axis)

    @property
    def n_z(self) -> int:
        """Number of states of the effects."""
        return self._code.n_z

    @property
    def nominal_parameters(self) -> tuple[str, ...]:
        """Free parameters of the axis without its effects."""
        return tuple(name for name in self.axis.parameters.free_names if "." not in name)

    @property
    def effect_parameters(self) -> tuple[str, ...]:
        """Free parameters of the effects."""
        return tuple(name for name in self.axis.parameters.free_names if "." in name)

    @property
    def analytic(self) -> tuple[str, ...]:
        """Free parameters with analytic derivatives, the states of the effects held.

        Those of the nominal axis, and those of effects on which no state and no sensor depends.
        For `state_dependent` ones the derivatives leave out the change of the states.
        """
        return self._code.analytic

    @property
    def by_difference(self) -> tuple[str, ...]:
        """Free parameters of effects on which states or sensors depend as well."""
        felt = self._code.state_parameters
        return tuple(name for name in self.effect_parameters if name in felt)

    @property
    def state_dependent(self) -> tuple[str, ...]:
        """Nominal free parameters on which states of the effects depend."""
        return tuple(
            name for name in self.nominal_parameters if name in self._code.state_parameters
        )

    @property
    def free(self) -> tuple[str, ...]:
        """All free parameters, in the order of every Jacobian."""
        return (*self.analytic, *self.by_difference)

    @cached_property
    def clocks(self) -> FloatArray:
        """Which states of the effects are the time, (nz,): 1, the others 0."""
        states = [state for effect in self.axis.effects for state in effect.states]
        return np.array([float(state.clock) for state in states])

    @cached_property
    def sampled(self) -> NDArray[np.bool_]:
        """Which states of the effects jump from sample to sample, (nz,); see `State.sampled`."""
        return np.array([s.sampled for effect in self.axis.effects for s in effect.states], bool)

    @cached_property
    def sensors(self) -> "BalanceFunctions":
        """The same axis with the effects of sensors alone: these act on nominal states only."""
        effects = tuple(effect for effect in self.axis.effects if any_sensor_effect((effect,)))
        if effects == self.axis.effects:
            return self
        kept = {effect.name for effect in effects}
        parameters = Parameters(
            item
            for item in self.axis.parameters
            if "." not in item.name or item.name.split(".")[0] in kept
        )
        return BalanceFunctions(replace(self.axis, effects=effects, parameters=parameters))

    @property
    def functions(self) -> dict[str, RecordFunction]:
        """Functions of one sample of ``(x, dx, u, z, c, θ)``, by name.

        ``residual -> (r,)``, the residuals of the balances (ne,); ``residual_and_jacobian -> (r,
        ∂r/∂θ)`` with θ in the order of `analytic`. Where effects act on sensors, ``shown -> (y,)``,
        what these show (ny,). Where effects have states, ``rest -> (z,)``.
        """
        return self._code.functions

    @property
    def step(self) -> Recursion:
        """States of the effects a sample later.

        ``(z, x, x_next, dx, dx_next, u, u_next, h, c, θ)``.
        """
        return self._code.step


def any_sensor_effect(effects: Sequence[Effect]) -> bool:
    """Tell whether an effect acts on a measured output."""
    return any("output" in effect.junctions for effect in effects)
