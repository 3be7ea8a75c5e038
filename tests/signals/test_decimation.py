import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import signal

from pneumo_casadi.errors import ModelError
from pneumo_casadi.signals import Decimation, decimated_rows, parallel_decimate, passband_edge

KINDS = list(Decimation)


@settings(max_examples=25)
@given(
    X=arrays(float, 3, elements=st.floats(-1e3, 1e3)),
    factor=st.integers(1, 12),
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 1000),
)
def test_an_exact_linear_relation_stays_exact_edges_included(X, factor, kind, seed):
    W = np.random.default_rng(seed).normal(size=(400, 3)) * [1.0, 1e-3, 50.0]
    W[200:] += 10.0  # a jump, as a held input makes it
    columns = parallel_decimate(np.column_stack([W @ X, W]), factor, kind)
    size = np.abs(W).max(axis=0) @ np.abs(X) + 1e-300
    assert np.abs(columns[:, 0] - columns[:, 1:] @ X).max() < 1e-11 * size


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("factor", [5, 50, 200])
def test_the_useful_band_passes_and_what_would_alias_does_not(kind, factor):
    fs = 1e3
    t = np.arange(40_000) / fs
    edge = passband_edge(factor, fs)
    rows = decimated_rows(t.size, factor)
    middle = slice(rows.size // 4, -rows.size // 4)
    low = np.sin(2 * np.pi * 0.3 * edge * t)
    high = np.sin(2 * np.pi * 2.0 * edge * t)
    passed = parallel_decimate(low, factor, kind)
    np.testing.assert_allclose(passed[middle], low[rows][middle], atol=0.013)
    assert np.abs(parallel_decimate(high, factor, kind)[middle]).max() < 4e-3


def test_a_constant_keeps_its_size():
    for kind in KINDS:
        np.testing.assert_allclose(parallel_decimate(np.full(900, 7.0), 9, kind), 7.0, rtol=1e-9)


def test_the_chebyshev_kind_is_matlabs_up_to_its_gain_at_zero_frequency():
    values = np.random.default_rng(3).normal(size=5000)
    b, a = signal.cheby1(8, 0.05, 0.8 / 4)
    matlab = signal.filtfilt(b, a, values, padlen=24)[decimated_rows(5000, 4)]
    ours = parallel_decimate(values, 4) * 10 ** (-0.1 / 20)
    np.testing.assert_allclose(ours, matlab, atol=1e-6)


@given(N=st.integers(1, 500), factor=st.integers(1, 40))
def test_rows_are_one_factor_apart_and_end_with_the_last_sample(N, factor):
    rows = decimated_rows(N, factor)
    assert rows[-1] == N - 1
    assert rows.size == -(-N // factor)
    assert 0 <= rows[0] < factor
    assert np.all(np.diff(rows) == factor)


def test_a_factor_that_is_no_count_or_too_large_is_refused():
    with pytest.raises(ModelError, match="must be a whole number"):
        parallel_decimate(np.zeros(100), 0)
    with pytest.raises(ModelError, match="too few to decimate by 50"):
        parallel_decimate(np.zeros(100), 50)
