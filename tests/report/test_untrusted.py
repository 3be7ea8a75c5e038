"""An estimate at a bound, without information or of an unfinished fit is shown as such."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.estimation.output_error.result import evaluate_derived_quantities
from pneumo_casadi.estimation.statistics import EstimateStatus, invert_information
from pneumo_casadi.export import export_model, read_model
from pneumo_casadi.export.model import identified_model
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.pages.identification import html_report
from pneumo_casadi.report.tables.parameters import parameter_table
from pneumo_casadi.report.text.identification import text_report

BOUND, UNINFORMED = "X_s2", "f_v"


@pytest.fixture(scope="module")
def doubtful(quick):
    """The example's result with one parameter at a bound and one without information."""
    fit = quick.output_error
    names = fit.uncertainty.names
    information = np.diag([0.0 if name == UNINFORMED else 1e6 for name in names])
    scales = np.array([fit.parameters[name].scale for name in names])
    uncertainty = invert_information(information, scales, names, (BOUND,))
    derived = evaluate_derived_quantities(fit.axis, uncertainty)
    return replace(quick, output_error=replace(fit, uncertainty=uncertainty, derived=derived))


def row(table, name):
    (cells,) = (cells for cells in table.rows if cells[0] == name)
    return dict(zip(table.columns, cells, strict=True))


@pytest.mark.slow
def test_tables_give_the_reason_in_place_of_the_interval(doubtful):
    table = parameter_table(doubtful)
    at_bound = row(table, "X_s2")
    assert at_bound["output error"].endswith("(at bound)") and not at_bound["OE - truth"]
    assert row(table, "f_v")["output error"] == "no information"
    assert "±" in row(table, "M")["output error"] and row(table, "M")["OE - truth"]
    # k_P = X_s3 / X_s2 rests on the one at a bound.
    assert row(table, "k_P")["output error"].endswith("(at bound)")
    assert "±" in row(table, "k_N")["output error"]
    for text in (text_report(doubtful), html_report(doubtful, [])):
        assert "(at bound)" in text and "no information" in text
    frame = doubtful.output_error.to_frame()
    assert frame.status[["X_s2", "f_v", "M", "k_P", "v_s"]].tolist() == [
        *("at bound", "no information", "estimated", "at bound", "held")
    ]


def test_a_fit_that_did_not_converge_has_no_interval(quick):
    unfinished = replace(quick.output_error, status="iteration limit")
    result = replace(quick, output_error=unfinished)
    assert unfinished.status_of("M") is EstimateStatus.NOT_CONVERGED
    assert unfinished.status_of("v_s") is EstimateStatus.HELD
    rows = parameter_table(result).rows
    assert all("±" not in cells[3] and "(not converged)" in cells[3] for cells in rows)
    content = result_dict(result)["output_error"]
    for item in (*content["parameters"].values(), *content["derived"].values()):
        assert item["std"] is None and item["std_robust"] is None
        assert item["status"] == "not converged"


def test_json_and_exports_carry_the_status(doubtful, tmp_path):
    content = result_dict(doubtful)["output_error"]
    status = {name: item["status"] for name, item in content["parameters"].items()}
    assert status["X_s2"] == "at bound" and status["f_v"] == "no information"
    assert set(status.values()) == {"at bound", "no information", "estimated"}
    assert content["parameters"]["X_s2"]["std"] is None and content["parameters"]["X_s2"]["note"]
    assert content["derived"]["k_P"]["status"] == "at bound"
    assert content["derived"]["k_P"]["std_robust"] is None
    for kind in ("json", "c", "ss"):
        export_model(doubtful, tmp_path, kind)
    held = json.loads((tmp_path / "axis.json").read_text("utf-8"))["estimates"]
    assert held["X_s2"]["status"] == "at bound"
    header = (tmp_path / "axis.h").read_text("utf-8")
    assert "(at bound)" in header and "(no information)" in header
    model = read_model(tmp_path / "axis.json")
    assert model.caution("X_s2") == " (at bound)" and model.caution("M") == ""
    forged = replace(identified_model(doubtful), estimates={"M": {"status": "*/ int x;"}})
    assert forged.caution("M") == ""


def test_a_figure_draws_no_point_without_a_bar(doubtful):
    pytest.importorskip("matplotlib")
    from pneumo_casadi.report.figures.identification.parameters import (
        correlation_figure,
        forest_figure,
    )

    (axes,) = forest_figure(doubtful).axes
    assert sorted(text.get_text() for text in axes.texts) == ["at bound", "no information"]
    names = list(doubtful.wls.names)
    points = axes.containers[1].lines[0].get_xdata()
    drawn = {name: bool(np.isfinite(x)) for name, x in zip(names, points, strict=True)}
    assert not drawn["X_s2"] and not drawn["f_v"] and drawn["M"]
    labels = [label.get_text() for label in correlation_figure(doubtful).axes[0].get_xticklabels()]
    assert len(labels) == len(doubtful.parameter_names) - 2


def test_a_deviation_is_drawn_only_where_a_true_value_is(quick):
    pytest.importorskip("matplotlib")
    from pneumo_casadi.report.figures.identification.parameters import forest_figure

    known = replace(quick, truth={"M": 16.0, "f_v": 0.0, "F_c_plus": -15.0})
    (axes,) = forest_figure(known).axes
    words = sorted({text.get_text() for text in axes.texts})
    assert words == ["no true value is known", "the true value is 0"]
    names = list(known.wls.names)
    points = dict(zip(names, axes.containers[1].lines[0].get_xdata(), strict=True))
    assert np.isfinite(points["M"]) and not np.isfinite([points["f_v"], points["X_s2"]]).any()
    assert points["F_c_plus"] > 100  # above a negative truth, not below it
