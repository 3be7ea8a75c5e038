"""Where model and measurement disagree: in which balance or sensor, and in which regime."""

from collections.abc import Mapping, Sequence

import numpy as np

from pneumo_casadi.diagnosis.locate.model_error import UNKNOWN_INPUT_ERROR
from pneumo_casadi.diagnosis.locate.regimes import find_regimes
from pneumo_casadi.diagnosis.locate.signatures import (
    HYPOTHESES,
    Signatures,
    row_signals,
    signatures,
)
from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs, estimate_unknown_inputs
from pneumo_casadi.diagnosis.metrics.findings import SensorError, Where
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Regime
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.balance_functions import BalanceFunctions
from pneumo_casadi.estimation.equation_error.residuals import balance_residuals
from pneumo_casadi.model.effect import Effect, EffectFactory
from pneumo_casadi.model.junctions import MECHANICAL, Junction

#: Residual left by a sensor error over that left by the best unknown input: below the first limit
#: the sensor is the location; above the second it is excluded.
SENSOR, RIVAL = 0.7, 3.0
#: Factor by which a hypothesis with one more free signal must leave less.
SIGNAL = 1.7
#: Share of the residuals that a rival must not leave.
UNEXPLAINED = 0.15
#: Regimes shown at most.
REGIMES = 5
#: Both chambers are affected if the energy in one is more than this share of that in the other.
BOTH = 0.25


def locate(
    study: Study,
    nominal: FittedModel,
    cause: Sequence[Effect] = (),
    fitted: FittedModel | None = None,
    gap: bool | None = None,
    inputs: Sequence[UnknownInputs] | None = None,
    catalogue: Mapping[str, EffectFactory] = EFFECTS,
    besides: Sequence[Effect] = (),
    contradicted: Location = Location.NONE,
    explained: Sequence[Location] = (),
) -> Where:
    """Return where model and measurement disagree.

    Parameters
    ----------
    study : Study
        Records and nominal axis.
    nominal : FittedModel
        Its fit without effects.
    cause : sequence of Effect, optional
        Effects found, the one missed most first: the location is that of the first, and
        those of the others are among `Where.balances`.
    fitted : FittedModel, optional
        The fit with them: shows how much each one adds to each balance.
    gap : bool, optional
        Whether there is a gap, if known from held-out data: without a gap there is no location,
        with one there is, however small. By default the unknown inputs decide.
    inputs : sequence of UnknownInputs, optional
        From `estimate_unknown_inputs`, where they are known already.
    catalogue : mapping of str to effect class, optional
        Effects that may be named as sensor errors that look the same.
    besides : sequence of Effect, optional
        Weak effects that the fit has too.
    contradicted : Location, optional
        Balance whose parameters the bench contradicts: the location where there is no gap.
    explained : sequence of Location, optional
        Where a term acts that explains the gap without an effect: it knows better than residuals,
        which a sensor's error may have left as well.

    Returns
    -------
    Where
    """
    if inputs is None:
        inputs = estimate_unknown_inputs(study, nominal)
    # A long record counts by its nodes; where none counts in any record, all are alike.
    nodes = np.array([i.counts.sum(axis=1) for i in inputs], dtype=float)
    nodes[:, ~nodes.any(axis=0)] = 1.0
    mean = np.average([i.energy for i in inputs], axis=0, weights=nodes)
    energy = dict(zip(study.axis.equations, mean.tolist(), strict=True))
    shares = above_form(energy)
    if gap and not any(shares.values()):
        total = sum(value / UNKNOWN_INPUT_ERROR[name] ** 2 for name, value in energy.items())
        shares = {
            name: value / UNKNOWN_INPUT_ERROR[name] ** 2 / total for name, value in energy.items()
        }
    evidence = signatures(study, nominal.values)
    telling = find_regimes(study, nominal)
    added: dict[str, dict[str, float]] = {}
    if cause:
        if fitted is not None:
            model = (*cause, *besides)
            added = {effect.name: _added(study, model, effect, fitted) for effect in cause}
        balance = balance_of_effect(cause[0], added.get(cause[0].name, shares))
        junction = _acts_at(cause[0])
        balances = _balances_of(cause, added, shares)
    elif gap is False:
        balance, junction = contradicted, None
        balances = (balance,)
    elif explained:
        balance = max(explained, key=lambda name: shares.get(name, 0.0))
        junction, balances = _junction(balance, telling), (balance, *explained)
    else:
        balance = balance_of_gap(shares, evidence)
        junction = _junction(balance, telling)
        balances = with_other_chamber(balance, shares)
    # A sensor's error shows in every balance, another cause where it acts.
    agree = gap is False and not cause
    here = [r for r in telling if r.balance in balances or balance is Location.MEASUREMENT]
    rivals = (
        ()
        if agree or explained or balance in (Location.MEASUREMENT, Location.NONE)
        else rival_sensor_effects(evidence, catalogue)
    )
    return Where(
        balance,
        junction,
        () if agree else tuple(here[:REGIMES]),
        shares,
        rivals,
        {name: value**0.5 for name, value in energy.items()},
        _sensor_error(evidence) if balance is Location.MEASUREMENT and not explained else None,
        tuple(effect.cause for effect in cause if _acts_at(effect) == junction),
        tuple(dict.fromkeys(balances)),
        {effect.cause: _size(effect, added[effect.name]) for effect in cause if added},
        agree and balance is not Location.NONE,
    )


def above_form(energy: Mapping[str, float]) -> dict[str, float]:
    """Return shares of the energies beyond what a correct model leaves; zeros if there is none."""
    excess = {
        name: max(value - UNKNOWN_INPUT_ERROR[name] ** 2, 0.0) for name, value in energy.items()
    }
    total = sum(excess.values())
    return {name: value / total if total > 0 else 0.0 for name, value in excess.items()}


def balance_of_effect(cause: Effect, added: Mapping[str, float]) -> Location:
    """Return the balance, or ``measurement``, in which an effect acts.

    Parameters
    ----------
    added : mapping of str to float
        How much the effect adds to each balance, or the shares of the unknown inputs: decides
        between chambers.
    """
    junctions = set(cause.junctions)
    if junctions <= {Junction.OUTPUT}:
        return Location.MEASUREMENT
    if junctions & MECHANICAL:
        return Location.FORCE
    flows = {name: value for name, value in added.items() if name != Location.FORCE}
    return Location(max(flows, key=lambda name: flows[name]))


def with_other_chamber(balance: Location, energy: Mapping[str, float]) -> tuple[Location, ...]:
    """Return a location, and where it is a mass flow that of the other chamber if it has as much.

    Parameters
    ----------
    balance : Location
        Where the most lies.
    energy : mapping of str to float
        Of each balance; see `BOTH`.

    Examples
    --------
    >>> energy = {"mass_flow_P": 0.2, "mass_flow_N": 0.3, "force": 0.5}
    >>> [location.value for location in with_other_chamber(Location.MASS_FLOW_N, energy)]
    ['mass_flow_N', 'mass_flow_P']
    >>> with_other_chamber(Location.FORCE, energy)
    (<Location.FORCE: 'force'>,)
    """
    flows = (Location.MASS_FLOW_P, Location.MASS_FLOW_N)
    if balance not in flows:
        return (balance,)
    (other,) = (flow for flow in flows if flow is not balance)
    least = BOTH * energy.get(balance, 0.0)
    return (balance, other) if energy.get(other, 0.0) > least else (balance,)


def _balances_of(
    cause: Sequence[Effect], added: Mapping[str, Mapping[str, float]], shares: Mapping[str, float]
) -> tuple[Location, ...]:
    """Return the locations in which some effects act, those of the first one first."""
    locations: list[Location] = []
    for effect in cause:
        energy = added.get(effect.name, shares)
        locations += with_other_chamber(balance_of_effect(effect, energy), energy)
    return tuple(dict.fromkeys(locations))


def _size(effect: Effect, added: Mapping[str, float]) -> dict[str, float]:
    """Return what an effect adds to the balances in which it acts, root mean squares [1]."""
    location = balance_of_effect(effect, added)
    if location is Location.MEASUREMENT:
        return {}
    # What a changed motion or reading adds to other balances is not where the effect acts.
    only = (location,) if location is Location.FORCE else tuple(added)
    return {name: added[name] ** 0.5 for name in only}


def balance_of_gap(shares: Mapping[str, float], evidence: Signatures) -> Location:
    """Return where the gap lies when no effect explains it: by unknown inputs and signatures."""
    if not any(shares.values()):
        return Location.NONE
    if min(_weighed(evidence.sensors)) < SENSOR * min(_weighed(evidence.inputs)):
        return Location.MEASUREMENT
    return Location(max(shares, key=lambda name: shares[name]))


def _weighed(left: Mapping[str, float]) -> list[float]:
    """Return the residuals that hypotheses leave, penalised for each free signal."""
    return [value * SIGNAL ** len(HYPOTHESES[name]) for name, value in left.items()]


def rival_sensor_effects(
    evidence: Signatures, catalogue: Mapping[str, EffectFactory]
) -> tuple[str, ...]:
    """Name the sensor errors whose signature fits the residuals about as well, the best first.

    Each cause once, whatever its forms. Among effects of the same sensor those with more states
    come first: their errors follow the motion more freely.
    """
    best = min(evidence.inputs.values())
    close = {
        name: value
        for name, value in evidence.sensors.items()
        if value < RIVAL * best and value < UNEXPLAINED * evidence.before
    }
    order = sorted(close, key=lambda name: close[name])
    made = sorted((make() for make in catalogue.values()), key=lambda effect: -len(effect.states))
    return tuple(
        dict.fromkeys(
            effect.cause
            for hypothesis in order
            for effect in made
            if effect.sensors and set(effect.sensors) <= set(HYPOTHESES[hypothesis])
        )
    )


def _added(
    study: Study, cause: Sequence[Effect], effect: Effect, fitted: FittedModel
) -> dict[str, float]:
    """Return what one of the effects adds to each balance, as a share of its signal's energy."""
    model = BalanceFunctions(study.axis.with_effects(*cause))
    parameters = model.axis.parameters
    theta = np.array([fitted.values[name] for name in parameters.names])
    without = theta.copy()
    for i, item in enumerate(parameters):
        if item.null is not None and item.name.startswith(f"{effect.name}."):
            without[i] = np.clip(item.null, item.lower, item.upper)
    train, held = study.smoothed
    shares = []
    records = held or train
    for data in records:
        change = balance_residuals(model, data, theta) - balance_residuals(model, data, without)
        mean = np.sum(change**2 * data.used(study.axis), axis=1) / data.m
        shares.append(mean / row_signals(study.axis, fitted.values, data) ** 2)
    means = np.average(shares, axis=0, weights=[data.m for data in records])
    return dict(zip(study.axis.equations, means.tolist(), strict=True))


def _acts_at(effect: Effect) -> Junction | None:
    """Return the junction at which an effect acts: not one where it only reads a flow."""
    readable = (Junction.VALVE_FLOW, Junction.OUTLET)
    acting = [name for name in effect.junctions if name not in readable]
    name = next(iter(acting or effect.junctions), None)
    return None if name is None else Junction(name)


def _junction(balance: Location, regimes: Sequence[Regime]) -> Junction | None:
    """Return the junction that a balance and its strongest regimes point to."""
    if balance is Location.NONE:
        return None
    if balance in (Location.FORCE, Location.MEASUREMENT):
        return Junction.FORCE if balance is Location.FORCE else Junction.OUTPUT
    pointed = (r.condition.kind.junction for r in regimes if r.balance is balance)
    return next((junction for junction in pointed if junction), Junction.CHAMBER_FLOW)


def _sensor_error(evidence: Signatures) -> SensorError:
    """Return the sensor whose error explains most of the residuals."""
    left = evidence.sensors
    sensor = min(left, key=lambda name: left[name])
    return SensorError(sensor, max(0.0, 1 - left[sensor] / evidence.before))
