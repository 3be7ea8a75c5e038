"""Sensors that are all late by one time: rather the command is late, before all of them."""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from math import hypot

from pneumo_casadi.diagnosis.prepare.criteria import Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.model.effect import Effect, EffectFactory


def rather_late_command(
    effects: Sequence[Effect],
    fitted: FittedModel,
    outputs: Collection[str],
    catalogue: Mapping[str, EffectFactory],
    criteria: Criteria,
) -> str:
    """Return the note that late sensors may stand for a late command, or nothing.

    A command that acts T late moves all signals by T: they look like sensors of which each is late
    by T. One delay is more credible than two or three that happen to be equal. Where the catalogue
    holds an effect that delays the command the two were compared, and the better one is named.

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
        Within what two delays are one.
    """
    if any(getattr(effect, "command_delays", ()) for effect in catalogue.values()):
        return ""
    late = [effect for effect in effects if effect.sensor_delays]
    delays = [f"{effect.name}.{name}" for effect in late for name in effect.sensor_delays]
    if len(delays) < 2 or {name for effect in late for name in effect.sensors} != set(outputs):
        return ""
    for a, b in combinations(delays, 2):
        values = fitted.values[a], fitted.values[b]
        spread = hypot(fitted.std.get(a, 0.0), fitted.std.get(b, 0.0))
        if abs(values[0] - values[1]) > max(
            criteria.one_delay_std * spread, criteria.one_delay * max(values)
        ):
            return ""
    mean = sum(fitted.values[name] for name in delays) / len(delays)
    return (
        f"all sensors would be late by one time, {1e3 * mean:.1f} ms: rather the command acts "
        "late, for which the catalogue has no effect"
    )
