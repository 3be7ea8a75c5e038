"""README and result pages say what the committed results say; names and links in them exist."""

import ast
import re
from pathlib import Path

import pytest

import pneumo_casadi as pc

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"


@pytest.fixture(scope="module")
def result_pages(script):
    return script(ROOT / "benchmarks" / "result_pages.py")


def test_the_tables_are_those_of_the_committed_results(result_pages):
    texts = [page.read_text("utf-8") for page in result_pages.PAGES]
    shown = re.findall(r"<!-- table: (\S+) -->", "".join(texts))
    assert sorted(shown) == sorted(result_pages.TABLES)
    for page, text in zip(result_pages.PAGES, texts, strict=True):
        assert result_pages.updated(text) == text, f"{page.name}: run benchmarks/result_pages.py"


def test_a_stale_table_would_be_noticed(result_pages):
    text = (ROOT / "docs" / "results" / "estimators.md").read_text("utf-8")
    stale = text.replace("| X_s1 |", "| X_s1 (old) |", 1)
    assert stale != text and result_pages.updated(stale) == text


def test_the_readme_is_one_page_with_one_table_at_most():
    lines = README.read_text("utf-8").splitlines()
    assert len(lines) <= 180
    assert sum(line.startswith("| --- ") for line in lines) <= 1


def test_every_picture_and_link_of_the_readme_exists():
    targets = re.findall(r"\]\((?!http)([^)#]+)\)", README.read_text("utf-8"))
    assert targets
    for target in targets:
        assert (ROOT / target).exists(), target


def test_the_python_of_the_readme_uses_names_that_exist():
    (code,) = re.findall(r"^```python\n(.*?)^```$", README.read_text("utf-8"), re.M | re.S)
    used = {
        ast.unparse(node) for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Attribute)
    }
    public = {name for name in used if re.fullmatch(r"pc(\.\w+)+", name)}
    assert len(public) >= 6
    for name in public:
        item = pc
        for part in name.split(".")[1:]:
            item = getattr(item, part)
    for name in ("summary", "to_frame"):
        assert hasattr(pc.Identification, name)


def test_each_install_command_stands_once():
    lines = README.read_text("utf-8").splitlines()
    for word in ("pneumo-casadi demo", "pytest"):
        assert sum(bool(re.match(rf"python3 -m venv .*{word}", line)) for line in lines) == 1
