"""The report of an identification: the answer, why to trust it, details."""

from collections.abc import Mapping, Sequence
from typing import Any

from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.wls import WLSResult, format_table, results_table
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import Usable
from pneumo_casadi.report.pages.page import (
    TIME_FIGURE,
    Picture,
    Section,
    Verdict,
    html_page,
    plots_of,
)
from pneumo_casadi.report.tables.content import all_tables
from pneumo_casadi.report.tables.diagnosis import BALANCES
from pneumo_casadi.report.tables.laboratory import laboratory_tables, legend_table
from pneumo_casadi.report.tables.table import Table, with_symbols
from pneumo_casadi.report.tables.validation import RESOLVED, records_table
from pneumo_casadi.report.text.final_model import least_certain

#: Grade and words of the verdict.
VERDICTS = {
    Usable.YES: ("good", "Usable"),
    Usable.WITH_CARE: ("care", "Usable with care"),
    Usable.NO: ("bad", "Do not use"),
}
#: Figures of the section on trust, by the beginning of their names; the others are details.
_TRUST = ("parameters", "residuals", TIME_FIGURE)


def html_report(
    identification: Identification, pictures: Sequence[Picture], paper: bool = False
) -> str:
    """Return the report of an identification as one HTML page.

    Parameters
    ----------
    identification : Identification
        What was identified.
    pictures : sequence of Picture
        Its figures, in order.
    paper : bool, optional
        Whether to set the paper's Table 1 beside the results.
    """
    content = result_dict(identification)
    validation = identification.validation
    plots, left = plots_of(() if validation is None else validation.curves, pictures)
    trusted = [picture for picture in left if picture.name.startswith(_TRUST)]
    tables = all_tables(identification, paper)
    answer = [*laboratory_tables(content), tables[0]]
    records = records_table(content["provenance"])
    texts = ("Filters\n\n" + identification.wls.plan.describe(),)
    sections = [
        Section("answer", "Parameters", (next_record(content),), tables=answer),
        Section("warnings", "Before you use these numbers", warning_sentences(content)),
        Section("trust", "Why to trust it", tables=[*tables[1:], records], plots=plots),
        Section("checks", "Estimates and residuals", pictures=trusted),
        Section(
            "details", "Details", pictures=[each for each in left if each not in trusted],
            tables=(wls_table(identification.wls), stage_table(identification.output_error)),
            texts=texts,
        ),
        Section("symbols", "Symbols", tables=(legend_table("φ b σ WLS Y u", *answer, *tables),)),
        Section("provenance", "Provenance", provenance=content["provenance"]),
    ]  # fmt: skip
    title = f"Identification of {identification.case.name}"
    return html_page(title, usability_verdict(content), sections)


def usability_verdict(content: Mapping[str, Any]) -> Verdict:
    """Return whether the result can be used, with the mass and the status of the fit."""
    grade, words = VERDICTS[Usable(content["usable"])]
    reason = content["reason"]
    fit = content["output_error"]
    solves = f"{fit['status']} after {fit['iterations']} iterations"
    facts = [("Output error by multiple shooting", solves)]
    for table in laboratory_tables(content):
        facts += [
            (f"{row[0]}, ± 2σ", row[1])
            for row in table.rows
            if row[0].startswith(("Moving", "Viscous"))
        ]
    errors = content["validation"]
    if errors is not None:
        outputs = {name: errors[name] for name in fit["sigma"] if name in errors}
        worst = max(outputs, key=lambda name: outputs[name]["percent"])
        noise = outputs[worst]["noise_percent"]
        text = f"{outputs[worst]['percent']:.2g} % of {worst}"
        text += f"; the sensor noise is {noise:.2g} %" if noise and noise >= RESOLVED else ""
        facts.append(
            ("Error on held-out records, simulated whole in open loop, of the worst output", text)
        )
    first = "" if content["usable"] == Usable.YES.value else "check what is said above; "
    more = "`diagnose` tells where model and measurement disagree and why, `design` what to record"
    facts.append(("Next", first + more))
    return Verdict(grade, words, reason[:1].upper() + reason[1:], facts)


def warning_sentences(content: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the warnings, the gravest first; a single sentence where there are none."""
    warnings = content["warnings"]
    return tuple(f"{item['grade']}: {item['text']}" for item in warnings) or ("No warnings.",)


def next_record(content: Mapping[str, Any]) -> str:
    """Return which parameter is the least certain, and how to plan a record that improves it."""
    known = least_certain(content)
    unknown = content["output_error"]["uninformed"]
    if unknown:
        least = f"The records say nothing about {', '.join(map(with_symbols, unknown))}"
    elif known:
        least = f"The least certain identified parameter is {known}"
    else:
        least = "No parameter was estimated with an interval"
    return f"{least}. `pneumo-casadi design` plans the next record for the parameters of this one."


def wls_table(result: WLSResult) -> Table:
    """Return weighted least squares in the form of Table 1 of the paper, SI units."""
    frame = results_table(result, robust=True)
    rows = [
        (
            with_symbols(str(name)),
            *(
                f"{value:.4f}" if column.startswith("%") else f"{value:.2e}"
                for column, value in zip(frame.columns, row, strict=True)
            ),
        )
        for name, row in frame.iterrows()
    ]
    notes = format_table(result, robust=True).partition("\n\n")[2]
    for name, words in BALANCES.items():
        notes = notes.replace(f"{name}:", f"{words}:")
    title = "Weighted least squares, in the form of Table 1 of the paper"
    return Table(title, ("", *frame.columns), tuple(rows), tuple(notes.splitlines()))


def stage_table(result: OutputErrorResult) -> Table:
    """Return every solve of an output-error fit."""
    rows = [
        (stage.name, stage.status, str(stage.iterations), f"{stage.cost:.6g}")
        for stage in result.stages
    ]
    title = "Stages of the output-error fit"
    return Table(title, ("stage", "status", "iterations", "cost"), tuple(rows))
