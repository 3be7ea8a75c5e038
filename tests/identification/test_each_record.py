"""Several records: the estimates from each beside those of all, and their spread."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import Grade, read_case
from pneumo_casadi.estimation.output_error import RecordEstimates, each_record
from pneumo_casadi.identification.identify import identify
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.identification.warnings import result_warnings
from pneumo_casadi.report.tables.content import all_tables
from pneumo_casadi.report.tables.parameters import record_table
from pneumo_casadi.valve import FlowForm


def estimates(*masses, std=0.1, failed=()):
    """Return estimates of a mass from records, and of a friction on which all agree."""
    n = len(masses)
    values = np.column_stack([masses, np.full(n, 10.0)])
    return RecordEstimates(
        tuple(f"run_{i + 1}" for i in range(n)),
        ("M", "f_v"),
        values,
        np.full((n, 2), std),
        failed,
    )


def warned(quick, alone):
    """Return the warnings that the estimates from single records add."""
    fit = (quick.case, quick.records, quick.flow_map, quick.wls, quick.output_error)
    plain = result_warnings(*fit, quick.validation)
    return [
        item for item in result_warnings(*fit, quick.validation, None, alone) if item not in plain
    ]


def test_records_that_agree_within_their_intervals_are_no_warning(quick):
    assert warned(quick, estimates(16.9, 17.0, 16.95)) == []


def test_many_records_are_fitted_in_groups_of_neighbours(quick):
    record = quick.records[0]
    many = [replace(record, name=f"run_{i + 1}") for i in range(25)]
    groups = each_record.record_groups(many)
    assert len(groups) == each_record.MOST_FITS
    assert [item for group in groups.values() for item in group] == many
    assert next(iter(groups)) == "run_1 ... run_2"
    assert {len(group) for group in groups.values()} == {2, 3}
    assert list(each_record.record_groups(many[:3])) == ["run_1", "run_2", "run_3"]


def test_records_that_lie_apart_are_a_caution_with_the_factor(quick):
    alone = estimates(16.0, 17.0, 18.0)
    (warning,) = warned(quick, alone)
    assert warning.grade is Grade.CAUTION
    assert f"M ({alone.spread('M'):.1f})" in warning.text and "f_v" not in warning.text


def test_two_records_can_differ_too(quick):
    """Their common interval grows with the difference: by it two are never two σ apart."""
    alone = estimates(16.0, 17.0)
    (warning,) = warned(quick, alone)
    assert alone.spread("M") == pytest.approx(10 / np.sqrt(2)) and "M (7.1)" in warning.text


def test_a_record_counts_by_its_interval():
    alone = estimates(16.9, 30.0)
    wide = replace(alone, std=np.array([[0.1, 0.1], [100.0, 0.1]]))
    assert wide.spread("M") == pytest.approx(0.131, abs=1e-3) and wide.excess("M") < 0.01


def test_a_record_that_cannot_be_fitted_alone_is_a_note(quick):
    (warning,) = warned(quick, estimates(16.9, failed=("run_2",)))
    assert warning.grade is Grade.NOTE and "run_2 could not be fitted" in warning.text


def test_a_record_without_an_interval_is_left_out():
    three = estimates(16.9, 17.1, 30.0)
    std = np.vstack([three.std[:2], [np.inf, 0.1]])
    assert replace(three, std=std).spread("M") == estimates(16.9, 17.1).spread("M")
    assert replace(three, std=np.full((3, 2), np.inf)).spread("M") is None


def test_chance_is_exceeded_in_one_case_of_a_hundred_over_all_parameters():
    rng = np.random.default_rng(1)
    draws = [estimates(*rng.normal(17.0, 0.1, 4)) for _ in range(4000)]
    # One of two parameters: half a per cent, 20 of 4000 give or take 4.5.
    assert 0.0015 < np.mean([alone.excess("M") > 1 for alone in draws]) < 0.0085


@pytest.mark.slow
def test_two_records_stand_beside_all(embedded, monkeypatch):
    case = read_case(embedded)
    records = tuple(  # 1 kHz, a fifth of the samples
        case.identify[0].window(start, start + 1.5).decimate(5, average=("u_P", "u_N"))
        for start in (5.0, 10.0)
    )
    options = IdentifyOptions(FlowForm.POLYNOMIALS, windows=(0.5,), refine_flow=False)
    bench = replace(case.bench, sampling_frequency=case.bench.sampling_frequency / 5)
    both = replace(case, bench=bench, identify=records, validate=())
    result = identify(both, options)
    assert result.each_record is not None
    assert result.each_record.records == tuple(record.name for record in records)
    for name in ("M", "X_s3"):
        assert result.each_record.spread(name) < 4
        low, high = result.output_error.interval(name, robust=True)
        assert (
            low
            < np.mean(result.each_record.values, axis=0)[result.each_record.names.index(name)]
            < high + (high - low)
        )
    table = record_table(result)
    assert table in all_tables(result)
    assert table.columns[2:5] == ("all records", *result.each_record.records)
    content = result_dict(result)["each_record"]
    assert content["spread"]["M"] == result.each_record.spread("M")
    # Who wants no fits of single records gets none, whatever the joint fit is.
    fitted = f"{identify.__module__}.fit_output_error"
    monkeypatch.setattr(fitted, lambda *given: result.output_error)
    assert identify(both, replace(options, each_record=False)).each_record is None


def test_records_of_one_name_are_told_apart(quick):
    record = quick.records[0]
    groups = each_record.record_groups([record, replace(record, name="other"), record])
    assert list(groups) == [f"{record.name} (1)", "other", f"{record.name} (2)"]
    assert [len(group) for group in groups.values()] == [1, 1, 1]
