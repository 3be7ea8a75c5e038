"""What a built site must hold: no request to another host, every public name, every command."""

import re
from collections.abc import Iterator
from pathlib import Path

import pneumo_casadi
from pneumo_casadi.cli.app import app

#: What a page loads by itself; a link that a reader follows is not among it.
LOADED = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["']?(?:https?:)?//"""
    r"""|<link\b(?![^>]*rel=["']?(?:canonical|license))[^>]*\bhref=["']?(?:https?:)?//"""
    r"""|(?:url\(|@import)\s*["']?(?:https?:)?//""",
)
#: What a page shows where its source was not understood, or a notebook drew no figure.
MISTAKES = {
    re.compile(r"<p>\s*\|"): "a row of a table stands as text",
    re.compile(r"PosixPath\(|mappingproxy\("): "a value of the program is printed as it is",
    re.compile(r"&lt;(?:Sheet|Figure) size"): "a figure is not drawn: `%matplotlib inline`",
}
#: Public names that are no object with a page of its own.
NO_PAGE = ("__version__", "plot", "EFFECTS")
#: A page with many formulas.
FORMULAS = "explanation/model.html"


def faults(site: Path, executed: bool) -> Iterator[str]:
    """Say what a site lacks, a line each.

    Parameters
    ----------
    site : Path
        Folder of the site.
    executed : bool
        Whether its notebooks were executed, and must show figures and tables.

    Yields
    ------
    str
        File or name, and what is wrong with it.
    """
    for path in sorted(site.rglob("*")):
        if path.suffix not in (".html", ".css"):
            continue
        text, name = path.read_text("utf-8"), path.relative_to(site)
        if LOADED.search(text):
            yield f"{name}: asks another host"
        yield from (f"{name}: {fault}" for form, fault in MISTAKES.items() if form.search(text))
    pages = "".join(path.read_text("utf-8") for path in (site / "reference").glob("*.html"))
    for name in sorted(set(pneumo_casadi.__all__).difference(NO_PAGE)):
        if not re.search(rf'id="pneumo_casadi\.[\w.]*{name}"', pages):
            yield f"{name}: is public and on no page of the reference"
    commands = (site / "reference" / "command_line.html").read_text("utf-8")
    for command in app.registered_commands:
        name = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
        if not re.search(rf"pneumo-casadi {name}(?![\w-])", commands):
            yield f"{name}: is a command without help on the site"
    yield from _faults_of_formulas(site / FORMULAS)
    if executed:
        yield from _faults_of_outputs(site / "tutorials")


def _faults_of_outputs(tutorials: Path) -> Iterator[str]:
    """Say which notebooks show no figure or no table below their cells, or a warning."""
    for path in sorted(tutorials.glob("[0-9]*.html")):
        outputs = "".join(path.read_text("utf-8").split('class="cell_output')[1:])
        for tag, shown in (("<img", "figure"), ("<table", "table")):
            if tag not in outputs:
                yield f"{path.name}: shows no {shown}"
        if 'class="output stderr' in outputs:
            yield f"{path.name}: shows a warning"


def _faults_of_formulas(path: Path) -> Iterator[str]:
    """Say whether the formulas of a page would not be drawn."""
    page = path.read_text("utf-8")
    if page.count('class="math notranslate nohighlight"') < 10:
        yield f"{path.name}: its formulas are missing"
    script = re.search(r'src="([^"]*tex-svg.js[^"]*)"', page)
    if script is None or not (path.parent / script[1].split("?")[0]).is_file():
        yield f"{path.name}: the script that draws formulas is not on the site"
