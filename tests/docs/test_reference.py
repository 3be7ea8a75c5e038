"""The API reference is built from the docstrings, with formulas, and asks no other host."""

import re
from pathlib import Path

import pytest

pytest.importorskip("pdoc", reason="pdoc is not installed: pip install '.[docs]'")
pytest.importorskip("latex2mathml", reason="latex2mathml is not installed: pip install '.[docs]'")

DOCS = Path(__file__).resolve().parent.parent.parent / "docs"


@pytest.fixture(scope="module")
def reference(script):
    return script(DOCS / "build.py")


@pytest.fixture(scope="module")
def pages(reference, tmp_path_factory):
    """Pages of two modules, by name."""
    output = tmp_path_factory.mktemp("site") / "api"
    first = reference.build(output, ("pneumo_casadi.signals", "pneumo_casadi.errors"))
    assert first.is_file()
    return {path.stem: path.read_text("utf-8") for path in output.rglob("*.html")}


def test_every_exported_name_has_its_place(pages):
    from pneumo_casadi import signals as filtering

    assert not [name for name in filtering.__all__ if f'id="{name}"' not in pages["filtering"]]


def test_sections_of_a_docstring_become_lists_and_constructors_show_defaults(pages):
    assert '<h6 id="parameters">Parameters</h6>' in pages["filtering"]
    assert "<strong>sampling_frequency</strong>" in pages["filtering"]
    plan = re.sub(r"<[^>]+>", "", pages["filtering"].split('id="FilterPlan.__init__"')[1])
    assert re.search(r"order:\s*int\s*=\s*4", plan[:1000])


def test_formulas_are_mathml(pages):
    text = re.sub(r"<pre>.*?</pre>", "", pages["filtering"], flags=re.DOTALL)  # the source
    assert text.count("<math ") >= 2 and "<mfrac>" in text
    assert ".. math::" not in text and "\\frac" not in text


def test_pages_ask_no_other_host(pages):
    asking = re.compile(r"""<(?:script|link|img|iframe)[^>]*(?:src|href)=["']?(?:https?:)?//""")
    assert not [name for name, text in pages.items() if asking.search(text)]
    assert not [name for name, text in pages.items() if re.search(r"@import|url\(.?http", text)]


def test_the_whole_reference_leaves_out_what_is_not_public(reference, tmp_path, monkeypatch):
    from pdoc.extract import walk_specs

    monkeypatch.chdir(tmp_path)  # beside the sources it warns that the installed package is meant
    found = set(walk_specs(reference.MODULES))
    assert {
        "pneumo_casadi.identification.identify",
        "pneumo_casadi.effects.friction.stribeck",
    } <= found
    assert not [name for name in found if name.endswith(("_command", ".cli", ".diagnose"))]
    assert not [name for name in found if "kernels" in name]


def test_a_folder_that_holds_something_else_is_left_alone(reference, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work", "utf-8")
    with pytest.raises(FileExistsError, match="holds something else"):
        reference.build(tmp_path, ("pneumo_casadi.errors",))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
