"""Time plots: what is stored, what is enlarged, and that names cannot break the page."""

import json

import numpy as np
import pytest

from pneumo_casadi.data.recording.curves import POINTS, Curves, curves_of

t = np.linspace(0.0, 8.0, 40001)
x = np.sin(t)
CURVES = Curves(
    "</script><b>",
    t,
    {"x": "m"},
    {"x": 1e-3},
    {"x": {"measured": x, "open loop": x + 0.1 * (abs(t - 5.0) < 0.2)}},
)


def test_stored_curves_are_thin_and_come_back():
    plain = json.loads(json.dumps(CURVES.as_dict()))
    back = curves_of(plain)
    assert POINTS / 2 < back.t.size <= POINTS
    assert back.simulations == ("open loop",)
    assert np.allclose(back.values["x"]["measured"], np.sin(back.t), rtol=1e-4, atol=1e-5)
    assert len(json.dumps(plain)) < 1e5


def test_the_largest_difference_is_where_it_was_put():
    first, last = CURVES.largest_difference(0.4)
    assert first == pytest.approx(4.8, abs=0.01) and last == pytest.approx(5.2, abs=0.01)


def test_a_record_may_have_any_name():
    pytest.importorskip("bokeh")
    from pneumo_casadi.report.interactive.time_plot import library, time_plot

    assert "</script" not in time_plot(CURVES) and "</script" not in library()
    content = json.loads(time_plot(CURVES))
    assert len(json.dumps(content)) < 2e5


def test_without_bokeh_the_still_figures_stay(monkeypatch):
    from pneumo_casadi.report.pages import page

    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)
    picture = page.Picture("validation_run", b"\x89PNG", "A record.")
    assert page.plots_of([CURVES], [picture]) == ([], [picture])


@pytest.mark.slow
def test_more_simulations_than_colours_are_told_apart_by_their_dashes():
    pytest.importorskip("bokeh")
    from pneumo_casadi.report.figures.time_series import time_series_figure
    from pneumo_casadi.report.pages.page import plots_of

    many = {"measured": x, **{f"run {k}": x + 0.01 * k for k in range(7)}}
    curves = Curves("record", t, {"x": "m"}, {"x": 1e-3}, {"x": many})
    lines = time_series_figure(curves).axes[0].get_lines()[: len(many)]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == len(many)
    ((plot,), _) = plots_of([curves], [])
    assert [name for name, _ in plot.curves] == list(many)
    assert len({background for _, background in plot.curves}) == len(many)
