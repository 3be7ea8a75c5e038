"""Where model and measurement disagree, in sentences."""

from collections.abc import Mapping

from pneumo_casadi.diagnosis.metrics.findings import SensorError, Where
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import RegimeKind

_QUANTITIES: Mapping[str, str] = {
    Location.MASS_FLOW_P: "the mass flow into chamber P",
    Location.MASS_FLOW_N: "the mass flow into chamber N",
    Location.FORCE: "the force on the piston",
    Location.MEASUREMENT: "a sensor",
}
#: Regimes in the sentences at most.
MAX_REGIMES = 3


def location_sentences(where: Where) -> tuple[str, ...]:
    """Return where model and measurement disagree, as JSON results and reports say it.

    Examples
    --------
    >>> where = Where(Location.FORCE, None, (), {"force": 1.0}, (), {"force": 0.042})
    >>> for sentence in location_sentences(where):
    ...     print(sentence)
    Unknown inputs of the balances, relative to their signals: the force on the piston 4.2 %.
    Model and measurement disagree in the force on the piston.
    """
    sizes = ", ".join(
        f"{_QUANTITIES[name]} {100 * size:.1f} %" for name, size in where.unknown_inputs.items()
    )
    sentences = [f"Unknown inputs of the balances, relative to their signals: {sizes}."]
    if where.balance is Location.NONE:
        return (*sentences, "Flow maps and friction laws usually leave as much.")
    disagree = "Model and measurement disagree in"
    if where.sensor_error is not None:
        sentences.append(
            f"{disagree} the reading of a sensor: {_sensor_clause(where.sensor_error)}."
        )
    else:
        sentences.append(f"{disagree} {_QUANTITIES[where.balance]}.")
    if where.effects:
        act = "acts" if len(where.effects) == 1 else "act"
        sentences.append(f"{' and '.join(where.effects)} {act} there.")
    for regime in where.regimes[:MAX_REGIMES]:
        whole = "its signal" if regime.condition.kind is RegimeKind.BAND else "the time"
        sentences.append(
            f"{100 * regime.share:.0f} % of the squared residual in {_QUANTITIES[regime.balance]} "
            f"occurs under the condition: {regime.name} ({100 * regime.time:.0f} % of {whole})."
        )
    if where.rivals:
        sentences.append(
            f"Sensor errors would give a similar result: {', '.join(where.rivals)}. Check the "
            "sensors."
        )
    return tuple(sentences)


def _sensor_clause(error: SensorError) -> str:
    explain = (
        "an error of the position sensor alone explains"
        if error.sensor == "position"
        else "errors of the pressures alone explain"
    )
    return f"{explain} {100 * error.explained:.0f} % of all residuals"
