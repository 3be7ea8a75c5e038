"""The site builds without a warning, names every public object, and asks no other host."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("myst_nb", reason="myst_nb is not installed: pip install '.[docs]'")
pytest.importorskip("furo", reason="furo is not installed: pip install '.[docs]'")

ROOT = Path(__file__).resolve().parents[2]
#: What a page loads by itself; a link that a reader follows is not among it.
LOADED = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["']?(?:https?:)?//"""
    r"""|<link\b(?![^>]*rel=["']?(?:canonical|license))[^>]*\bhref=["']?(?:https?:)?//"""
    r"""|(?:url\(|@import)\s*["']?(?:https?:)?//""",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the site, built without executing the notebooks; warnings fail the build."""
    output = tmp_path_factory.mktemp("site") / "docs"
    # In a process of its own: deprecations between Sphinx and its extensions are not ours.
    command = [sys.executable, ROOT / "docs" / "build.py", "--no-execute", "--output", output]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return output


@pytest.mark.slow
def test_no_page_and_no_style_asks_another_host(site):
    files = [path for path in site.rglob("*") if path.suffix in (".html", ".css")]
    assert len(files) > 40
    asking = {path.name: LOADED.findall(path.read_text("utf-8")) for path in files}
    assert not {name: item for name, item in asking.items() if item}


def test_a_request_to_another_host_would_be_noticed():
    for text in (
        '<script async src="https://cdn.example/x.js">',
        '<link rel="stylesheet" href="//fonts.example/a.css">',
        "@import url(https://fonts.example/a.css)",
    ):
        assert LOADED.search(text), text
    assert not LOADED.search('<a href="https://example.org">')


@pytest.mark.slow
def test_every_public_name_has_its_place(site):
    import pneumo_casadi

    pages = "".join(path.read_text("utf-8") for path in (site / "reference").glob("*.html"))
    names = [
        name for name in pneumo_casadi.__all__ if name not in ("__version__", "plot", "EFFECTS")
    ]
    assert not [
        name for name in names if not re.search(rf'id="pneumo_casadi\.[\w.]*{name}"', pages)
    ]


@pytest.mark.slow
def test_formulas_are_drawn_by_a_script_of_the_site(site):
    page = (site / "explanation" / "model.html").read_text("utf-8")
    assert page.count('class="math notranslate nohighlight"') > 10
    (script,) = re.findall(r'src="([^"]*tex-svg.js[^"]*)"', page)
    assert (site / "explanation" / script.split("?")[0]).is_file()


@pytest.mark.slow
def test_every_command_is_documented(site):
    from pneumo_casadi.cli.app import app

    page = (site / "reference" / "command_line.html").read_text("utf-8")
    for command in app.registered_commands:
        name = command.name or command.callback.__name__.replace("_", "-")
        assert f"pneumo-casadi {name}" in page, name
