"""A site that lacks something is not built: `docs/build.py` checks what it has written."""

from pathlib import Path

import pytest

import pneumo_casadi as pc
from pneumo_casadi.cli.app import app

CHECKS = Path(__file__).resolve().parents[2] / "docs" / "site_checks.py"
FORMULA = '<div class="math notranslate nohighlight"></div>'


@pytest.fixture
def faults(script):
    return lambda site, executed=False: list(script(CHECKS).faults(site, executed))


@pytest.fixture
def site(tmp_path):
    """A site of three pages in which nothing is missing."""
    for folder in ("reference", "explanation", "_static"):
        (tmp_path / folder).mkdir()
    names = "".join(f'<dt id="pneumo_casadi.part.{name}">' for name in pc.__all__)
    (tmp_path / "reference" / "model.html").write_text(names, "utf-8")
    commands = [c.name or c.callback.__name__.replace("_", "-") for c in app.registered_commands]
    help_text = "".join(f"<h2>pneumo-casadi {name}</h2>" for name in commands)
    (tmp_path / "reference" / "command_line.html").write_text(help_text, "utf-8")
    formulas = FORMULA * 12 + '<script src="../_static/tex-svg.js?v=1"></script>'
    (tmp_path / "explanation" / "model.html").write_text(formulas, "utf-8")
    (tmp_path / "_static" / "tex-svg.js").touch()
    return tmp_path


def test_a_whole_site_has_no_fault(site, faults):
    (site / "index.html").write_text('<a href="https://example.org">a link</a>', "utf-8")
    assert faults(site) == []


@pytest.mark.parametrize(
    "text",
    [
        '<script async src="https://cdn.example/x.js">',
        '<link rel="stylesheet" href="//fonts.example/a.css">',
        "<style>@import url(https://fonts.example/a.css)</style>",
    ],
)
def test_a_request_to_another_host_is_a_fault(site, faults, text):
    (site / "index.html").write_text(text, "utf-8")
    assert faults(site) == ["index.html: asks another host"]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("<td>a</td></table>\n<p>| <code>b</code> | c |</p>", "a row of a table stands as text"),
        ("<em>= PosixPath('/home/me')</em>", "a value of the program is printed as it is"),
        (
            "<pre>&lt;Sheet size 762.205x935.433 with 3 Axes&gt;</pre>",
            "a figure is not drawn: `%matplotlib inline`",
        ),
    ],
)
def test_a_source_that_is_not_understood_is_a_fault(site, faults, text, fault):
    (site / "index.html").write_text(text, "utf-8")
    assert faults(site) == [f"index.html: {fault}"]


def test_a_public_name_without_a_page_is_a_fault(site, faults):
    page = site / "reference" / "model.html"
    page.write_text(page.read_text("utf-8").replace(".Servosystem", ".Axis"), "utf-8")
    assert faults(site) == ["Servosystem: is public and on no page of the reference"]


def test_a_command_without_help_is_a_fault(site, faults):
    page = site / "reference" / "command_line.html"
    page.write_text(page.read_text("utf-8").replace("diagnose<", "judge<"), "utf-8")
    assert faults(site) == ["diagnose: is a command without help on the site"]


def test_formulas_that_no_script_draws_are_a_fault(site, faults):
    (site / "_static" / "tex-svg.js").unlink()
    assert faults(site) == ["model.html: the script that draws formulas is not on the site"]
    (site / "explanation" / "model.html").write_text("", "utf-8")
    assert faults(site)[0] == "model.html: its formulas are missing"


def test_an_executed_notebook_shows_a_figure_and_a_table_and_no_warning(site, faults):
    page = site / "tutorials" / "00_your_csv.html"
    page.parent.mkdir()
    head = '<img src="logo.svg"><table></table>'
    shown = '<img src="a.png"></div><div class="output stderr highlight">Warning: old</div>'
    page.write_text(f'{head}<div class="cell_output docutils">{shown}', "utf-8")
    assert faults(site) == []
    expected = ["00_your_csv.html: shows no table", "00_your_csv.html: shows a warning"]
    assert faults(site, executed=True) == expected
