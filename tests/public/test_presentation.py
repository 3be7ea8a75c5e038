"""Results show themselves briefly: repr, HTML, summary, table."""

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi.runtime.presentation import LONGEST_REPR, Presentable


@pytest.fixture
def results(quick):
    case = quick.case
    return [case, case.identify[0], quick, quick.wls, quick.output_error, quick.validation]


def test_a_repr_is_short_and_says_what_it_is(results):
    for result in results:
        assert 40 < len(repr(result)) < 1200, repr(result)
        assert result.summary().startswith(result.headline)
        assert repr(result).startswith(result.headline.splitlines()[0])


def test_a_repr_of_a_part_is_short_and_begins_with_its_kind(quick):
    """What a notebook shows of an attribute: a whole axis had 12,000 characters."""
    run = quick.validation.runs[0]
    parts = [
        quick.axis, quick.axis.parameters, quick.flow, run, run.open_loop,
        quick.validation.curves[0], quick.case.bench, quick.flow_map,
    ]  # fmt: skip
    for part in parts:
        assert repr(part).startswith(f"{type(part).__name__}("), repr(part)[:80]
        assert 20 < len(repr(part)) < 1200, type(part)
    assert "X_s1 = " in repr(quick.axis.parameters) and "more)" in repr(quick.axis.parameters)


def test_notebooks_get_a_table(results):
    for result in results:
        html = result._repr_html_()
        assert "<table" in html and result.headline.split(":")[0] in html


def test_tables_hold_the_numbers(quick):
    frame = quick.to_frame()
    assert list(frame.index) == list(quick.wls.names)
    assert frame.loc["M", "output_error"] == quick.output_error.parameters["M"].value
    assert frame.loc["M", "output_error_std"] == quick.output_error.std("M", robust=True)
    assert frame.loc["M", "truth"] == quick.truth["M"]
    assert np.array_equal(quick.wls.to_frame()["estimate"], quick.wls.estimate)
    fit = quick.output_error.to_frame()
    assert fit.loc["k_P", "estimate"] == quick.output_error.derived["k_P"].value
    errors = quick.validation.to_frame()
    assert errors.loc[("open loop", "x"), "rms"] == quick.validation.open_loop["x"].rms
    record = quick.case.identify[0]
    assert np.array_equal(record.to_frame()["x_m"], record["x"])


def test_a_long_table_is_cut_in_the_repr_and_whole_in_the_summary():
    class Long(Presentable):
        headline = "many rows"

        def to_frame(self):
            return pd.DataFrame({"value": np.arange(500.0)})

    assert len(repr(Long())) <= LONGEST_REPR + 2 and repr(Long()).endswith("…")
    assert Long().summary().count("\n") == 501


@pytest.mark.slow
def test_results_go_into_papers_and_sheets(results, tmp_path):
    for number, result in enumerate(results):
        latex = result.to_latex()
        assert latex.startswith("\\begin{tabular}{") and latex.rstrip().endswith("\\end{tabular}")
        rows = [line for line in latex.splitlines() if line.endswith("\\\\")]
        assert len({line.count("&") - line.count("\\&") for line in rows}) == 1
        assert len(rows) == len(result.overview()) + 1
        result.to_csv(tmp_path / f"{number}.csv")
        read = pd.read_csv(tmp_path / f"{number}.csv")
        assert len(read) == len(result.to_frame())
