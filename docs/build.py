"""API reference as static pages, built from the docstrings: ``python docs/build.py``.

The pages ask no other host for anything: formulas become MathML, the search runs in the page. Needs
the extra `docs`.
"""

import argparse
import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pdoc
from jinja2 import pass_context
from latex2mathml.converter import convert
from pdoc.render_helpers import to_markdown_with_context

#: All but the commands, whose reference is ``pneumo-casadi --help``. What a package exports stands
#: on the package's own page; effects and reports, which export nothing, have pages below it.
MODULES = (
    "pneumo_casadi",
    r"!pneumo_casadi\.(cli|terminal|\w+_command)$",
    r"!pneumo_casadi\.(?!effects|report)\w+\.\w+",
)
TEMPLATES = Path(__file__).with_name("templates")
#: By this page an earlier reference is known: only such a folder is replaced.
FIRST_PAGE = "pneumo_casadi.html"

_FORMULA = re.compile(r"^( *)\.\. math:: *(.+(?:\n\1 +\S.*)*)", re.MULTILINE)
_LITERAL = re.compile(r"::$", re.MULTILINE)


def build(output: Path, modules: Sequence[str] = MODULES) -> Path:
    """Write the reference to a folder, as a whole or not at all.

    Parameters
    ----------
    output : Path
        Folder to make; an earlier reference in it is replaced.
    modules : sequence of str, optional
        Modules, with all that is public below them; a leading ``!`` leaves some out.

    Returns
    -------
    Path
        The page to open.

    Raises
    ------
    FileExistsError
        If the folder holds something else.
    """
    earlier = (output / FIRST_PAGE).is_file()
    if output.is_file() or (output.is_dir() and any(output.iterdir()) and not earlier):
        raise FileExistsError(f"{output}: holds something else; choose another folder")
    output.parent.mkdir(parents=True, exist_ok=True)
    pdoc.render.configure(docformat="numpy", template_directory=TEMPLATES)
    pdoc.render.env.filters["to_markdown"] = _markdown
    with tempfile.TemporaryDirectory(prefix=f".{output.name}.", dir=output.parent) as scratch:
        draft = Path(scratch) / output.name
        with warnings.catch_warnings():
            # Without Node.js the search index is made by the page itself.
            warnings.filterwarnings("ignore", "pdoc failed to build search index")
            # Installed, and begun in the folder of its sources: the installed one is meant.
            warnings.filterwarnings("ignore", "'pneumo_casadi' may refer to")
            pdoc.pdoc(*modules, output_directory=draft)
        if output.exists():
            shutil.rmtree(output)
        draft.rename(output)
    return output / "index.html"


def with_formulas(docstring: str) -> str:
    r"""Return a docstring with MathML for ``.. math::``, and without ``::`` before literal blocks.

    Examples
    --------
    >>> "<msqrt>" in with_formulas(r".. math:: \sqrt{x}")
    True
    """
    return _LITERAL.sub(":", _FORMULA.sub(_mathml, docstring))


def _mathml(found: re.Match[str]) -> str:
    latex = " ".join(found[2].split()).replace(r"\arg\min", r"\mathrm{arg}\,\min")
    # In one line: a blank one would end the block of HTML.
    return f"{found[1]}<div>{convert(latex, display='block')}</div>"


@pass_context
def _markdown(context: Any, docstring: str) -> str:
    return to_markdown_with_context(context, with_formulas(docstring))


def main() -> None:
    """Build the reference and say where it is."""
    parser = argparse.ArgumentParser(description="API reference from the docstrings.")
    parser.add_argument("--output", type=Path, default=Path("report/api"), metavar="FOLDER")
    page = build(parser.parse_args().output.resolve())
    sys.stdout.write(f"{page}\n")


if __name__ == "__main__":
    main()
