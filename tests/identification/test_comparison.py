"""Results side by side: what moved, and how well each simulates the others' records."""

import json
import math
from dataclasses import replace

import pytest

from pneumo_casadi.data import ValveData, Valves, read_case, write_case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.compare import _differences, compare
from pneumo_casadi.identification.compared_model import compared_model
from pneumo_casadi.identification.comparison import Comparison, Difference
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.pages.report import write_report
from pneumo_casadi.report.tables.comparison import comparison_tables
from pneumo_casadi.runtime.json_files import write_json


@pytest.fixture(scope="module")
def heavier(quick):
    """The identification with a mass that is four of its standard deviations larger."""
    fit = quick.output_error
    M = fit.parameters["M"].value + 4 * math.sqrt(2) * fit.std("M", robust=True)
    axis = fit.axis.with_parameters({"M": M})
    return replace(quick, output_error=replace(fit, axis=axis))


@pytest.fixture(scope="module")
def compared(quick, heavier) -> Comparison:
    return compare(quick, heavier)


def test_a_parameter_that_moved_is_named_with_its_size(compared):
    (moved,) = [item for item in compared.differences if item.moved]
    assert moved.name == "M"
    assert moved.sigmas == pytest.approx(4.0, rel=0.01)  # the wider of ideal and robust
    assert "1 parameter differs by more than 3 σ, most M" in compared.headline
    assert compared.to_frame().loc["M", "sigmas table1 (B)"] == moved.sigmas
    assert "*" in next(row for row in comparison_tables(compared)[0].rows if row[0] == "M")[-1]


def test_each_simulates_the_records_of_each(compared):
    pairs = {(item.parameters, item.records) for item in compared.simulations}
    assert pairs == {(a, b) for a in compared.names for b in compared.names}
    gaps = {(s.parameters, s.records): s.largest[1] for s in compared.simulations}
    own = gaps["table1 (A)", "table1 (A)"]
    assert own == gaps["table1 (A)", "table1 (B)"] < gaps["table1 (B)", "table1 (A)"]
    assert len(compared.simulations_frame()) == 4 * 3


def test_common_records_are_noted(compared):
    assert any("come from the same records" in note for note in compared.notes)


def test_the_comparison_is_strict_json_and_a_folder(compared, without_pictures, tmp_path):
    folder = write_report(compared, tmp_path / "out")
    content = json.loads((folder / "comparison.json").read_text("utf-8"))
    assert content == json.loads(json.dumps(compared.as_dict(), allow_nan=False))
    assert compared.headline in (folder / "comparison.txt").read_text("utf-8")


@pytest.mark.slow
def test_a_result_file_is_compared_with_the_records_of_its_case(quick, tmp_path):
    known = quick.case
    # Of the held-out record the two seconds that `quick` has of it.
    case = write_case(
        tmp_path / "case", known.bench, known.validate, known.validate, known.flow_map_path
    )
    folder = tmp_path / "result"
    folder.mkdir()
    write_json(result_dict(replace(quick, case=read_case(case.folder))), folder / "result.json")
    found = compare(quick, folder)
    assert found.names == ("table1", folder.name)
    assert all(item.sigmas == 0 for item in found.differences)
    assert len(found.simulations) == 4


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("folder"), "does not name its case folder"),
        (lambda c: c.update(folder="/gone"), "/gone"),
        (
            lambda c: c["provenance"]["sha256"].update({"bench.json": "0"}),
            "bench.json changed since",
        ),
    ],
)
def test_without_its_case_a_result_is_compared_by_its_numbers(quick, tmp_path, change, words):
    content = result_dict(quick)
    change(content)
    write_json(content, tmp_path / "result.json")
    found = compare(tmp_path / "result.json", tmp_path)
    assert found.simulations == ()
    assert any(words in note for note in found.notes)


def test_what_cannot_be_compared_is_told(quick, tmp_path):
    with pytest.raises(CaseError, match="two or more"):
        compare(quick)
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(CaseError, match="not a result of `identify`"):
        compare(quick, tmp_path)


@pytest.mark.slow
def test_among_three_results_a_parameter_is_counted_by_its_name(quick, heavier):
    three = compare(quick, heavier, heavier)
    assert "1 parameter differs by more than 3 σ, most M of table1 (B)" in three.headline
    assert Difference("f_v", "B", math.inf, 4.0).change == "from 0"


def test_the_meter_of_one_map_hides_no_difference(quick):
    """Its error is the same in both results."""
    model = compared_model(quick)
    valve = ValveData(accuracy=0.02)
    metered = replace(model.axis, bench=replace(model.axis.bench, valves=Valves(valve, valve)))
    X = model.estimates["X_s3"]
    wide = replace(X, std=math.hypot(1e-3 * X.value, 0.02 * X.value))
    before = replace(model, axis=metered, estimates={"X_s3": wide})
    larger = replace(wide, value=1.05 * wide.value, std=1.05 * wide.std)
    after = replace(before, estimates={"X_s3": larger})
    ((moved,), (apart,)) = (
        _differences((before, each), ("before", "after"))
        for each in (after, replace(after, sources={"flow_map.csv": "another"}))
    )
    assert moved.moved and moved.sigmas == pytest.approx(50 / math.sqrt(2), rel=0.05)
    assert not apart.moved
