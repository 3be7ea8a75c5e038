"""docs/reference/effects.md is the catalogue, and says all of it."""

from pathlib import Path

import pytest

from pneumo_casadi.effects import EFFECTS, catalogue_table, effect_row
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.report.tables.effects import catalogue_markdown, effect_markdown

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "effects.md"


def test_the_page_is_made_from_the_catalogue():
    assert PAGE.read_text("utf-8") == catalogue_markdown(), (
        "stale: python -m pneumo_casadi.report.tables.effects > docs/reference/effects.md"
    )


@pytest.mark.parametrize("row", catalogue_table(), ids=lambda row: row.name)
def test_the_page_says_all_of_an_effect(row):
    _, _, rest = PAGE.read_text("utf-8").partition(f"## {row.name}\n")
    section = rest.partition("\n## ")[0]
    told = [row.equation, row.shows, row.separated_by, row.source, *row.confused_with]
    told += [state.name for state in row.states]
    for parameter in row.parameters:
        start = parameter.value if parameter.start is None else parameter.start
        told += [
            f"`{parameter.name}`",
            parameter.unit,
            f"{parameter.lower:g} to {parameter.upper:g}",
            f"{parameter.null:g}",
        ]
        told += [f"{start:g}", parameter.description]
    plain = section.replace("\\|", "|")
    assert not [text for text in told if text not in plain]


def test_no_table_row_of_the_page_is_broken():
    widths = {}
    for line in PAGE.read_text("utf-8").splitlines():
        if line.startswith("|"):
            cells = line.replace("\\|", "").count("|") - 1
            widths[cells] = widths.get(cells, 0) + 1
    effects, parameters = len(EFFECTS), sum(len(row.parameters) for row in catalogue_table())
    assert widths == {3: effects + 2, 7: parameters + 2 * effects}


def test_an_effect_of_ones_own_has_a_section_too():
    class Drag(Effect):
        name = "drag"
        equation = "F = c v |v|"
        parameters = (Parameter("c", 0.0, "N s2/m2", lower=0.0, null=0.0, free=False),)

    text = effect_markdown(effect_row(Drag))
    assert "## drag" in text and "F = c v |v|" in text and "`c` (*held*)" in text
    assert "Confused with" not in text
