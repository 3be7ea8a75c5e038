"""A diagnosis in words that a technician understands."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence

from pneumo_casadi.diagnosis import Diagnosis, EffectFound, Verdict
from pneumo_casadi.diagnosis.metrics.findings import joined_names
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


def headline(found: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    gap = found.gap
    fall = (
        f"with {'it' if len(found.effects) == 1 else 'them'} in the model the error on held-out "
        f"data {_goes(gap.before, gap.after)} of the signals"
    )
    if found.verdict is Verdict.EFFECT:
        names = joined([plain(one.name) for one in found.effects])
        verb = "explains" if len(found.effects) == 1 else "together explain"
        return f"{_capital(names)} {verb} the gap between simulation and reality: {fall}."
    if found.verdict is Verdict.AMBIGUOUS:
        names = joined([plain(joined_names(names)) for names in found.ambiguous], "or")
        added = joined([plain(one.name) for one in found.effects])
        return (
            f"The gap has one of these causes, and the data cannot tell which: {names}; "
            + (f"with {added} in the model the error on held-out data " if added else "it ")
            + f"{_goes(gap.before, gap.after)} of the signals."
        )
    if found.verdict is Verdict.ABSORBED:
        names = joined([plain(joined_names(names)) for names in found.ambiguous], "or")
        hidden = f": {names} may hide there" if names else ""
        if found.where.balance != "none":
            return (
                f"The simulation errs on held-out data by {percent(gap.before)} of the signals, "
                f"and its parameters contradict geometry or data sheet{hidden}."
            )
        return (
            "The simulation follows the records, but with parameters that contradict geometry or "
            f"data sheet{hidden}."
        )
    if found.verdict is Verdict.UNKNOWN:
        return (
            "Something is missing in the model that no effect of the catalogue explains, alone or "
            f"together; the error on held-out data is {percent(gap.before)} of the signals."
        )
    wrong = sum(not one.agrees for one in found.checks)
    but = f", but {wrong} of {len(found.checks)} checks of parameters fail" if wrong else ""
    return (
        "Nothing is wrong that matters: beyond noise, simulation and held-out data differ by "
        f"{percent(gap.before)} of the signals{but}."
    )


def _goes(before: float, after: float) -> str:
    verb = "falls" if after < before else "does not fall: it goes"
    return f"{verb} from {percent(before)} to {percent(after)}"


def cause_sentences(found: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return what was added to the model, one sentence an effect, with sizes ± 2σ."""
    return tuple(_cause(one, catalogue) for one in found.effects)


def _cause(one: EffectFound, catalogue: Catalogue) -> str:
    known = catalogue.get(one.name)
    described = {item.name: item.description for item in known().parameters} if known else {}
    largest = sorted(one.parameters, key=lambda name: -abs(one.parameters[name].value))[:TOLD]
    sizes = [
        f"{name} = {quantity(value)}" + (f" ({described[name]})" if name in described else "")
        for name, value in one.parameters.items()
        if len(one.parameters) <= TOLD or name in largest
    ]
    if len(one.parameters) > TOLD:
        sizes.append(f"and {len(one.parameters) - TOLD} smaller")
    size = f" Its size: {'; '.join(sizes)}." if sizes else ""
    return (
        f"{_capital(plain(one.name))} (probability {chance(one.probability)}): "
        f"{described_as(one.name, catalogue)}{size}"
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


def where_sentences(found: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return where the gap lies, in words."""
    return tuple(said_plainly(text, catalogue) for text in found.where.words)


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


def size_title(found: Diagnosis) -> str:
    """Return the heading of what is said of the gap's size."""
    return "How far the gap closes" if has_after(found) else "How large the gap is"


def size_sentences(found: Diagnosis) -> tuple[str, ...]:
    """Return how far the gap closes."""
    gap, closure = found.gap, found.gap.closure
    noise = f"Noise of the sensors alone leaves {percent(gap.noise_floor)}; it is taken off here."
    floor = (noise,) if gap.noise_floor > 0 else ()
    before = (
        f"On data that no fit has seen, the model without effects is off by {percent(gap.before)} "
        "of the signals"
    )
    if not has_after(found):
        return f"{before}.", *floor
    if not found.effects:
        names = joined([plain(name) for name in nearest(found)])
        which = f"{names}, the nearest of the catalogue," if names else "the nearest of them"
        return f"{before}; with {which} by {percent(gap.after)}.", *floor
    return (
        f"{before}; with {joined([plain(e.name) for e in found.effects])} by {percent(gap.after)}.",
        f"That closes {whole(closure.value)} of the gap (95 % interval {between(closure)}).",
        *floor,
    )


def alternative_sentences(found: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return what else it could be, and what would tell."""
    odds_of = {one.names: one.probability for one in found.ranking}
    parts: list[str] = []
    for names in found.ambiguous:
        meaning = " ".join(described_as(name, catalogue) for name in names)
        odds = f" (probability {chance(odds_of[names])})" if names in odds_of else ""
        parts.append(f"{_capital(plain(joined_names(names)))}{odds}: {meaning}")
    if not found.ambiguous and found.verdict is Verdict.EFFECT:
        others = [one for one in found.ranking if set(one.names) != {e.name for e in found.effects}]
        close = [one for one in others if one.probability >= WORTH_NAMING][:3]
        parts += [
            f"Next in the ranking: {plain(one.label)}, probability {chance(one.probability)}."
            for one in close
        ]
        if not close:
            parts.append("No other effect of the catalogue explains these data.")
    outside = 1 - sum(one.probability for one in found.ranking)
    if found.effects and outside > OUTSIDE:
        parts.append(f"That the cause is none of the catalogue has probability {chance(outside)}.")
    if found.verdict is Verdict.UNKNOWN and found.hint:
        parts.append(f"A hint: {said_plainly(found.hint, catalogue)}.")
    sure = found.verdict is Verdict.EFFECT and min(e.probability for e in found.effects) > SURE
    if found.where.rivals and not sure:
        parts.append(
            "Before you look for a cause in the axis, check the sensors: "
            f"{joined([plain(name) for name in found.where.rivals], 'or')} would look much the "
            "same."
        )
    if found.experiment:
        parts.append(f"An experiment that would tell: {plain(found.experiment)}.")
    return tuple(parts)


def check_sentences(found: Diagnosis) -> tuple[tuple[bool, str], ...]:
    """Return each check of the parameters: whether it agrees, and its text; failures first."""
    return tuple((one.agrees, one.text) for one in sorted(found.checks, key=lambda one: one.agrees))


def place(found: Diagnosis) -> str:
    """Return where the gap lies, in a few words."""
    return BALANCES.get(found.where.balance, plain(found.where.balance))


def summary_text(found: Diagnosis, catalogue: Catalogue = EFFECTS) -> str:
    """Return a diagnosis as plain text: sentences first, tables after them.

    Parameters
    ----------
    found : Diagnosis
        What was found.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    """
    checks = [f"{'ok ' if ok else 'NOT'}  {text}" for ok, text in check_sentences(found)]
    sections = [
        ("Where", where_sentences(found, catalogue)),
        ("Which effect", cause_sentences(found, catalogue)),
        (size_title(found), size_sentences(found)),
        ("What else it could be", alternative_sentences(found, catalogue)),
        ("Parameters against geometry and data sheet", checks),
        ("Notes", found.notes),
    ]
    title = f"Diagnosis of {found.case}: {VERDICTS[found.verdict]}"
    head = [title, "=" * len(title), "", textwrap.fill(headline(found), WIDTH)]
    body = [line for name, sentences in sections for line in _section(name, sentences)]
    tables = [render(table) for table in diagnosis_tables(found)]
    end = f"Took {found.seconds:.0f} s."
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
