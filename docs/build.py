"""Build the documentation site: ``python docs/build.py`` (extra ``docs``).

The site is written to ``report/docs``; warnings are errors, and so is every fault of `site_checks`.
Notebooks are executed once, their outputs kept in ``report/docs-cache`` until a notebook changes;
``--no-execute`` shows them without outputs.
"""

import argparse
import re
import shutil
import sys
import tempfile
from importlib import import_module
from importlib.resources import files
from pathlib import Path

from site_checks import faults
from sphinx.cmd.build import build_main
from sphinx.pycode import ModuleAnalyzer
from typer.cli import get_docs_for_click
from typer.main import get_command

ROOT = Path(__file__).resolve().parent.parent
#: Pages of the programming reference: title, and the packages whose exports stand on it.
STAGES = {
    "data": ("Data: cases, recordings, files", ("data", "data.check")),
    "signals": ("Signals: filters, derivatives, decimation", ("signals",)),
    "valve": ("Valve: the static flow map", ("valve",)),
    "model": (
        "Model: axis, effects, simulation",
        (
            "parameters",
            "model",
            "model.effect",
            "model.junctions",
            "model.servosystem",
            "model.simulation",
            "effects",
        ),
    ),
    "wls": ("Weighted least squares", ("estimation.wls",)),
    "output_error": ("Output error", ("estimation.output_error",)),
    "equation_error": ("Equation error", ("estimation.equation_error",)),
    "metrics": ("Noise floor, gap and closure", ("metrics",)),
    "uncertainty": ("Uncertainty", ("estimation.uncertainty",)),
    "identification": (
        "Identification and validation",
        (
            "identification.identify",
            "identification.options",
            "identification.result",
            "identification.warnings",
            "identification.compare",
            "identification.comparison",
            "identification.read_result",
            "validation",
        ),
    ),
    "diagnosis": ("Diagnosis", ("diagnosis",)),
    "design": ("Design of experiments, sensitivity", ("design", "sensitivity")),
    "export": ("Export", ("export",)),
    "evaluation": ("Many cases, sealed check", ("evaluation.batch", "evaluation.sealed_check")),
    "virtual_bench": ("Virtual bench", ("virtual_bench",)),
    "report": ("Reports and figures", ("report.pages.report", "report.plot")),
}


def main() -> None:
    """Build the site and name its first page."""
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("--output", type=Path, default=ROOT / "report/docs", metavar="FOLDER")
    parser.add_argument("--no-execute", action="store_true", help="notebooks without outputs")
    arguments = parser.parse_args()
    status = build(arguments.output.resolve(), execute=not arguments.no_execute)
    if status == 0:
        sys.stdout.write(f"{arguments.output / 'index.html'}\n")
    sys.exit(status)


def build(output: Path, execute: bool) -> int:
    """Build the site into a folder.

    Parameters
    ----------
    output : Path
        Folder to write; an earlier site in it is replaced.
    execute : bool
        Whether to execute the notebooks, or to take their outputs from the cache.

    Returns
    -------
    int
        0 if there was neither an error nor a warning, and nothing is missing.

    Raises
    ------
    FileExistsError
        If the folder holds anything but an earlier site.
    """
    if output.exists() and any(output.iterdir()) and not (output / "objects.inv").is_file():
        raise FileExistsError(f"{output}: holds something else; choose another folder")
    with tempfile.TemporaryDirectory() as scratch:
        source, site = Path(scratch, "docs"), Path(scratch, "site")
        collect(source)
        options = ["-q", "-W", "--keep-going", "-b", "html"]
        if execute:
            cache = output.with_name(f"{output.name}-cache")
            options += ["-D", "nb_execution_mode=cache", "-D", f"nb_execution_cache_path={cache}"]
        else:
            options += ["-D", "nb_execution_mode=off"]
        status = build_main([*options, str(source), str(site)])
        if status == 0:
            missing = list(faults(site, execute))
            sys.stderr.write("".join(f"{line}\n" for line in missing))
            status = min(len(missing), 1)
        if status == 0:
            shutil.rmtree(output, ignore_errors=True)
            shutil.copytree(site, output, ignore=shutil.ignore_patterns(".doctrees", "*.ipynb"))
    return status


def collect(source: Path) -> None:
    """Put the committed pages, the notebooks and the generated pages into one folder."""
    shutil.copytree(ROOT / "docs", source, ignore=shutil.ignore_patterns("__pycache__"))
    for notebook in (ROOT / "notebooks").glob("*.ipynb"):
        shutil.copy(notebook, source / "tutorials")
    shutil.copy(ROOT / "CHANGELOG.md", source / "changelog.md")
    formulas = files("sphinx-mathjax-offline") / "static" / "mathjax" / "tex-svg.js"
    (source / "static" / "tex-svg.js").write_bytes(formulas.read_bytes())
    for page in source.rglob("*.md"):
        text = page.read_text("utf-8").replace("../../notebooks/", "../tutorials/")
        text = text.replace("../notebooks/", "tutorials/")  # of the front page
        text = text.replace("../../CHANGELOG.md", "../changelog.md")
        page.write_text(re.sub(r"\n?<!-- (?:table|file|end)\b.*?-->\n", "\n", text), "utf-8")
    (source / "reference" / "command_line.md").write_text(command_line(), "utf-8")
    for name, (title, packages) in STAGES.items():
        page = "\n".join([f"# {title}", *map(exports, packages)])
        (source / "reference" / f"{name}.md").write_text(page, "utf-8")


def exports(package: str) -> str:
    """Return the part of a reference page that documents what a package exports."""
    name = f"pneumo_casadi.{package}"
    module = import_module(name)
    own = [key for key in vars(module) if not key.startswith("_")]
    public = getattr(module, "__all__", None) or [
        key for key in own if getattr(getattr(module, key), "__module__", "") == name
    ]
    directives = [f"## `{name}`\n", f"```{{eval-rst}}\n.. automodule:: {name}\n```\n"]
    for key in public:
        item = getattr(module, key)
        if isinstance(item, type):
            kind, content = "autoclass", "   :members:"
        elif callable(item):
            kind, content = "autofunction", ""
        else:
            kind, content = "py:data", f"\n   {comment(name, key)}"
        directives.append(f"```{{eval-rst}}\n.. {kind}:: {name}.{key}\n{content}\n```\n")
    return "\n".join(directives)


def comment(package: str, key: str) -> str:
    """Return what stands above a constant in the source; its value may fill pages."""
    inside = [name for name in sys.modules if name.startswith(f"{package}.")]
    for name in (package, *sorted(inside)):
        comments = ModuleAnalyzer.for_module(name).find_attr_docs()
        if ("", key) in comments:
            return " ".join(comments["", key]).strip()
    raise LookupError(f"{package}.{key}: a constant on the site needs a comment (#:)")


def command_line() -> str:
    """Return the page of all commands with their options, from their help."""
    from pneumo_casadi.cli.app import app

    command = get_command(app)
    context = command.make_context("pneumo-casadi", [], resilient_parsing=True)
    text = get_docs_for_click(obj=command, ctx=context, name="pneumo-casadi")
    return "# Command line\n\n" + text.split("\n", 1)[1].replace("```console", "```text")


if __name__ == "__main__":
    main()
