"""Names that try to become markup, formulas or commands of a terminal."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

from hostility.attack import Attack

CHECK = (
    "import sys\nfrom pneumo_casadi.cli.app import run\n"
    "import os\nsys.exit(run(['check', os.path.abspath('.')]))"
)
XML = """
import pneumo_casadi as pc, zipfile
from xml.etree import ElementTree
(path,) = pc.export_model('result.json', 'out', 'fmu')
text = zipfile.ZipFile(path).read('modelDescription.xml')
ElementTree.fromstring(text)
print(text.decode())
"""
TABLE = """
import json
from pathlib import Path
from pneumo_casadi.evaluation.batch.table import Row, write_tables
name = json.load(open('name.json'))
write_tables([Row(name, 'failed', error=name)], Path('out'))
print(open('out/cases.csv', newline='').read())
"""
FORMULAS = (
    *('=HYPERLINK("http://a.b")', "+1+cmd|' /C calc'!A0", "-2+3+cmd", "@SUM(1)"),
    *("\t=1+1", " =1+1", "\r=1+1", "\n=1+1"),
)


def named(text: str) -> Callable[[Path, Path], None]:
    """Return what gives the result a name, which stands in a file of its own too."""

    def write(folder: Path, canary: Path) -> None:
        content = json.loads((folder / "result.json").read_text("utf-8"))
        content["case"] = text
        (folder / "result.json").write_text(json.dumps(content))
        (folder / "name.json").write_text(json.dumps(text))

    return write


def formula_shows(folder: Path, printed: str) -> bool:
    """Return whether a cell begins as a formula."""
    rows = printed.replace("\r", "\n").split("\n")[1:]
    return any(row.strip(' \t"').startswith(("=", "+", "-", "@")) for row in rows)


def escapes_show(folder: Path, printed: str) -> bool:
    """Return whether a control character reached the terminal."""
    return "\x1b" in printed or "\x07" in printed


def header(text: str) -> Callable[[Path, Path], None]:
    """Return what names a column of the record."""

    def write(folder: Path, canary: Path) -> None:
        content = (folder / "identify.csv").read_text("utf-8")
        (folder / "identify.csv").write_text(content.replace("p_P_Pa", text, 1))

    return write


def key(text: str) -> Callable[[Path, Path], None]:
    """Return what adds a key to the bench."""

    def write(folder: Path, canary: Path) -> None:
        content = json.loads((folder / "bench.json").read_text("utf-8"))
        (folder / "bench.json").write_text(json.dumps(content | {text: 1}))

    return write


def renamed(text: str) -> Callable[[Path, Path], None]:
    """Return what renames the record."""
    return lambda folder, canary: (folder / "identify.csv").rename(folder / text) and None


def attacks() -> Iterator[Attack]:
    """Yield the attacks by names."""
    for formula in FORMULAS:
        yield Attack(f"table: {formula!r}", named(formula), TABLE, formula_shows)
    for name, text in {
        "control characters": "a\x00\x01\x1b\x0b",
        "an entity": '"><!ENTITY x SYSTEM "file:///etc/passwd">',
        "markup": "</fmiModelDescription><script>",
        "no characters": "\ud800",
    }.items():
        yield Attack(
            f"FMU: {name} in the name",
            named(text),
            XML,
            lambda folder, printed: "<script>" in printed or "<!ENTITY" in printed,
        )
    sequence = "\x1b]0;owned\x07\x1b[2J"
    yield Attack("terminal: a column", header(f"p{sequence}"), CHECK, escapes_show)
    yield Attack("terminal: a key", key(f"k{sequence}"), CHECK, escapes_show)
    yield Attack("terminal: a file", renamed(f"identify{sequence}.csv"), CHECK, escapes_show)
