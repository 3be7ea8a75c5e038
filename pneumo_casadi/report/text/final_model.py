"""What a diagnosis reports of its final model, refined by output error."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pneumo_casadi.diagnosis import Diagnosis, Value, Verdict
from pneumo_casadi.diagnosis.refined_identification import taken_up
from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import Usability, Usable
from pneumo_casadi.report.tables.laboratory import estimate_table, laboratory_tables
from pneumo_casadi.report.tables.parameters import INTERVALS
from pneumo_casadi.report.tables.table import Table, plain, with_symbols
from pneumo_casadi.report.text.causes import joined

#: Title of the section.
TITLE = "Parameters to use: final model refined by output error"
#: The same where the cause is unknown.
TITLE_WITHOUT_CAUSE = "Final model refined by output error: not to be used"
#: The same where its parameters contradict geometry or data sheet.
TITLE_ABSORBED = "Final model refined by output error: not all of it to be used"


@dataclass(frozen=True, slots=True)
class FinalModel:
    """The final model as a report shows it.

    Parameters
    ----------
    usability : Usability
        Whether it can be used.
    mass : str
        The moving mass with its interval; empty where it was not estimated.
    tables : tuple of Table
        Its parameters, in laboratory terms first.
    values : mapping of str to Value
        All of them; those that were held have no standard deviation.
    least : str
        The least certain one that the axis or its effects have, with its interval.
    """

    usability: Usability
    mass: str
    tables: tuple[Table, ...]
    values: Mapping[str, Value]
    least: str = ""


def final_model(refined: Identification | Mapping[str, Any]) -> FinalModel:
    """Return what is shown of a final model.

    Parameters
    ----------
    refined : Identification or mapping
        The model refined by output error, or the plain values of its ``result.json``.
    """
    content = result_dict(refined) if isinstance(refined, Identification) else refined
    usability = Usability(Usable(content["usable"]), content["reason"])
    terms, table = laboratory_tables(content), estimate_table(content).without("WLS")
    coefficients = tuple(row for row in table.rows if row[0].startswith("X_s"))
    mass = [row[1] for each in terms for row in each.rows if row[0] == "Moving mass M"]
    title = "Coefficients of the mass balances, estimate ± 2σ"
    own = replace(table, title=title, rows=coefficients, notes=(*table.notes, INTERVALS))
    tables = (*terms, own)
    return FinalModel(usability, "".join(mass), tables, _values(content), least_certain(content))


def least_certain(content: Mapping[str, Any]) -> str:
    """Return the identified parameter with the largest relative interval; empty without one.

    Parameters
    ----------
    content : mapping
        Plain values of an identification, as in ``result.json``.
    """
    relative = {
        name: 200 * max(item["std"], item["std_robust"]) / abs(item["value"])
        for name, item in content["output_error"]["parameters"].items()
        if item["std"] and item["std_robust"] and item["value"]
    }
    if not relative:
        return ""
    name = max(relative, key=lambda each: relative[each])
    return f"{with_symbols(name)}, ± {relative[name]:.2g} % (2σ)"


def _values(content: Mapping[str, Any]) -> dict[str, Value]:
    flow = (content["flow"] or {}).get("parameters", {})
    items = content["output_error"]["parameters"] | flow
    return {
        name: Value(
            item["value"],
            max(item["std"] or 0.0, item["std_robust"] or 0.0),
            item["unit"],
            item.get("status") == EstimateStatus.AT_BOUND,
        )
        for name, item in items.items()
    }


def final_title(diagnosis: Diagnosis) -> str:
    """Return the title of the section on the final model."""
    titles = {Verdict.UNKNOWN: TITLE_WITHOUT_CAUSE, Verdict.ABSORBED: TITLE_ABSORBED}
    return titles.get(diagnosis.verdict, TITLE_ABSORBED if diagnosis.absorbed else TITLE)


def _absorbed(diagnosis: Diagnosis) -> str:
    """Return which parameters have taken up what the model lacks; empty where none has."""
    wrong = taken_up(diagnosis)
    if not wrong:
        return ""
    return f"not {joined(wrong, 'or')}: the fit has taken up there what the model lacks"


def final_facts(diagnosis: Diagnosis, final: FinalModel | None) -> list[tuple[str, str]]:
    """Return whether the parameters can be used, and the moving mass, for the head of a report."""
    if diagnosis.verdict is Verdict.UNKNOWN:
        return [("Parameters usable", "no: the model lacks the cause, do not quote M or friction")]
    if final is None:
        return []
    mass = [("Moving mass M, ± 2σ", final.mass)] if final.mass else []
    usable, reason = final.usability.usable, final.usability.reason
    absorbed = _absorbed(diagnosis)
    if absorbed and usable is not Usable.NO:
        return [("Parameters usable", absorbed), *mass]
    why = "" if usable is Usable.YES else f": {reason}"
    return [("Parameters usable", f"{usable.value}{why}"), *mass]


def final_sentences(diagnosis: Diagnosis, final: FinalModel | None) -> tuple[str, ...]:
    """Return whether the final model can be used, and where it is."""
    if final is None:
        return ()
    file = (
        "It is stored in result.json, from which `validate`, `simulate`, `export`, `design` and "
        "`compare` go on."
    )
    if diagnosis.verdict is Verdict.UNKNOWN:
        return ("The model lacks the cause: its parameters absorb a part of it.", file)
    absorbed = _absorbed(diagnosis)
    if absorbed:
        unusable = (final.usability.sentence,) if final.usability.usable is Usable.NO else ()
        return f"Do {absorbed.replace('not ', 'not use ', 1)}.", *unusable, file
    return final.usability.sentence, *_left_out(diagnosis, final), file


def _left_out(diagnosis: Diagnosis, final: FinalModel) -> tuple[str, ...]:
    """Return which weak effects the final model is without."""
    present = {name.partition(".")[0] for name in final.values if "." in name}
    weak = [
        plain(effect.name) for effect in diagnosis.unnamed_effects if effect.form not in present
    ]
    if not weak:
        return ()
    return (f"It is without {joined(weak)}: output error did not settle with that.",)
