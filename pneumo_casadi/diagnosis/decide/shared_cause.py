"""Sensors that all err by one amount: rather what comes before all of them does.

A command that acts T late moves all signals by T: they look like sensors of which each is late by
T, and so does all flow that arrives late. Another supply or ambient pressure than the one stated
looks like pressure sensors of which each is off by as much. One cause is more credible than two or
three sizes that happen to be equal. Where the catalogue holds an effect of that cause the two were
compared, and the better one is named.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from math import hypot

from pneumo_casadi.diagnosis.prepare.criteria import Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.model.effect import Effect, EffectFactory

#: Signal of the supply pressure: effects that it would show act on the supply.
SUPPLY = "p_supply"


def rather_one_cause(
    effects: Sequence[Effect],
    fitted: FittedModel,
    outputs: Collection[str],
    catalogue: Mapping[str, EffectFactory],
    criteria: Criteria,
) -> str:
    """Return the note that errors of sensors, or late flows, may stand for one cause, or nothing.

    Parameters
    ----------
    effects : sequence of Effect
        Of the final model.
    fitted : FittedModel
        That model.
    outputs : collection of str
        What the sensors of the axis show.
    catalogue : mapping of str to effect class
        All effects that were fitted.
    criteria : Criteria
        Within what two sizes are one.
    """
    late = () if _delays_the_command(catalogue) else _sizes(effects, "sensor_delays", outputs)
    if late and _are_one(late, fitted, criteria):
        return (
            f"all sensors would be late by one time, {1e3 * _mean(late, fitted):.1f} ms: rather "
            "the command acts late, for which the catalogue has no effect"
        )
    if not _delays_the_command(catalogue) and any(effect.flow_delays for effect in effects):
        return (
            "all flow would arrive late: rather the command acts late, for which the catalogue has "
            "no effect"
        )
    pressures = set(outputs) - {"x"}
    shifted = () if _acts_on_supply(catalogue) else _sizes(effects, "sensor_offsets", pressures)
    if shifted and _are_one(shifted, fitted, criteria):
        return (
            f"both pressure sensors would be off by one amount, "
            f"{_mean(shifted, fitted) / 1e3:+.1f} kPa: rather the supply or the ambient "
            "pressure is another one than stated, for which the catalogue has no effect"
        )
    return ""


def _delays_the_command(catalogue: Mapping[str, EffectFactory]) -> bool:
    return any(getattr(effect, "command_delays", ()) for effect in catalogue.values())


def _acts_on_supply(catalogue: Mapping[str, EffectFactory]) -> bool:
    return any(getattr(effect, "measured_by", "") == SUPPLY for effect in catalogue.values())


def _sizes(effects: Sequence[Effect], kind: str, outputs: Collection[str]) -> tuple[str, ...]:
    """Return the parameters of one kind, two at least, if they are of all these outputs."""
    concerned = [effect for effect in effects if getattr(effect, kind)]
    names = tuple(f"{e.name}.{name}" for e in concerned for name in getattr(e, kind))
    everywhere = {name for effect in concerned for name in effect.sensors} == set(outputs)
    return names if everywhere and len(names) > 1 else ()


def _are_one(names: Sequence[str], fitted: FittedModel, criteria: Criteria) -> bool:
    """Return whether sizes are of one sign, and equal as well as is known or nearly so."""
    for a, b in combinations(names, 2):
        first, second = fitted.values[a], fitted.values[b]
        spread = hypot(fitted.std.get(a, 0.0), fitted.std.get(b, 0.0))
        nearly = criteria.one_size * max(abs(first), abs(second))
        if first * second <= 0 or abs(first - second) > max(criteria.one_size_std * spread, nearly):
            return False
    return True


def _mean(names: Sequence[str], fitted: FittedModel) -> float:
    return sum(fitted.values[name] for name in names) / len(names)
