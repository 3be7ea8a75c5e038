"""The catalogue of effects as a document: ``python -m pneumo_casadi.report.tables.effects``."""

import sys

from pneumo_casadi.effects import EFFECTS, EffectRow, catalogue_table
from pneumo_casadi.parameters import Parameter

_HEAD = """\
# The catalogue of effects

Physics that the nominal axis leaves out, as the package has it. Each effect acts at junctions of
the model (chamber pressure → command → spool → supply, outlet → valve flow → line → chamber flow →
chamber energy → capacity → force → output; the force-driven axis: drive → force → output), vanishes
at the null values of its parameters, and adds its own states where it needs them. Any subset
composes: `axis.with_effects(EFFECTS["stribeck"]()).at_starting_values()`. An effect of your own is
a subclass of `Effect` and needs no registration.

Several effects may be forms of one cause: a diagnosis keeps the form that fits best, and names the
cause.

This page is generated: `python -m pneumo_casadi.report.tables.effects > docs/reference/effects.md`.
A parameter marked *held* is not estimated unless a starting value releases it:
`--start leakage_P.viscous=0.1`.
"""


def catalogue_markdown() -> str:
    """Return the catalogue as Markdown: an overview, then a section for each effect.

    Examples
    --------
    >>> "F = ΔF exp(−(v/v_st)²) sign(v)" in catalogue_markdown()
    True
    """
    rows = catalogue_table()
    overview = [
        "| effect | acts at | shows in |",
        "| --- | --- | --- |",
        *(
            f"| [{r.name}](#{r.name.lower()}) | {', '.join(r.junctions)} | {_cell(r.shows)} |"
            for r in rows
        ),
    ]
    return "\n".join([_HEAD, *overview, "", *map(effect_markdown, rows)])


def effect_markdown(row: EffectRow) -> str:
    """Return the section of one effect, of the catalogue or your own (`effects.row_of`)."""
    confused = ", ".join(map(_named, row.confused_with))
    items = [
        ("Form of", "" if row.cause == row.name else _named(row.cause)),
        ("Acts at", ", ".join(row.junctions)),
        ("Extra states", ", ".join(f"`{state.name}` [{state.unit}]" for state in row.states)),
        ("Shows in", row.shows),
        ("Confused with", confused),
        ("Separated by", row.separated_by),
        ("Source", row.source),
    ]
    lines = [f"## {row.name}", "", "```text", row.equation, "```", ""]
    lines += [f"- **{name}:** {text}" for name, text in items if text]
    head = ["parameter", "unit", "range", "null", "start", "what it is", "typical"]
    lines += ["", f"| {' | '.join(head)} |", "| --- | --- | ---: | ---: | ---: | --- | --- |"]
    return "\n".join([*lines, *map(_parameter, row.parameters), ""])


def _parameter(parameter: Parameter) -> str:
    start = parameter.value if parameter.start is None else parameter.start
    null = "" if parameter.null is None else f"{parameter.null:g}"
    cells = [
        f"`{parameter.name}`" + ("" if parameter.free else " (*held*)"),
        parameter.unit,
        f"{parameter.lower:g} to {parameter.upper:g}",
        null,
        f"{start:g}",
        _cell(parameter.description),
        _cell(parameter.source),
    ]
    return f"| {' | '.join(cells)} |"


def _named(name: str) -> str:
    if name in EFFECTS:
        return f"[{name}](#{name.lower()})"
    return f"`{name}`" if name.isidentifier() else name


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(catalogue_markdown())
