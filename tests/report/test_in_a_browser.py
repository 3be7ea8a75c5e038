"""Reports in a real browser: axe-core finds no barrier, the console stays clean, all is within."""

import importlib.util
import os
import re
import shutil
from io import BytesIO
from itertools import islice
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from pneumo_casadi.report.pages.diagnosis import write_diagnosis
from pneumo_casadi.report.pages.identification import html_report
from pneumo_casadi.report.pages.identification_figures import figures_of
from pneumo_casadi.report.pages.page import Picture
from pneumo_casadi.report.pages.write import write_comparison, write_validation

#: Left out of the daily loop: it drives a browser through every kind of page.
pytestmark = pytest.mark.slow

pytest.importorskip("bokeh", reason="Bokeh is not installed: pip install '.[interactive]'")
playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed: pip install '.[browser]'"
)
axe = pytest.importorskip(
    "axe_playwright_python.sync_playwright",
    reason="axe-core is not installed: pip install '.[browser]'",
)

_spec = importlib.util.spec_from_file_location(
    "diagnoses", Path(__file__).with_name("diagnoses.py")
)
made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(made)

DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 360, "height": 740}
#: Size and colours of the views of a page.
VIEWS = {"desktop": (DESKTOP, "light"), "dark": (DESKTOP, "dark"), "phone": (PHONE, "light")}
SYSTEM = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    system = next(filter(None, map(shutil.which, SYSTEM)), None)
    with playwright.sync_playwright() as driver:
        path = system or driver.chromium.executable_path
        if not Path(path).exists():
            pytest.skip("no Chromium: install the system's, or run `playwright install chromium`")
        root = hasattr(os, "geteuid") and os.geteuid() == 0  # its sandbox refuses root
        chromium = driver.chromium.launch(
            executable_path=path, args=["--no-sandbox"] if root else []
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def without_pdf(leave_blank):
    """Draw no PDF: no page shows one, and `no_pdf` comes after what a module shares."""
    with pytest.MonkeyPatch.context() as patch:
        leave_blank(patch, "pdf")
        yield


@pytest.fixture(scope="module")
def reports(quick, quick_comparison, without_pdf, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    diagnosis = write_diagnosis(made.with_curves(), folder / "diagnosis")
    several = write_diagnosis(made.three_effects(), folder / "several")
    drawn = islice(figures_of(quick), 3)  # the third is the time plot's
    identification = folder / "identification.html"
    pictures = [Picture(each.name, each.png(), each.caption) for each in drawn]
    identification.write_text(html_report(quick, pictures, paper=True), "utf-8")
    comparison = write_comparison(quick_comparison, folder / "comparison")
    validation = write_validation(quick.validation, folder / "validation")
    return {
        "diagnosis": diagnosis / "report.html",
        "several": several / "report.html",
        "identification": identification,
        "comparison": comparison / "report.html",
        "validation": validation / "report.html",
    }


@pytest.fixture(scope="module", params=["diagnosis", "identification", "comparison", "validation"])
def path(request, reports):
    return reports[request.param]


@pytest.fixture(scope="module")
def view(browser, path):
    """Return a function that shows a view of the page: loaded once, from its top, on screen."""
    pages = {}

    def show(name):
        size, colours = VIEWS[name]
        if name not in pages:
            pages[name] = opened(browser, path, size, colours)
            pages[name][0].wait_for_selector(".plot[data-ready=yes]")
        page = pages[name][0]
        page.emulate_media(media="screen")
        page.set_viewport_size(size)
        page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
        return pages[name]

    yield show
    for page, *_ in pages.values():
        page.close()


@pytest.fixture(scope="module")
def still(browser, path):
    """The page where no script runs."""
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(path.as_uri())
    yield page
    context.close()


def opened(browser, path, size, colours="light"):
    """Open a page; return it with what it said and asked for."""
    page = browser.new_page(viewport=size, color_scheme=colours)
    said, asked = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    return page, said, [url for url in asked if url != path.as_uri()]


@pytest.mark.parametrize("name", VIEWS)
def test_there_is_no_barrier_and_the_page_stands_alone(view, name):
    page, said, asked = view(name)
    size, colours = VIEWS[name]
    barriers = [
        (violation["id"], violation["impact"], [node["html"][:100] for node in violation["nodes"]])
        for violation in axe.Axe().run(page).response["violations"]
    ]
    assert not barriers
    assert not said
    assert all(url.startswith("data:") for url in asked)
    # Wide tables scroll by themselves: the page does not.
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    shot = matplotlib.image.imread(BytesIO(page.screenshot()))
    dark = float(np.mean(shot[..., :3] < 0.5))
    assert 0.01 < (dark if colours == "light" else 1 - dark) < 0.5  # there is text on it


def ranges(page):
    return page.evaluate(
        "document.querySelector('.plot').panels.map(p => [p.x_range.start, p.x_range.end])"
    )


def test_time_plots_zoom_together_and_curves_are_switched(view):
    page, said, asked = view("desktop")
    whole = ranges(page)
    assert len(whole) >= 2 and all(each == whole[0] for each in whole)
    assert not page.locator(
        ".plot figure img"
    ).first.is_visible()  # the drawing stands in its place
    button = page.locator("button[data-action=in]").first
    button.focus()
    page.keyboard.press("Enter")
    near = ranges(page)
    assert all(each == near[0] for each in near)
    length = whole[0][1] - whole[0][0]
    assert near[0][1] - near[0][0] == pytest.approx(0.5 * length)
    page.locator("button[data-action=all]").first.click()
    assert ranges(page) == whole
    canvas = page.locator(".plot .canvas").first.bounding_box()
    y = canvas["y"] + 60
    page.mouse.move(canvas["x"] + 300, y)
    page.mouse.down()
    page.mouse.move(canvas["x"] + 500, y, steps=4)
    page.mouse.up()
    assert ranges(page)[0][1] - ranges(page)[0][0] < 0.5 * length
    name = page.locator(".plot input").nth(1)
    name.focus()
    page.keyboard.press("Space")
    shown = page.evaluate(
        "document.querySelector('.plot').panels.flatMap(p => p.renderers)"
        ".map(r => [r.name, r.visible])"
    )
    hidden = {each for each, visible in shown if not visible}
    assert hidden == {name.get_attribute("value")}
    assert not said and all(url.startswith("data:") for url in asked)


def test_keys_reach_every_control_and_link_in_view(view):
    page, _, _ = view("desktop")
    controls = page.locator("a[href], button, input, .scroll").count()
    reached, places = set(), []
    for _ in range(2 * controls + 20):  # the plots themselves take the focus too
        page.keyboard.press("Tab")
        at = page.evaluate(
            "(() => { const e = document.activeElement, b = e.getBoundingClientRect();"
            "const all = [...document.querySelectorAll('a[href], button, input, .scroll')];"
            "return [all.indexOf(e), b.bottom > 0 && b.top < innerHeight,"
            "getComputedStyle(e).outlineStyle] })()"
        )
        if at[0] >= 0:
            reached.add(at[0])
            places.append(at[1:])
        if len(reached) == controls:
            break
    assert reached == set(range(controls)) and controls > 8
    assert all(in_view and outline != "none" for in_view, outline in places)


def test_on_a_phone_the_answer_comes_before_the_contents(view):
    page, _, _ = view("phone")
    tops = page.evaluate(
        "['h1', '.verdict', 'nav', 'main > section:not(.verdict)']"
        ".map(name => document.querySelector(name).getBoundingClientRect().top)"
    )
    assert tops == sorted(tops) and tops[1] < 0.2 * PHONE["height"]


@pytest.mark.parametrize("name", ["desktop", "dark"])
def test_on_paper_a_page_is_light_and_at_most_six_sheets(view, name):
    page, _, _ = view(name)
    pdf = page.pdf(prefer_css_page_size=True)
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 6
    page.emulate_media(media="print")
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert colour == "rgb(255, 255, 255)"


def test_three_effects_fit_on_six_sheets(browser, reports):
    page, _, _ = opened(browser, reports["several"], DESKTOP)
    page.wait_for_selector(".plot[data-ready=yes]")
    assert len(re.findall(rb"/Type\s*/Page\b", page.pdf(prefer_css_page_size=True))) <= 6
    page.close()


def test_in_a_wide_window_sections_fill_their_width(browser, reports):
    """No section with figures leaves more than the last third of a row of 1920 pixels empty."""
    page, _, _ = opened(browser, reports["several"], {"width": 1920, "height": 1080})
    free = page.evaluate(
        "[...document.querySelectorAll('.figures.beside')].map(box => {"
        "const right = box.getBoundingClientRect().right;"
        "const ends = [...box.children].map(e => e.getBoundingClientRect().right);"
        "return (right - Math.max(...ends)) / box.clientWidth})"
    )
    assert len(free) > 2 and max(free) < 0.05
    page.close()


@pytest.mark.parametrize("path", ["identification"], indirect=True)
def test_on_a_phone_the_summary_gives_way_to_its_panels(view):
    for name, shown in (("desktop", True), ("phone", False)):
        page, _, _ = view(name)
        assert page.locator("#figure-overview").is_visible() is shown


def test_without_scripts_a_still_figure_is_shown(still):
    still.set_viewport_size(DESKTOP)
    assert still.locator(".plot figure img").first.is_visible()
    assert not still.locator(".plot .controls").first.is_visible()


def test_without_scripts_a_still_figure_is_read_on_a_phone(still):
    still.set_viewport_size(PHONE)
    image = still.locator(".plot figure img").first
    assert image.bounding_box()["width"] > 650  # scrolled, not shrunk to the width of the screen
    heading = still.locator("h1").bounding_box()
    assert heading["x"] + heading["width"] <= PHONE["width"]


def test_a_report_is_small_enough_to_send(path):
    assert path.stat().st_size < 4e6


def test_every_picture_is_shown(view):
    page, _, _ = view("desktop")
    shown = []
    for media in ("screen", "print"):  # on paper those that stand in for the plots too
        page.emulate_media(media=media)
        sizes = page.evaluate(
            "[...document.images].filter(i => i.checkVisibility())"
            ".map(i => [i.complete, i.naturalWidth, i.width])"
        )
        assert all(done and natural > 0 and width > 200 for done, natural, width in sizes)
        shown.append(len(sizes))
    assert shown[1] == page.evaluate("document.images.length") > shown[0]


def test_on_a_phone_nothing_is_off_screen(view):
    page, _, _ = view("phone")
    cut = page.evaluate(
        "[...document.querySelectorAll('.scroll, pre, figure, td, tbody th')]"
        ".filter(e => e.getBoundingClientRect().right > 361 || e.scrollWidth > e.clientWidth + 1)"
        ".map(e => e.outerHTML.slice(0, 80))"
    )
    assert not cut


def test_on_paper_nothing_is_cut_off(view):
    page, _, _ = view("phone")
    page.set_viewport_size({"width": 700, "height": 1000})
    page.emulate_media(media="print")
    cut = page.evaluate(
        "[...document.querySelectorAll('.scroll, img')].filter("
        "e => e.scrollWidth > document.body.clientWidth + 1).length"
    )
    assert cut == 0
