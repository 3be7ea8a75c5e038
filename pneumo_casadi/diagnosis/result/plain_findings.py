"""What a diagnosis is made of as plain data, complete enough to be read back."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.metrics.findings import Candidate, EffectFound, Gap, Value, Where
from pneumo_casadi.diagnosis.metrics.regime import Regime
from pneumo_casadi.diagnosis.wording.location_sentences import location_sentences

#: Number of the format of `diagnosis.json`.
FORMAT = 1


def effect_dict(effect: EffectFound) -> dict[str, Any]:
    """Return an effect that was added to the model."""
    return {
        "name": effect.name,
        "form": effect.form,
        "forms": dict(effect.forms),
        "rivals": dict(effect.rivals),
        "probability": effect.probability,
        "contribution": effect.contribution,
        "parameters": values_dict(effect.parameters),
    }


def candidate_dict(candidate: Candidate) -> dict[str, Any]:
    """Return a line of the ranking."""
    closure = candidate.closure
    return {
        "name": candidate.label,
        "probability": candidate.probability,
        "held_out_shrink": None if closure is None else closure.value,
        "shrink_interval": None if closure is None else [closure.lower, closure.upper],
        "explained": candidate.explained,
        "observable": candidate.observable,
        "parameters": values_dict(candidate.parameters),
        "failure": candidate.failure or None,
    }


def where_dict(where: Where) -> dict[str, Any]:
    """Return where simulation and measurement disagree, as data and in words."""
    sensor = where.sensor_error
    return {
        "balance": where.balance.value,
        "junction": "" if where.junction is None else where.junction.value,
        "regimes": [regime.name for regime in where.regimes],
        "regime_details": [_regime(regime) for regime in where.regimes],
        "shares": dict(where.shares),
        "unknown_inputs": dict(where.unknown_inputs),
        "sensor_error": (
            None if sensor is None else {"sensor": sensor.sensor, "explained": sensor.explained}
        ),
        "effects": list(where.effects),
        "balances": [location.value for location in where.balances],
        "sizes": {cause: dict(sizes) for cause, sizes in where.sizes.items()},
        "rivals": list(where.rivals),
        "in_parameters": where.in_parameters,
        "words": list(location_sentences(where)),
    }


def _regime(regime: Regime) -> dict[str, Any]:
    condition = regime.condition
    return {
        "name": regime.name,
        "condition": {
            "kind": condition.kind.name.lower(),
            "lower": condition.lower,
            "upper": condition.upper,
            "chamber": condition.chamber,
        },
        "balance": regime.balance.value,
        "share": regime.share,
        "time": regime.time,
        "p_value": regime.p_value,
    }


def gap_dict(gap: Gap) -> dict[str, Any]:
    """Return the gap before and after, and by view and output."""
    return {
        "before": gap.before,
        "after": gap.after,
        "noise_floor": gap.noise_floor,
        "shrink": gap.closure.value,
        "shrink_interval": [gap.closure.lower, gap.closure.upper],
        "with_term": gap.with_term,
        "views": {
            view: {name: dict(values) for name, values in outputs.items()}
            for view, outputs in gap.views.items()
        },
    }


def discovered_dict(discovered: DiscoveredTerm) -> dict[str, Any]:
    """Return a discovered term with its curve, which assumes no formula."""
    curve = discovered.curve
    return discovered.as_dict() | {
        "name": discovered.term.name,
        "balances": list(discovered.term.balances),
        "curve": {
            "driver": curve.driver.tolist(),
            "value": curve.value.tolist(),
            "band": curve.band.tolist(),
            "formula": curve.formula.tolist(),
        },
    }


def values_dict(values: Mapping[str, Value]) -> dict[str, dict[str, Any]]:
    """Return quantities by name."""
    return {name: _value(value) for name, value in values.items()}


def _value(value: Value) -> dict[str, Any]:
    bound = {"at_bound": True} if value.at_bound else {}
    return {"value": value.value, "std": value.std, "unit": value.unit} | bound
