"""Results as plain text."""

import textwrap

from pneumo_casadi.estimation.wls import format_table
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.warnings import ResultWarning
from pneumo_casadi.report.tables.content import all_tables
from pneumo_casadi.report.tables.table import Table, with_symbols
from pneumo_casadi.report.text.reference import reference_line

WIDTH = 100


def render(table: Table) -> str:
    """Return a table as lines of text.

    Examples
    --------
    >>> print(render(Table("Masses", ("", "kg"), (("M", "16.9"),))))
    Masses
    <BLANKLINE>
         kg
    -  ----
    M  16.9
    """
    widths = table.widths

    def line(cells: tuple[str, ...]) -> str:
        first, *rest = zip(cells, widths, strict=True)
        padded = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in rest)]
        return "  ".join(padded).rstrip()

    rule = "  ".join("-" * width for width in widths)
    lines = [table.title, "", line(table.columns), rule, *map(line, table.rows)]
    return "\n".join([*lines, *([""] if table.notes else []), *table.notes])


def render_warnings(warnings: tuple[ResultWarning, ...], width: int = WIDTH) -> str:
    """Return warnings as a list of wrapped lines; a single line where there are none."""
    if not warnings:
        return "No warnings."
    wrapped = [
        textwrap.fill(
            f"{item.grade}: {with_symbols(item.text)}",
            width,
            initial_indent="- ",
            subsequent_indent="  ",
        )
        for item in warnings
    ]
    return "\n".join(["Before you use these numbers", "", *wrapped])


def first_lines(identification: Identification, width: int = WIDTH) -> str:
    """Return whether the result can be used, with the reason, and what was identified."""
    sentence = textwrap.fill(with_symbols(identification.usability.sentence), width)
    return f"{sentence}\n\nIdentification of {identification.case.name}"


def text_report(identification: Identification, paper: bool = False) -> str:
    """Return the whole result as text: warnings, tables, WLS in the form of the paper."""
    wls = format_table(identification.wls, robust=True)
    parts = [
        first_lines(identification),
        render_warnings(identification.warnings),
        *(render(table) for table in all_tables(identification, paper)),
        "Weighted least squares, in the form of Table 1 of the paper\n\n" + wls,
        "Filters\n\n" + identification.wls.plan.describe(),
    ]
    reference = reference_line("\n".join(parts))
    return "\n\n\n".join([*parts, *([reference] if reference else [])]) + "\n"
