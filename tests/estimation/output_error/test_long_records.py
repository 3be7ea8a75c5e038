"""Long data: a sample first, windows that the data bear, the same optimum; limits are lowered."""

from dataclasses import replace
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.errors import FitError
from pneumo_casadi.estimation.output_error import (
    Method,
    OutputErrorOptions,
    fit_each_record,
    fit_output_error,
    long_records,
)
from pneumo_casadi.estimation.output_error.long_records import are_long, draw_sample, drift
from pneumo_casadi.estimation.uncertainty import Optimum


@pytest.fixture
def short_is_long(monkeypatch):
    """Take 1.2 s at 1 kHz for long data."""
    monkeypatch.setattr(long_records, "LONG_SAMPLES", 1000)
    monkeypatch.setattr(long_records, "LONG_STEPS", 1000)
    monkeypatch.setattr(long_records, "LONG_RECORD", 0.3)
    monkeypatch.setattr(long_records, "HORIZONS", (0.3, 0.2))


@pytest.fixture(scope="module")
def data(made, servo, start):
    axis, u, x = servo
    table, begin = start(0)
    return (
        begin,
        [made.recorded(axis, u, x, 0)],
        table,
        OutputErrorOptions(widths=(made.TRUE["v_s"],)),
    )


def distance(one, other):
    """Largest difference of two fits in standard deviations."""
    names, std = one.uncertainty.names, one.uncertainty.std
    a, b = (np.array([fit.parameters[n].value for n in names]) for fit in (one, other))
    return np.abs((a - b) / std).max()


@pytest.mark.slow
def test_long_data_reach_the_optimum_of_the_windows_that_they_bear(short_is_long, data):
    begin, records, table, options = data
    long = fit_output_error(begin, records, table, options)
    asked = fit_output_error(begin, records, table, replace(options, window=0.3))
    assert long.status == "converged" and long.chosen_window == pytest.approx(0.3)
    assert asked.chosen_window is None
    assert [s.first for s in long.segments] == [s.first for s in asked.segments]
    assert distance(asked, long) < 0.15  # what steps of a twentieth in rms leave
    assert long.uncertainty.std == pytest.approx(asked.uncertainty.std, rel=1e-2)
    assert Optimum(long, records, table, options).problem.segments[1].first == 300


@pytest.mark.slow
def test_windows_are_shortened_where_the_simulation_drifts(short_is_long, data, monkeypatch):
    growth = chain([10.0], repeat(1.0))
    monkeypatch.setattr(long_records, "drift", lambda _: next(growth))
    begin, records, table, options = data
    assert fit_output_error(begin, records, table, options).chosen_window == pytest.approx(0.2)


@pytest.mark.slow
def test_a_sample_that_does_not_converge_leads_to_shorter_windows(short_is_long, data, monkeypatch):
    fit_stages, lengths = long_records.fit_stages, []

    def fails_at_first(axis, records, *given):
        lengths.append(records[0].duration)
        if len(lengths) == 1:
            raise FitError("does not converge", None)
        return fit_stages(axis, records, *given)

    monkeypatch.setattr(long_records, "fit_stages", fails_at_first)
    assert fit_output_error(*data).chosen_window == pytest.approx(0.2)
    assert lengths == pytest.approx([0.3, 0.2, 1.2], abs=2e-3)


def test_only_much_data_without_a_given_window_are_long(short_is_long, data, monkeypatch):
    begin, records, _, options = data
    assert are_long(begin, records, options)
    assert not are_long(begin, records, replace(options, window=0.3))
    assert not are_long(begin, records, replace(options, method=Method.IPOPT))
    monkeypatch.setattr(long_records, "LONG_RECORD", 10.0)
    assert not are_long(begin, records, options)
    assert are_long(begin, records * 20, options)
    monkeypatch.setattr(long_records, "LONG_STEPS", 10**9)
    assert not are_long(begin, records * 20, options)


@pytest.mark.slow
def test_fits_alone_begin_at_the_joint_optimum(short_is_long, data, monkeypatch):
    begin, (record,), table, options = data
    halves = record.split(2)
    monkeypatch.setattr(long_records, "HORIZONS", (20.0,))
    joint = fit_output_error(begin, halves, table, options)
    alone = fit_each_record(joint, halves, options)
    monkeypatch.setattr(long_records, "LONG_SAMPLES", 10**9)
    cold = fit_each_record(joint, halves, options)
    assert joint.chosen_window is None
    assert alone.records == cold.records == tuple(half.name for half in halves)
    assert np.abs((alone.values - cold.values) / cold.std).max() < 0.05


def test_a_sample_is_drawn_evenly_from_many_records():
    records = [
        Recording(np.arange(10) + 100 * i, {"x": np.zeros(10)}, str(i), "", InputHold.ZERO)
        for i in range(64)
    ]
    assert [piece.t[0] for piece in draw_sample(records, 50.0)] == [800, 2400, 4000, 5600]


def test_windows_of_the_longest_record_are_equal(data):
    _, (record,), _, options = data
    window = long_records.equal_window([record, record.window(0.0, 0.3)], options, 1.0)
    assert window == pytest.approx(0.6)
    assert long_records.equal_window([record], options, 3.0) is None
    assert long_records.equal_window([record], replace(options, closed_loop=True), 0.5) is None


def test_drift_compares_the_ends_of_windows_with_their_beginnings():
    y = np.ones((2, 8))
    y[1, 6:] = 4.0
    result = SimpleNamespace(segments=[SimpleNamespace(y=y, K=8)], fitted=[np.zeros((2, 8))])
    assert drift(result) == pytest.approx(4.0)
