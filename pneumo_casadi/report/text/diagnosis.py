"""A diagnosis in words that a technician understands."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence

from pneumo_casadi.diagnosis import Diagnosis, EffectFound, Verdict
from pneumo_casadi.diagnosis.metrics.findings import joined_names
from pneumo_casadi.diagnosis.wording.location_sentences import location_sentences
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.report.tables.diagnosis import (
    BALANCES,
    between,
    chance,
    diagnosis_tables,
    has_after,
    nearest,
    percent,
    plain,
    quantity,
    whole,
)
from pneumo_casadi.report.text.identification import WIDTH, render

Catalogue = Mapping[str, type[Effect]]

#: A verdict in one or two words.
VERDICTS = {
    Verdict.EFFECT: "cause found",
    Verdict.AMBIGUOUS: "several causes possible",
    Verdict.ABSORBED: "hidden in the parameters",
    Verdict.UNKNOWN: "cause unknown",
    Verdict.NONE: "nothing wrong",
}
#: Candidates less probable than this are not worth a sentence.
WORTH_NAMING = 0.01
#: An effect more probable than this sends nobody to the sensors first.
SURE = 0.85
#: Parameters of one effect that a sentence tells at most.
TOLD = 4
#: What is left for causes outside the catalogue is told from this probability on.
OUTSIDE = 0.1


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    gap = diagnosis.gap
    them = "it" if len(diagnosis.effects) == 1 else "them"
    fall = (
        f"with {them} in the model the error on held-out data "
        f"{_goes(gap.before, gap.after)} of the signals"
    )
    if diagnosis.verdict is Verdict.EFFECT:
        names = joined([plain(effect.name) for effect in diagnosis.effects])
        verb = "explains" if len(diagnosis.effects) == 1 else "together explain"
        return f"{_capital(names)} {verb} the gap between simulation and reality: {fall}."
    if diagnosis.verdict is Verdict.AMBIGUOUS:
        names = joined([plain(joined_names(names)) for names in diagnosis.ambiguous], "or")
        added = joined([plain(effect.name) for effect in diagnosis.effects])
        return (
            f"The gap has one of these causes, and the data cannot tell which: {names}; "
            + (f"with {added} in the model the error on held-out data " if added else "it ")
            + f"{_goes(gap.before, gap.after)} of the signals."
        )
    if diagnosis.verdict is Verdict.ABSORBED:
        names = joined([plain(joined_names(names)) for names in diagnosis.ambiguous], "or")
        hidden = f": {names} may hide there" if names else ""
        if diagnosis.where.balance != "none":
            return (
                f"The simulation errs on held-out data by {percent(gap.before)} of the signals, "
                f"and its parameters contradict geometry or data sheet{hidden}."
            )
        return (
            "The simulation follows the records, but with parameters that contradict geometry or "
            f"data sheet{hidden}."
        )
    if diagnosis.verdict is Verdict.UNKNOWN:
        return (
            "Something is missing in the model that no effect of the catalogue explains, alone or "
            f"together; the error on held-out data is {percent(gap.before)} of the signals."
        )
    wrong = sum(not check.agrees for check in diagnosis.checks)
    but = f", but {wrong} of {len(diagnosis.checks)} checks of parameters fail" if wrong else ""
    return (
        "Nothing is wrong that matters: beyond noise, simulation and held-out data differ by "
        f"{percent(gap.before)} of the signals{but}."
    )


def _goes(before: float, after: float) -> str:
    verb = "falls" if after < before else "does not fall: it goes"
    return f"{verb} from {percent(before)} to {percent(after)}"


def cause_sentences(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return what was added to the model, one sentence an effect, with sizes ± 2σ."""
    return tuple(_cause(effect, catalogue) for effect in diagnosis.effects)


def _cause(effect: EffectFound, catalogue: Catalogue) -> str:
    known = catalogue.get(effect.name)
    described = {item.name: item.description for item in known().parameters} if known else {}
    largest = sorted(effect.parameters, key=lambda name: -abs(effect.parameters[name].value))[:TOLD]
    sizes = [
        f"{name} = {quantity(value)}" + (f" ({described[name]})" if name in described else "")
        for name, value in effect.parameters.items()
        if len(effect.parameters) <= TOLD or name in largest
    ]
    if len(effect.parameters) > TOLD:
        sizes.append(f"and {len(effect.parameters) - TOLD} smaller")
    size = f" Its size: {'; '.join(sizes)}." if sizes else ""
    return (
        f"{_capital(plain(effect.name))} (probability {chance(effect.probability)}): "
        f"{described_as(effect.name, catalogue)}{size}"
    )


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
    return text.splitlines()[0].replace("`", "") if text else "An effect of your own."


def where_sentences(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return where the gap lies, in words."""
    return tuple(said_plainly(text, catalogue) for text in location_sentences(diagnosis.where))


def said_plainly(text: str, catalogue: Catalogue = EFFECTS) -> str:
    """Return a sentence with the names of effects as one says them.

    Examples
    --------
    >>> said_plainly("position_delay may be part of it; k_P is 1.2")
    'position delay may be part of it; k_P is 1.2'
    """
    for name in sorted({*EFFECTS, *catalogue}, key=len, reverse=True):
        text = text.replace(name, plain(name))
    return text


def size_title(diagnosis: Diagnosis) -> str:
    """Return the heading of what is said of the gap's size."""
    return "How far the gap closes" if has_after(diagnosis) else "How large the gap is"


def size_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return how far the gap closes."""
    gap, closure = diagnosis.gap, diagnosis.gap.closure
    noise = f"Noise of the sensors alone leaves {percent(gap.noise_floor)}; it is taken off here."
    floor = (noise,) if gap.noise_floor > 0 else ()
    before = (
        f"On data that no fit has seen, the model without effects is off by {percent(gap.before)} "
        "of the signals"
    )
    if not has_after(diagnosis):
        return f"{before}.", *floor
    if not diagnosis.effects:
        names = joined([plain(name) for name in nearest(diagnosis)])
        which = f"{names}, the nearest of the catalogue," if names else "the nearest of them"
        return f"{before}; with {which} by {percent(gap.after)}.", *floor
    names = joined([plain(effect.name) for effect in diagnosis.effects])
    return (
        f"{before}; with {names} by {percent(gap.after)}.",
        f"That closes {whole(closure.value)} of the gap (95 % interval {between(closure)}).",
        *floor,
    )


def alternative_sentences(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return what else it could be, and what would tell."""
    odds_of = {candidate.names: candidate.probability for candidate in diagnosis.ranking}
    parts: list[str] = []
    for names in diagnosis.ambiguous:
        meaning = " ".join(described_as(name, catalogue) for name in names)
        odds = f" (probability {chance(odds_of[names])})" if names in odds_of else ""
        parts.append(f"{_capital(plain(joined_names(names)))}{odds}: {meaning}")
    if not diagnosis.ambiguous and diagnosis.verdict is Verdict.EFFECT:
        cause = {effect.name for effect in diagnosis.effects}
        others = [candidate for candidate in diagnosis.ranking if set(candidate.names) != cause]
        close = [candidate for candidate in others if candidate.probability >= WORTH_NAMING][:3]
        parts += [
            f"Next in the ranking: {plain(candidate.label)}, "
            f"probability {chance(candidate.probability)}."
            for candidate in close
        ]
        if not close:
            parts.append("No other effect of the catalogue explains these data.")
    outside = 1 - sum(candidate.probability for candidate in diagnosis.ranking)
    if diagnosis.effects and outside > OUTSIDE:
        parts.append(f"That the cause is none of the catalogue has probability {chance(outside)}.")
    if diagnosis.verdict is Verdict.UNKNOWN and diagnosis.hint:
        parts.append(f"A hint: {said_plainly(diagnosis.hint, catalogue)}.")
    sure = diagnosis.verdict is Verdict.EFFECT and all(
        effect.probability > SURE for effect in diagnosis.effects
    )
    if diagnosis.where.rivals and not sure:
        parts.append(
            "Before you look for a cause in the axis, check the sensors: "
            f"{joined([plain(name) for name in diagnosis.where.rivals], 'or')} would look much the "
            "same."
        )
    if diagnosis.experiment:
        parts.append(f"An experiment that would tell: {plain(diagnosis.experiment)}.")
    return tuple(parts)


def check_sentences(diagnosis: Diagnosis) -> tuple[tuple[bool, str], ...]:
    """Return each check of the parameters: whether it agrees, and its text; failures first."""
    return tuple(
        (check.agrees, check.text)
        for check in sorted(diagnosis.checks, key=lambda check: check.agrees)
    )


def place(diagnosis: Diagnosis) -> str:
    """Return where the gap lies, in a few words."""
    return BALANCES.get(diagnosis.where.balance, plain(diagnosis.where.balance))


def summary_text(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> str:
    """Return a diagnosis as plain text: sentences first, tables after them.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    """
    checks = [f"{'ok ' if ok else 'NOT'}  {text}" for ok, text in check_sentences(diagnosis)]
    sections = [
        ("Where", where_sentences(diagnosis, catalogue)),
        ("Which effect", cause_sentences(diagnosis, catalogue)),
        (size_title(diagnosis), size_sentences(diagnosis)),
        ("What else it could be", alternative_sentences(diagnosis, catalogue)),
        ("Parameters against geometry and data sheet", checks),
        ("Notes", diagnosis.notes),
    ]
    title = f"Diagnosis of {diagnosis.case}: {VERDICTS[diagnosis.verdict]}"
    head = [title, "=" * len(title), "", textwrap.fill(headline(diagnosis), WIDTH)]
    body = [line for name, sentences in sections for line in _section(name, sentences)]
    tables = [render(table) for table in diagnosis_tables(diagnosis)]
    end = f"Took {diagnosis.seconds:.0f} s."
    return "\n".join([*head, *body]) + "\n\n\n" + "\n\n\n".join([*tables, end]) + "\n"


def _section(name: str, sentences: Sequence[str]) -> Iterator[str]:
    if not sentences:
        return
    yield from ("", name, "-" * len(name))
    for sentence in sentences:
        yield textwrap.fill(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")


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


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
