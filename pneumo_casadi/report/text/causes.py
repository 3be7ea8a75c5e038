"""The causes that a diagnosis names, and the term that it discovered, in sentences."""

import re
from collections.abc import Mapping, Sequence

from pneumo_casadi.diagnosis import Diagnosis, EffectFound, Value
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.report.tables.diagnosis import BALANCES
from pneumo_casadi.report.tables.quantities import between, chance, quantity, short_quantity, whole
from pneumo_casadi.report.tables.table import cause_name, plain, with_symbols

Catalogue = Mapping[str, type[Effect]]

#: Largest number of parameters of an effect in a sentence.
TOLD = 4
#: Drivers of a discovered term in words.
DRIVER_NAMES = {
    "x": "the position x",
    "v": "the velocity v",
    "t": "time t",
    "p_P": "the pressure p_P",
    "p_N": "the pressure p_N",
    "p_mean": "the mean of both pressures",
    "p_difference": "the difference of the pressures",
    "u": "the command of the valve",
    "p": "the pressure of the chamber",
    "p_other": "the pressure of the other chamber",
    "F": "the force of the drive F",
    "t_reversal": "the time since the last reversal",
    "s_reversal": "the travel since the last reversal",
}
#: What may act over a driver, where it repeats and where it does not.
_SUSPECTS = {
    "x": (
        "the pitch of a belt, screw or rack, the poles of a motor or magnet, the period of a scale",
        "a guide or bore that is tight in places, a cable chain or hose, a spring, magnets",
    ),
    "v": ("a resonance", "friction of another form, a damper, an eddy current"),
    "t": ("the mains, a pump or a neighbouring machine", "warming up, a supply that drifts"),
    "p_P": ("", "seals that press harder with pressure, the linearity of a sensor"),
    "p_N": ("", "seals that press harder with pressure, the linearity of a sensor"),
    "p_mean": ("", "seals that press harder with pressure"),
    "p_difference": ("", "a load on the guides, an elastic frame, a leak across the piston"),
    "u": ("", "shape or hysteresis of the valve"),
    "p": ("", "a leak or a restriction at this chamber"),
    "p_other": ("", "a leak across the piston, crosstalk of the sensors"),
    "F": ("", "the amplifier or the motor"),
    "t_reversal": ("", "creep, presliding, play"),
    "s_reversal": ("", "presliding, play, a belt that stretches"),
}
#: The same of what shifts the command of a valve.
_SHIFTED = ("dither or ripple of the command", "a null of the valve that warms up or wanders")


def cause_sentences(
    diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS, final: Mapping[str, Value] | None = None
) -> tuple[str, ...]:
    """Return what was added to the model, one sentence an effect, with sizes ± 2σ.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    final : mapping of str to Value, optional
        Parameters of the final model: where they have an interval, the sizes are theirs.
    """
    return (
        *(_cause(effect, catalogue, final or {}) for effect in diagnosis.effects),
        *(_undecided(effect) for effect in diagnosis.undecided),
        *_besides(diagnosis.besides),
        *_corrections(diagnosis.corrections),
        *_absorbed(diagnosis),
    )


def _besides(effects: Sequence[EffectFound]) -> tuple[str, ...]:
    """Return the sentence on effects that are probably also there; none without any."""
    if not effects:
        return ()
    names = joined([either(effect) for effect in effects])
    return (f"Probably also there, each too small to be named as a cause: {names}.",)


def _corrections(effects: Sequence[EffectFound]) -> tuple[str, ...]:
    """Return the sentence on effects that correct the flow map; none without any."""
    if not effects:
        return ()
    names = capitalised(joined([plain(effect.name) for effect in effects]))
    return (f"{names} corrects what the form of the flow map misses, and is no cause.",)


def _absorbed(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the sentence on effects that the parameters have taken up; none without any."""
    if not diagnosis.absorbed:
        return ()
    wrong = joined([check.name for check in diagnosis.final_checks if not check.agrees])
    names = joined([plain(name) for name in diagnosis.absorbed])
    return (
        f"Also there, absorbed by the parameters: {names}. It shows in the fitted {wrong}, not in "
        "the simulation.",
    )


def either(effect: EffectFound) -> str:
    """Return the name of an effect, with those that may act in its place."""
    return joined([plain(name) for name in (effect.name, *effect.rivals)], "or")


def _undecided(effect: EffectFound) -> str:
    names = _with_chances({effect.name: effect.probability, **effect.rivals})
    return f"Also there: {joined(names, 'or')}; the data cannot tell which.{_share(effect)}"


def _cause(effect: EffectFound, catalogue: Catalogue, final: Mapping[str, Value]) -> str:
    known = catalogue.get(effect.form)
    described = {item.name: item.description for item in known().parameters} if known else {}
    parameters = dict(effect.parameters)
    for name in parameters:
        refined = final.get(f"{effect.form}.{name}")
        if refined is not None and refined.std > 0:
            parameters[name] = refined
    largest = sorted(parameters, key=lambda name: -abs(parameters[name].value))[:TOLD]
    sizes = [
        f"{with_symbols(name)} = {quantity(value)}"
        + (f" ({described[name]})" if name in described else "")
        for name, value in parameters.items()
        if len(parameters) <= TOLD or name in largest
    ]
    if len(parameters) > TOLD:
        sizes.append(f"and {len(parameters) - TOLD} smaller ones")
    size = f" Parameters: {'; '.join(sizes)}." if sizes else ""
    return (
        f"{capitalised(plain(effect.name))} (probability {chance(effect.probability)}): "
        f"{described_as(effect.form, catalogue)}{size}"
        f"{_share(effect)}{_rivals(effect)}{_forms(effect)}"
    )


def _share(effect: EffectFound) -> str:
    """Return how much of the gap comes back without an effect, if that was worked out."""
    if not effect.contribution:
        return ""
    return f" Without it {whole(effect.contribution)} of the gap comes back."


def _rivals(effect: EffectFound) -> str:
    """Return which other causes do nearly as well."""
    if not effect.rivals:
        return ""
    others = joined(_with_chances(effect.rivals))
    return f" The data hardly tell it from {others}, which fits nearly as well."


def _with_chances(probabilities: Mapping[str, float]) -> list[str]:
    return [f"{plain(name)} ({chance(share)})" for name, share in probabilities.items()]


def _forms(effect: EffectFound) -> str:
    """Return which form of the cause fits best, and what the others close."""
    others = {name: closed for name, closed in effect.forms.items() if name != effect.form}
    if not others:
        return ""
    rest = joined([f"{plain(name)} {whole(closed)}" for name, closed in others.items()])
    if effect.form not in effect.forms:
        own = f"{plain(effect.form)} was fitted beside other effects only"
        return f" Of its forms {own}; in the balances alone the others close: {rest}."
    own = f"{plain(effect.form)} closes {whole(effect.forms[effect.form])} in the balances alone"
    return f" Of its forms {own}, {rest}."


def described_as(name: str, catalogue: Catalogue = EFFECTS) -> str:
    """Return what an effect is, in one sentence.

    Examples
    --------
    >>> described_as("stribeck")
    'Extra friction near standstill that decays with speed.'
    >>> described_as("one of your own")
    'An effect of your own.'
    """
    known = catalogue.get(name)
    text = (known.__doc__ or "").strip() if known else ""
    if not text:
        return "An effect of your own."
    return without_underscores(text.splitlines()[0].replace("`", ""), catalogue)


def without_underscores(text: str, catalogue: Catalogue = EFFECTS) -> str:
    """Return a sentence with the names of effects in plain words, forms by that of their cause.

    Examples
    --------
    >>> without_underscores("position_delay may be part of it; k_P is 1.2")
    'position delay may be part of it; k_P is 1.2'
    >>> without_underscores("valve_mismatch.epsilon = 1 is not credible")
    'valve mismatch: epsilon = 1 is not credible'
    """
    for name in sorted({*EFFECTS, *catalogue}, key=len, reverse=True):
        of_effect = rf"(?<!\w){re.escape(name)}"
        text = re.sub(rf"{of_effect}\.(?=[A-Za-z])", f"{cause_name(name)}: ", text)
        text = re.sub(rf"{of_effect}(?!\w)", cause_name(name), text)
    return text


def discovered_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return what a discovered term is, its parameters with 95 % intervals, and its closure."""
    if diagnosis.discovered is None:
        return ()
    term = diagnosis.discovered
    where = joined([BALANCES[Location(name)] for name in term.balance.split(" + ")])
    beside = f" beside {joined([cause_name(name) for name in term.beside])}" if term.beside else ""
    # Where the model was fitted again with the term, its parameters are those of the tables.
    fitted = {
        name: diagnosis.with_term.get(f"{term.term.name}.{name}", value)
        for name, value in term.parameters.items()
    }
    sizes = "; ".join(f"{name} = {quantity(value)}" for name, value in fitted.items())
    return (
        f"A term over {DRIVER_NAMES[term.term.driver]} in the {where}{beside} "
        f"closes {whole(term.closes.value)} of the held-out gap of the balances (95 % interval "
        f"{between(term.closes)}).",
        f"Formula: {_formula(term)} [{term.term.unit}], with {sizes}.",
        f"It is a description, not a cause: look for what acts over {suspects(term)}.",
    )


def _formula(discovered: DiscoveredTerm) -> str:
    """Return the formula of a term; of a shift, with the commands that it is added to."""
    term = discovered.term
    return term.text if term.shifts_command else term.expression


def suspects(term: DiscoveredTerm) -> str:
    """Return the driver of a discovered term, and what acts over it on axes."""
    driver = term.term.driver
    repeats = "period" in term.term.parameters
    known = _SHIFTED if term.term.shifts_command else _SUSPECTS[driver]
    examples = known[0 if repeats else 1]
    name = DRIVER_NAMES[driver] + (", again and again" if repeats else "")
    return name + (f", such as {examples}" if examples else "")


def discovered_fact(discovered: DiscoveredTerm) -> str:
    """Return a discovered term in a few words: formula, sizes without intervals, closure."""
    sizes = ", ".join(
        f"{name} {short_quantity(item)}"
        for name, item in discovered.parameters.items()
        if name != "phase"
    )
    closes = f"closes {whole(discovered.closes.value)} of the gap of the balances"
    return f"{_formula(discovered)}; {sizes}; {closes}"


def joined(words: Sequence[str], last: str = "and") -> str:
    """Return words as one enumeration.

    Examples
    --------
    >>> joined(["a", "b", "c"], "or")
    'a, b or c'
    """
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def capitalised(text: str) -> str:
    """Return a text that begins with a capital letter; the rest as it is."""
    return text[:1].upper() + text[1:]
