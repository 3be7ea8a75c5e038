"""Where model and measurement disagree, in sentences."""

from collections.abc import Mapping, Sequence

from pneumo_casadi.diagnosis.metrics.findings import SensorError, Where
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import RegimeKind

_QUANTITIES: Mapping[str, str] = {
    Location.MASS_FLOW_P: "the mass flow into chamber P",
    Location.MASS_FLOW_N: "the mass flow into chamber N",
    Location.FORCE: "the force on the moving mass",
    Location.MEASUREMENT: "the reading of a sensor",
}
_BOTH_CHAMBERS = "the mass flows into both chambers"
#: Regimes in the sentences at most.
MAX_REGIMES = 3


def location_sentences(where: Where) -> tuple[str, ...]:
    """Return where model and measurement disagree, as JSON results and reports say it.

    Examples
    --------
    >>> where = Where(Location.FORCE, None, (), {"force": 1.0}, (), {"force": 0.042})
    >>> for sentence in location_sentences(where):
    ...     print(sentence)
    Model and measurement disagree in the force on the moving mass.
    Without effects the model lacks, relative to the signal of each balance: the force on the \
moving mass 4.2 %.
    """
    lacks = f"Without effects the model lacks, {_sizes(where.unknown_inputs)}."
    if where.balance is Location.NONE:
        return lacks, "Flow maps and friction laws usually leave as much."
    if where.in_parameters:
        balances = locations_in_words(where.balances)
        return f"Only parameters contradict the bench: those in the balance of {balances}.", lacks
    sentences = [_disagree(where)]
    if where.sizes:
        sentences += [
            f"{cause} adds, {_sizes(sizes)}." if sizes else f"{cause} acts in a sensor."
            for cause, sizes in where.sizes.items()
        ]
    elif where.effects:
        act = "acts" if len(where.effects) == 1 else "act"
        sentences.append(f"{' and '.join(where.effects)} {act} there.")
    sentences.append(lacks)
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


def locations_in_words(locations: Sequence[Location]) -> str:
    """Return locations as an enumeration; both mass flows as one.

    Examples
    --------
    >>> locations_in_words([Location.MASS_FLOW_N, Location.FORCE, Location.MASS_FLOW_P])
    'the mass flows into both chambers and the force on the moving mass'
    """
    flows = {Location.MASS_FLOW_P, Location.MASS_FLOW_N}
    both = flows <= set(locations)
    words = [
        _BOTH_CHAMBERS if both and location in flows else _QUANTITIES[location]
        for location in locations
    ]
    *first, last = dict.fromkeys(words)
    return f"{', '.join(first)} and {last}" if first else last


def _disagree(where: Where) -> str:
    text = f"Model and measurement disagree in {locations_in_words(where.balances)}"
    error = where.sensor_error
    return f"{text}." if error is None else f"{text}: {_sensor_clause(error)}."


def _sizes(sizes: Mapping[str, float]) -> str:
    items = ", ".join(f"{_QUANTITIES[name]} {100 * size:.1f} %" for name, size in sizes.items())
    return f"relative to the signal of each balance: {items}"


def _sensor_clause(error: SensorError) -> str:
    explain = (
        "an error of the position sensor alone explains"
        if error.sensor == "position"
        else "errors of the pressures alone explain"
    )
    return f"{explain} {100 * error.explained:.0f} % of all residuals"
