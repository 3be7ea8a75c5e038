"""The folder and the page of a diagnosis are whole, closed and accessible."""

import importlib.util
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest

from pneumo_casadi.diagnosis import Verdict
from pneumo_casadi.errors import CaseError
from pneumo_casadi.report.pages.diagnosis import diagnosis_html, write_diagnosis
from pneumo_casadi.report.pages.diagnosis_figures import diagnosis_figures
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.tables.verdict.estimates import diagnosis_tables

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)

SVG = b'<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="36pt"></svg>'
#: Figures of a record, which the page draws over time, and of what it shows as it is.
FEW = ("validation_held_out", "discovered_term")


@pytest.fixture(scope="module")
def written(drawn, leave_blank, tmp_path_factory):
    """A report with few figures, all blank: what is tested is the folder."""
    folder = tmp_path_factory.mktemp("diagnosis") / "report"
    few = [drawn[name] for name in FEW]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pneumo_casadi.report.pages.diagnosis._figures_of", lambda result: few)
        leave_blank(patch, "svg", "png", "pdf")
        return write_diagnosis(made.with_curves(), folder)


def test_a_picture_knows_its_size_whatever_its_kind():
    picture = Picture("gap", SVG, "Gap.")
    assert (picture.width, picture.height) == (96, 48)
    assert picture.uri.startswith("data:image/svg+xml;base64,")
    with pytest.raises(ValueError, match="gap: no PNG"):
        _ = Picture("gap", b"nonsense", "Gap.").width


@pytest.mark.slow
@pytest.mark.parametrize("verdict", list(Verdict))
def test_every_verdict_is_drawn_and_has_a_page(verdict):
    diagnosis = made.ALL[verdict]
    names = [drawing.name for drawing in diagnosis_figures(diagnosis)]
    assert "gap" in names and "ranking" in names
    page = Page(diagnosis_html(diagnosis, [Picture("gap", SVG, "A < B & more.")]))
    assert page.headings[0] == (1, "Diagnosis of press_4")
    assert all(after - before <= 1 for before, after in page.steps)
    assert "A < B & more." in page.alternatives


@pytest.mark.slow
def test_a_folder_is_written_whole(written):
    assert {path.name for path in written.iterdir()} == {
        "diagnosis.json",
        "curves.json",
        "report.html",
        "summary.txt",
        "discovered_term.json",
        "figures",
        ".pneumo_casadi.json",
    }
    content = json.loads((written / "diagnosis.json").read_text("utf-8"))
    assert content == json.loads(json.dumps(made.with_curves().as_dict()))
    assert {path.name for path in (written / "figures").iterdir()} == {
        name + suffix for name in FEW for suffix in (".png", ".svg", ".pdf")
    }
    alternatives = Page((written / "report.html").read_text("utf-8")).alternatives
    assert len(alternatives) == len(FEW)
    assert any(text.startswith("The discovered term over its driver") for text in alternatives)


def test_a_folder_with_anything_else_in_it_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(CaseError, match=r"thesis\.tex"):
        write_diagnosis(made.EFFECT, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.slow
def test_the_page_requests_nothing_and_is_built_of_headings_tables_and_captions(drawn):
    pictures = [Picture(name, SVG, drawing.caption) for name, drawing in drawn.items()]
    text = diagnosis_html(made.with_curves(), pictures)
    page = Page(text)
    assert page.language == "en"
    assert all(address.startswith(("#", "data:")) for address in page.addresses)
    own = text.partition("<script>")[0]  # the scripts of the time plots stand at the end
    assert "@import" not in own and "url(" not in own and "http" not in own
    anchors = {address[1:] for address in page.addresses if address.startswith("#")}
    assert anchors <= page.ids
    assert len(page.alternatives) == 7 and all(
        len(alternative) > 60 for alternative in page.alternatives
    )
    tables = len(diagnosis_tables(made.EFFECT)) + 1  # and the legend
    assert page.count["table"] == page.count["caption"] == tables
    assert page.count["th"] > page.count["tr"]  # every row and column is named


def test_the_page_escapes_what_it_shows():
    page = diagnosis_html(replace(made.EFFECT, case="<script>", notes=("a < b & c",)), [])
    assert "<script>" not in page and "a &lt; b &amp; c" in page


class Page(HTMLParser):
    """What a reader that does not see finds in a page."""

    def __init__(self, text):
        super().__init__()
        self.headings, self.addresses, self.alternatives = [], [], []
        self.ids, self.count, self.language, self._level = set(), {}, None, 0
        self.feed(text)

    @property
    def steps(self):
        levels = [level for level, _ in self.headings]
        return list(pairwise(levels))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.count[tag] = self.count.get(tag, 0) + 1
        self.ids |= {given["id"]} if "id" in given else set()
        self.addresses += [given[key] for key in ("href", "src") if key in given]
        if tag == "html":
            self.language = given.get("lang")
        if tag == "img":
            self.alternatives.append(given["alt"])
        self._level = int(tag[1]) if re.fullmatch("h[1-6]", tag) else self._level

    def handle_data(self, data):
        if self._level:
            self.headings.append((self._level, data))
            self._level = 0
