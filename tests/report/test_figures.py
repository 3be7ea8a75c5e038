"""Figures: labelled axes with units, column width, no state left behind."""

import ast
import importlib.util
import pickle
import sys
from concurrent.futures import Executor, Future
from dataclasses import replace
from io import BytesIO
from itertools import combinations
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib._pylab_helpers import Gcf
from matplotlib.text import Text

import pneumo_casadi
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import MissingExtraError
from pneumo_casadi.estimation.uncertainty import Optimum, Profile, analyse_identifiability
from pneumo_casadi.estimation.uncertainty.profile_path import ProfileEnd
from pneumo_casadi.identification.options import output_error_options
from pneumo_casadi.report.figures.identification.flow_map import (
    flow_map_figure,
    residual_map_figure,
)
from pneumo_casadi.report.figures.identification.identifiability import profile_figure
from pneumo_casadi.report.figures.studies.withheld import withheld_figure
from pneumo_casadi.report.figures.style import COLUMN, MM, PAGE, png, save_figure, symbol
from pneumo_casadi.report.pages.identification_figures import Drawn, figures_of
from pneumo_casadi.report.pages.write import save_figures, write_identification
from pneumo_casadi.valve import fit_polynomials

#: Figures whose vertical axis holds names.
NAMES = {"parameters", "correlations", "all_correlations"}


#: Smallest letters [pt].
SMALLEST = 5.0


@pytest.fixture(scope="module")
def drawn(quick):
    """Every figure there is, drawn once: of a result whose identifiability was analysed."""
    options = output_error_options(quick.case, quick.options)
    optimum = Optimum(quick.output_error, quick.records, quick.flow_map, options)
    analysed = replace(quick, identifiability=analyse_identifiability(optimum))
    return {item.name: item for item in figures_of(analysed)}


@pytest.fixture(scope="module")
def matrix():
    """A sealed check in which every effect was drawn, and each was taken for the next once."""
    rows = [*EFFECTS, "none", "left_out", "never_listed"]
    columns = [*EFFECTS, "several", "none", "unknown", "failed", "absorbed"]
    counts = 4 * np.array([[row == column for column in columns] for row in rows])
    n = len(EFFECTS)
    counts[:n, 1 : n + 1] += np.eye(n, dtype=int)
    bins = [{"stated": 0.9, "percent": 85.0, "interval": [70.0, 95.0]}]
    return withheld_figure(
        {
            "confusion": {"rows": rows, "columns": columns, "counts": counts.tolist()},
            "calibration": {"bins": bins, "expected_calibration_error": 0.05},
        }
    )


@pytest.fixture
def profile():
    """A parabola, walked as far as correlated residuals ask."""
    values = 17.0 + np.linspace(-9, 9, 9)
    costs = 0.5 * np.linspace(-9, 9, 9) ** 2
    ends = (ProfileEnd.THRESHOLD, ProfileEnd.THRESHOLD)
    return Profile("M", "kg", values, costs, ("converged",) * 9, 17.0, ends, 0.95, 1.0, 4.0)


def overlaps(figure):
    """Pairs of neighbouring texts that cover each other: ticks of an axis, what panels hold."""
    figure.draw_without_rendering()  # lays it out
    pairs = []
    for axes in figure.axes:
        if not axes.get_visible() or axes.name == "3d":
            continue
        groups = [axis.get_ticklabels() for axis in (axes.xaxis, axes.yaxis)]
        groups.append([*axes.texts, axes.title])
        groups.append([axes.xaxis.label, axes.yaxis.label, axes.title])
        for group in groups:
            shown = [text for text in group if text.get_text() and text.get_visible()]
            boxes = [(text.get_text(), text.get_window_extent()) for text in shown]
            for (pair, first), (other, second) in combinations(boxes, 2):
                across = min(first.x1, second.x1) - max(first.x0, second.x0)
                along = min(first.y1, second.y1) - max(first.y0, second.y0)
                # Boxes are a little larger than their letters.
                if across > 1.5 and along > 3.0:
                    pairs.append((pair, other))
    return pairs


@pytest.mark.slow
def test_every_family_is_drawn(drawn):
    assert set(drawn) == {
        "overview",
        "parameters",
        "validation_validate[8:10 s]",
        "flow_map",
        "residual_map",
        "regressor",
        "cross_validation_validate[8:10 s]",
        "output_error",
        "residuals",
        "correlations",
        "all_correlations",
    }


def test_every_quantity_has_its_unit(drawn):
    for name, item in drawn.items():
        for axes in item.figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                label = axis.get_label_text()
                if label:
                    assert "[" in label, (name, label)
        labels = [axes.get_ylabel() for axes in item.figure.axes]
        assert any(labels) or name in NAMES, name


def test_the_lowest_panel_has_a_time_axis(drawn):
    for name in ("output_error", "validation_validate[8:10 s]"):
        assert drawn[name].figure.axes[-1].get_xlabel() == "$t$ [s]"


def test_figures_are_as_wide_as_a_column_or_the_page(drawn):
    for name, item in drawn.items():
        wide = name == "overview" or name.startswith("validation_")
        width = PAGE if wide else COLUMN
        assert item.figure.get_figwidth() == pytest.approx(width * MM)


@pytest.mark.slow
def test_a_tight_box_cuts_nothing_off(drawn):
    """So do notebooks save: without care legends are lost, and no width is that of a column."""
    for name, item in drawn.items():
        # `savefig` with a tight box cuts each figure to what this says.
        tight = item.figure.get_tightbbox()
        np.testing.assert_array_equal(tight, item.figure.bbox_inches, err_msg=name)
    figure, saved = drawn["parameters"].figure, BytesIO()  # whose legend is above its axes
    figure.savefig(saved, format="png", bbox_inches="tight", pad_inches=0)
    both = [
        matplotlib.image.imread(BytesIO(content)) for content in (png(figure), saved.getvalue())
    ]
    np.testing.assert_array_equal(*both)


@pytest.mark.slow
def test_letters_are_legible_and_cover_no_others(drawn, matrix):
    figures = {name: item.figure for name, item in drawn.items()}
    for name, figure in (figures | {"matrix": matrix}).items():
        texts = [text for text in figure.findobj(Text) if text.get_text().strip()]
        assert min(text.get_fontsize() for text in texts) >= SMALLEST, name
        assert not overlaps(figure), name


def test_right_answers_lie_on_the_numbered_diagonal(matrix):
    axes = matrix.axes[0]
    at = {label.get_text(): tick for label, tick in
          zip(axes.get_xticklabels(), axes.get_xticks(), strict=True)}  # fmt: skip
    counts = {text.get_position(): text.get_text() for text in axes.texts}
    for i, name in enumerate(EFFECTS):
        assert axes.get_yticklabels()[i].get_text() == f"{name.replace('_', ' ')}  {i + 1}"
        assert counts[at[str(i + 1)], i] == "4"
    assert counts[at["none"], len(EFFECTS)] == "4"


@pytest.mark.slow
def test_coefficients_of_the_flow_are_written_as_in_the_paper(drawn):
    (axes, *_) = drawn["all_correlations"].figure.axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert {"$X_{s1}$", r"$\varphi_{7}$", r"$\psi^+_{7}$", r"$\psi^-_{4}$"} <= set(labels)
    assert not any("_minus" in label or "_plus" in label for label in labels)
    assert symbol("stribeck.delta_F") == "Stribeck friction: delta_F"


def test_the_regressor_is_drawn_with_what_it_leaves(drawn, quick):
    above, below = drawn["regressor"].figure.axes[-2:]
    measured, fitted = (line.get_ydata() for line in above.lines)
    used = np.isfinite(fitted)
    assert 0.3 < used.mean() < 1.0  # none at rest
    rho = below.lines[-1].get_ydata()
    np.testing.assert_allclose(rho[used], (measured - fitted)[used])
    error = 100 * np.linalg.norm(rho[used]) / np.linalg.norm(measured[used])
    assert error == pytest.approx(quick.wls.relative_error_percent["force"], rel=1e-6)


def test_a_profile_shows_the_intervals_for_white_and_for_correlated_residuals(profile):
    axes = profile_figure({"M": profile}).axes[0]
    curve = next(line for line in axes.lines if line.get_marker() == "o")
    thresholds = [line.get_ydata()[0] for line in axes.lines if len(line.get_xdata()) == 2]
    assert len(thresholds) == 2
    for threshold, robust in zip(sorted(thresholds), (False, True), strict=True):
        x, y = curve.get_data()
        crossing = np.interp(threshold, y[x >= 0], x[x >= 0])
        assert 17.0 + crossing == pytest.approx(profile.interval(robust=robust)[1])
        assert threshold < axes.get_ylim()[1]


def test_every_figure_has_a_caption_for_those_who_do_not_see_it(drawn):
    assert all(len(item.caption) > 20 for item in drawn.values())


@pytest.fixture
def saved_twice(profile, real_pdf, tmp_path):
    """The files of a figure with symbols and a legend, drawn twice from one result."""
    return [save_figure(profile_figure({"M": profile}), tmp_path / name) for name in "ab"]


@pytest.mark.slow
def test_equal_results_give_equal_files_and_a_pdf_embeds_its_fonts(saved_twice):
    """Type 42, as publishers ask, not the bitmaps of type 3."""
    first, second = saved_twice
    assert [path.suffix for path in first] == [".png", ".svg", ".pdf"]
    for one_file, other in zip(first, second, strict=True):
        assert one_file.read_bytes() == other.read_bytes(), one_file.suffix
    content = first[2].read_bytes()
    assert b"/FontFile2" in content and b"/Type3" not in content


def test_a_figure_that_a_worker_cannot_draw_is_drawn_here(profile, tmp_path):
    class Broken(Executor):
        def submit(self, fn, /, *given, **named):
            job = Future()
            job.set_exception(RuntimeError("killed"))
            return job

    figure = Drawn("m", profile_figure({"M": profile}), "Cost over M.")
    (picture,) = save_figures([figure], tmp_path / "figures", Broken())
    assert picture.content and len(list((tmp_path / "figures").iterdir())) == 3


def test_figures_can_be_sent_to_other_processes(drawn):
    assert all(pickle.loads(pickle.dumps(item)).name == item.name for item in drawn.values())


def test_plots_need_matplotlib(monkeypatch):
    known = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec",
        lambda name, *given: None if name == "matplotlib" else known(name, *given),
    )
    monkeypatch.delitem(vars(pneumo_casadi), "plot", raising=False)
    drawing = ("pneumo_casadi.report.plot", "pneumo_casadi.report.figures")
    for name in [name for name in sys.modules if name.startswith(drawing)]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(MissingExtraError, match=r"pip install 'pneumo-casadi\[plot\]'"):
        _ = pneumo_casadi.plot


def modules_imported(path):
    """Return the modules that a file imports, at its head or in a function."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_plots_never_go_through_pyplot(drawn):
    """It would keep every figure, and choose a window for it."""
    package = Path(pneumo_casadi.__file__).parent
    files = [path for path in package.rglob("*.py") if "matplotlib" in path.read_text("utf-8")]
    imported = {path.name: modules_imported(path) for path in files}
    assert sum(any("matplotlib" in name for name in names) for names in imported.values()) > 15
    assert not [name for name, names in imported.items() if any("pyplot" in n for n in names)]
    assert drawn and not Gcf.get_all_fig_managers()


@pytest.mark.slow
def test_a_scattered_flow_map_is_drawn_too(quick):
    keep = np.arange(quick.flow_map.n) % 7 != 3
    table = quick.flow_map.select(keep)
    assert not table.is_grid
    model = fit_polynomials(table)
    flow_map_figure(table, model).draw_without_rendering()
    residual_map_figure(table, model).draw_without_rendering()


def test_without_matplotlib_a_report_has_its_tables_and_names_the_extra(
    quick, tmp_path, without_pictures, caplog
):
    folder = write_identification(quick, tmp_path / "report")
    assert list((folder / "figures").iterdir()) == []
    page = (folder / "report.html").read_text("utf-8")
    assert "<img" not in page
    assert "pneumo-casadi[plot]" in page and "pneumo-casadi[plot]" in caplog.text
    assert "X_s1" in page
