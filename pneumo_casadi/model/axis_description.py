"""What an axis consists of: its kind, bench, flow map, effects and parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import casadi as ca
import numpy as np

from pneumo_casadi.data import AnyBench, AxisKind
from pneumo_casadi.data.bench.axis_kind import SCALES, UNITS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import FloatArray, Parameter, Parameters
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, eq=False, repr=False)
class AxisDescription(Brief):
    """An axis with its effects; `Axis` adds the equations.

    Parameters
    ----------
    bench : Bench or ForceBench
        Geometry and constants.
    flow : flow model or None
        Static map of the two identical valves; None where the kind of axis has no valves.
    effects : tuple of Effect
        Folded in this order at each junction.
    parameters : Parameters
        Nominal parameters (eq. 9), the friction width ``v_s``, the coefficients of the flow map
        and those of the effects as ``"effect.name"``.
    """

    bench: AnyBench
    flow: Any
    effects: tuple[Effect, ...]
    parameters: Parameters

    def __post_init__(self) -> None:
        names = [effect.name for effect in self.effects]
        if len(set(names)) < len(names):
            raise ModelError(f"an effect is named twice: {', '.join(names)}")
        kind = self.kind
        if (self.flow is not None) != kind.needs_flow_map:
            verb = "needs the" if kind.needs_flow_map else "has no"
            raise ModelError(f"a {kind.title} {verb} static flow map of its valves")
        for effect in self.effects:
            missing = [j for j in effect.junctions if j not in kind.junctions]
            if missing:
                raise ModelError(
                    f"effect {effect.name} acts at {', '.join(missing)}, which a {kind.title} "
                    "has not"
                )
            if effect.needs_chambers and not kind.chambers:
                raise ModelError(
                    f"effect {effect.name} needs pressures, which a {kind.title} has not"
                )
            unseen = [sensor for sensor in effect.sensors if sensor not in kind.outputs]
            if unseen:
                raise ModelError(
                    f"effect {effect.name} concerns the sensor of {', '.join(unseen)}, which is no "
                    f"output of a {kind.title}"
                )
            absent = [name for name in effect.needs_constants if name not in self.constants]
            if absent:
                raise ModelError(
                    f"effect {effect.name} needs {', '.join(absent)}, which the bench does not "
                    "state"
                )

    def __getstate__(self) -> dict[str, Any]:
        kept = ("bench", "flow", "effects", "parameters")
        return {name: self.__dict__[name] for name in kept}

    def with_effects(self, *effects: Effect) -> Self:
        """Return the axis with further effects, at their null values."""
        added = Parameters(item for effect in effects for item in _effect_parameters(effect))
        return replace(self, effects=(*self.effects, *effects), parameters=self.parameters + added)

    def with_parameters(self, parameters: Parameters | Mapping[str, float]) -> Self:
        """Return the axis with other parameter values, bounds or freedom (matched by name)."""
        if not isinstance(parameters, Parameters):
            return replace(self, parameters=self.parameters.with_values(parameters))
        new = {item.name: item for item in parameters}
        return replace(
            self, parameters=Parameters(new.get(item.name, item) for item in self.parameters)
        )

    def at_null_values(self) -> Self:
        """Return the axis with all effects at their null values, or at the nearest bounds."""
        nulls = {item.name: item.null for item in self.parameters if item.null is not None}
        items = self.parameters.select(nulls)
        inside = np.clip(list(nulls.values()), items.lower, items.upper)
        return self.with_parameters(dict(zip(nulls, inside.tolist(), strict=True)))

    def at_starting_values(self, *names: str) -> Self:
        """Return the axis with effects (by default all) at the starting values of a fit."""
        chosen = names or tuple(effect.name for effect in self.effects)
        unknown = set(chosen) - {effect.name for effect in self.effects}
        if unknown:
            raise ModelError(f"the axis has no effect {', '.join(sorted(unknown))}")
        starts = {
            item.name: item.start
            for item in self.parameters
            if item.start is not None and item.name.split(".")[0] in chosen
        }
        return self.with_parameters(starts)

    def started_at(self, parameters: Parameters) -> Self:
        """Return the axis with values from another estimate, moved into this axis' bounds.

        Weighted least squares has no bounds; output error must start within them.
        """
        known = [item.name for item in parameters if item.name in self.parameters]
        mine = self.parameters.select(known)
        inside = np.clip(parameters.select(known).values, mine.lower, mine.upper)
        return self.with_parameters(dict(zip(known, inside.tolist(), strict=True)))

    @property
    def kind(self) -> AxisKind:
        """States, inputs, outputs, balances and junctions of this kind of axis."""
        return self.bench.kind

    @property
    def motion_states(self) -> tuple[str, ...]:
        """States of the nominal axis."""
        return self.kind.states

    @property
    def states(self) -> tuple[str, ...]:
        """All states, those of the effects last as ``"effect.state"``."""
        extra = (f"{e.name}.{state.name}" for e in self.effects for state in e.states)
        return (*self.motion_states, *extra)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Input channels."""
        return self.kind.inputs

    @property
    def inputs_at_rest(self) -> FloatArray:
        """Inputs of an axis that nothing moves, (nu,): zero, pressures at the bench's values."""
        constants = self.constants
        at_rest = {
            "p_supply": constants.get("p_supply", 0.0),
            "p_P": constants.get("p_ext", 0.0),
            "p_N": constants.get("p_ext", 0.0),
        }
        return np.array([at_rest.get(name, 0.0) for name in self.inputs])

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured channels."""
        return self.kind.outputs

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the balances in residual form, in order."""
        return tuple(balance.name for balance in self.kind.balances)

    @property
    def flow_parameters(self) -> tuple[str, ...]:
        """Names of the coefficients of the flow map; empty where there is none."""
        return self.flow.parameters.names if self.kind.needs_flow_map else ()

    @property
    def constants(self) -> dict[str, float]:
        """Geometry, pressures, gas and load of the bench, as far as the axis has them [SI]."""
        values = {name: getattr(self.bench, name) for name in self.kind.constants}
        load = self.bench.load
        values |= {"g_x": load.acceleration or None, "F_0": load.force or None}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def state_scales(self) -> FloatArray:
        """Sizes by which an optimiser divides the states, shape (nx,)."""
        extra = [state.scale for effect in self.effects for state in effect.states]
        return np.array([*(SCALES[name] for name in self.motion_states), *extra])

    def unit(self, channel: str) -> str:
        """Return the unit of a state, input or output of the nominal axis."""
        return UNITS[channel]

    @property
    def symbol(self) -> Any:
        """CasADi type in which the model can be written: SX unless the flow map needs MX."""
        return ca.MX if getattr(self.flow, "symbol", "SX") == "MX" else ca.SX


def _effect_parameters(effect: Effect) -> list[Parameter]:
    return [replace(item, name=f"{effect.name}.{item.name}") for item in effect.parameters]
