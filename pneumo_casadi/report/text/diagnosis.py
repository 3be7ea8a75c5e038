"""A diagnosis in sentences."""

import textwrap
from collections.abc import Iterator, Sequence

from pneumo_casadi.diagnosis import Diagnosis, Verdict
from pneumo_casadi.diagnosis.metrics.findings import joined_names
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.refined_identification import with_refined_checks
from pneumo_casadi.diagnosis.wording.location_sentences import (
    location_sentences,
    locations_in_words,
)
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.tables.diagnosis import (
    BALANCES,
    GAP_DEFINITION,
    OUTSIDE,
    PROBABLE,
    builds_on_found,
    has_after,
    matters,
    nearest,
)
from pneumo_casadi.report.tables.quantities import between, chance, percent, whole
from pneumo_casadi.report.tables.table import plain
from pneumo_casadi.report.tables.verdict.estimates import diagnosis_tables
from pneumo_casadi.report.text.causes import (
    Catalogue,
    capitalised,
    cause_sentences,
    described_as,
    discovered_sentences,
    joined,
    without_underscores,
)
from pneumo_casadi.report.text.final_model import final_model, final_sentences, final_title
from pneumo_casadi.report.text.identification import WIDTH, render
from pneumo_casadi.report.text.parameter_checks import check_sentences, checks_of_what
from pneumo_casadi.report.text.reference import reference_line

#: A verdict in one or two words.
VERDICTS = {
    Verdict.EFFECT: "cause found",
    Verdict.AMBIGUOUS: "several causes possible",
    Verdict.ABSORBED: "parameters contradict geometry or data sheet",
    Verdict.UNKNOWN: "cause unknown",
    Verdict.NONE: "model and measurement agree",
}
FINDINGS_TITLE = "Correct the records first"
#: Candidates less probable than this are not named in a sentence.
WORTH_NAMING = 0.01
#: No advice to check the sensors first if every effect is more probable than this.
SURE = 0.85


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    gap = diagnosis.gap
    them = "it" if len(diagnosis.effects) == 1 else "them"
    them += " and the weak effects besides" if diagnosis.unnamed_effects else ""
    fall = (
        f"with {them} in the model the error on held-out data, beyond the sensor noise, "
        f"{_change(gap.before, gap.after)} of the signals"
    )
    if diagnosis.verdict is Verdict.EFFECT:
        names = joined([plain(effect.name) for effect in diagnosis.effects])
        verb = "explains" if len(diagnosis.effects) == 1 else "together explain"
        return f"{capitalised(names)} {verb} the difference between model and measurement: {fall}."
    if diagnosis.verdict is Verdict.AMBIGUOUS:
        names = joined([plain(joined_names(names)) for names in diagnosis.ambiguous], "or")
        added = joined([plain(effect.name) for effect in diagnosis.effects])
        if not names:
            names = "the effects below, of which the data single out none"
        return (
            "Several effects explain the difference between model and measurement equally well: "
            f"{names}; "
            + (f"with {added} in the model " if added else "")
            + "the error on held-out data, beyond the sensor noise, "
            + f"{_change(gap.before, gap.after)} of the signals."
        )
    if diagnosis.verdict is Verdict.ABSORBED:
        names = joined([plain(joined_names(names)) for names in diagnosis.ambiguous], "or")
        possible = f": {names} may be the cause" if names else ""
        if not (diagnosis.where.balance is Location.NONE or diagnosis.where.in_parameters):
            return (
                "The error of the simulation on held-out data, beyond the sensor noise, is "
                f"{percent(gap.before)} of the signals, and its parameters contradict geometry or "
                f"data sheet{possible}."
            )
        return (
            "The simulation agrees with the records, but its parameters contradict geometry or "
            f"data sheet{possible}."
        )
    if diagnosis.verdict is Verdict.UNKNOWN:
        term = gap.with_term
        falls = "" if term is None else f", with the discovered term {percent(term)}"
        return (
            "The model omits dynamics that no effect of the catalogue explains, alone or combined; "
            f"the error on held-out data, beyond the sensor noise, is {percent(gap.before)} of the "
            f"signals{falls}."
        )
    wrong = sum(not check.agrees for check in diagnosis.final_checks)
    but = f", but {wrong} of {len(diagnosis.final_checks)} parameter checks fail" if wrong else ""
    return (
        "Model and measurement agree: beyond the sensor noise they differ by "
        f"{percent(gap.before)} of the signals on held-out data{but}."
    )


def _change(before: float, after: float) -> str:
    verb = "falls" if after < before else "does not fall: it changes"
    return f"{verb} from {percent(before)} to {percent(after)}"


def finding_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return what is wrong with the records, to be corrected before a cause is looked for."""
    return tuple(finding.sentence for finding in diagnosis.findings)


def where_sentences(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return where model and measurement disagree, in words."""
    sentences = location_sentences(diagnosis.where)
    return tuple(capitalised(without_underscores(text, catalogue)) for text in sentences)


def refused_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return how many candidates do not matter, and the most that one of them removes."""
    shown = sum(matters(diagnosis, item) for item in diagnosis.ranking)
    others = [item for item in diagnosis.ranking if not matters(diagnosis, item)]
    if not others:
        return ()
    alone = [item for item in others if not builds_on_found(diagnosis, item)]
    closures = [item.closure.value for item in alone if item.closure is not None]
    without = "" if len(alone) == len(others) else " without the effects found"
    largest = whole(max(PROBABLE, *closures)) if closures else ""
    most = f", and none removes more than {largest} of the gap{without}" if closures else ""
    lead = "Further candidates" if shown else "Candidates"
    failed = sum(bool(item.failure) for item in others)
    end = f"; the fit of {failed} failed or gave values that physics excludes" if failed else ""
    return (
        f"{lead} that were refused: {len(others)}. None reaches a probability of "
        f"{whole(PROBABLE)}{most}{end}. All are in diagnosis.json.",
    )


def note_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the notes, without those on candidates that do not matter."""
    refused = [item for item in diagnosis.ranking if not matters(diagnosis, item)]
    left_out = {
        without_underscores(f"{item.label}: {item.failure}") for item in refused if item.failure
    }
    # Notes name the forms that were fitted, the ranking their causes.
    notes = map(without_underscores, diagnosis.notes)
    return tuple(text for text in dict.fromkeys(notes) if text not in left_out)


def size_title(diagnosis: Diagnosis) -> str:
    """Return the heading of the section on the size of the gap."""
    return "Reduction of the gap" if has_after(diagnosis) else "Size of the gap"


def size_sentences(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return what the gap is, its size, and the share that the effects remove."""
    gap, closure = diagnosis.gap, diagnosis.gap.closure
    noise = f"The sensor noise itself, {percent(gap.noise_floor)}, is already subtracted."
    floor = (noise,) if gap.noise_floor > 0 else ()
    before = f"The gap of the model without effects is {percent(gap.before)}"
    term = gap.with_term
    sentences = () if term is None else (f"With the discovered term it is {percent(term)}.",)
    if not has_after(diagnosis):
        return GAP_DEFINITION, f"{before}.", *sentences, *floor
    if not diagnosis.effects:
        names = joined(nearest(diagnosis))
        which = f"{names}, the best candidate," if names else "the best candidate"
        after = f"{before}; with {which} it is {percent(gap.after)}."
        return GAP_DEFINITION, after, *sentences, *floor
    names = joined([plain(effect.name) for effect in diagnosis.final_effects])
    return (
        GAP_DEFINITION,
        f"{before}; with {names} it is {percent(gap.after)}.",
        f"The reduction is {whole(closure.value)} of the gap (95 % interval {between(closure)}).",
        *floor,
    )


def alternative_sentences(diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS) -> tuple[str, ...]:
    """Return other possible causes, and the experiment that would separate them."""
    odds_of = {candidate.names: candidate.probability for candidate in diagnosis.ranking}
    parts: list[str] = []
    for names in diagnosis.ambiguous:
        meaning = " ".join(described_as(name, catalogue) for name in names)
        odds = f" (probability {chance(odds_of[names])})" if names in odds_of else ""
        parts.append(f"{capitalised(plain(joined_names(names)))}{odds}: {meaning}")
    if not diagnosis.ambiguous and diagnosis.verdict is Verdict.EFFECT:
        cause = {effect.name for effect in (*diagnosis.effects, *diagnosis.undecided)}
        others = [candidate for candidate in diagnosis.ranking if set(candidate.names) != cause]
        close = [candidate for candidate in others if candidate.probability >= WORTH_NAMING][:3]
        parts += [
            f"Next in the ranking: {plain(candidate.label)}, "
            f"probability {chance(candidate.probability)}."
            for candidate in close
        ]
        if not close and not diagnosis.where.rivals:
            parts.append("No other effect of the catalogue explains these data.")
    outside = 1 - sum(candidate.probability for candidate in diagnosis.ranking)
    if diagnosis.effects and outside > OUTSIDE:
        parts.append(
            f"The probability that the cause is not in the catalogue is {chance(outside)}."
        )
    if diagnosis.verdict is Verdict.UNKNOWN and diagnosis.hint and diagnosis.discovered is None:
        parts.append(f"Hint: {without_underscores(diagnosis.hint, catalogue)}.")
    sure = diagnosis.verdict is Verdict.EFFECT and all(
        effect.probability > SURE for effect in diagnosis.effects
    )
    if diagnosis.where.rivals and not sure:
        parts.append(
            "Before you look for a cause in the axis, check the sensors: "
            f"{joined([plain(name) for name in diagnosis.where.rivals], 'or')} would give a "
            "similar error."
        )
    if diagnosis.experiment:
        parts.append(f"Experiment that separates them: {plain(diagnosis.experiment)}.")
    return tuple(parts)


def location_text(diagnosis: Diagnosis) -> str:
    """Return the locations in which model and measurement disagree, in a few words."""
    if diagnosis.where.balance is Location.NONE:
        absorbed = diagnosis.verdict is Verdict.ABSORBED
        return "in parameters, not in the simulation" if absorbed else BALANCES[Location.NONE]
    words = locations_in_words(diagnosis.where.balances).removeprefix("the ")
    return f"in parameters: {words}" if diagnosis.where.in_parameters else words


def summary_text(
    diagnosis: Diagnosis, catalogue: Catalogue = EFFECTS, refined: Identification | None = None
) -> str:
    """Return a diagnosis as plain text: sentences first, tables after them.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    catalogue : mapping of str to effect class, optional
        Where the effects are described.
    refined : Identification, optional
        The final model refined by output error.
    """
    diagnosis = with_refined_checks(diagnosis, refined)
    final = None if refined is None else final_model(refined)
    values = None if final is None else final.values
    checks = [f"{result}: {text}" for result, text in check_sentences(diagnosis)]
    sections = [
        ("Where model and measurement disagree", where_sentences(diagnosis, catalogue)),
        (
            "Effects found" if diagnosis.final_effects else "Candidate causes",
            (*cause_sentences(diagnosis, catalogue, values), *refused_sentences(diagnosis)),
        ),
        (size_title(diagnosis), size_sentences(diagnosis)),
        (final_title(diagnosis), final_sentences(diagnosis, final)),
        ("Other possible causes", alternative_sentences(diagnosis, catalogue)),
        ("Discovered term", discovered_sentences(diagnosis)),
        (
            "Parameters compared with geometry and data sheet",
            (*checks_of_what(diagnosis), *checks),
        ),
        ("Notes", note_sentences(diagnosis)),
    ]
    title = f"Diagnosis of {diagnosis.case}: {VERDICTS[diagnosis.verdict]}"
    head = [title, "=" * len(title)]
    head += _section(FINDINGS_TITLE, finding_sentences(diagnosis))
    head += ["", textwrap.fill(headline(diagnosis), WIDTH)]
    body = [line for name, sentences in sections for line in _section(name, sentences)]
    shown = [*([] if final is None else final.tables), *diagnosis_tables(diagnosis, values)]
    tables = [render(table) for table in shown]
    end = f"Computing time: {diagnosis.seconds:.0f} s."
    reference = reference_line("\n".join([*body, *tables]))
    last = [*tables, *([reference] if reference else []), end]
    return "\n".join([*head, *body]) + "\n\n\n" + "\n\n\n".join(last) + "\n"


def _section(name: str, sentences: Sequence[str]) -> Iterator[str]:
    if not sentences:
        return
    yield from ("", name, "-" * len(name))
    for sentence in sentences:
        yield textwrap.fill(sentence, WIDTH, initial_indent="- ", subsequent_indent="  ")
