import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.robust_covariance import stationary_sandwich
from pneumo_casadi.estimation.wls import LinearSystem, linear_combinations, ratios, solve_wls
from pneumo_casadi.estimation.wls.linear_system import stack_systems

# NIST StRD, Longley (1967): certified estimates, standard deviations and residual deviation.
LONGLEY = np.array(
    [
        [60323, 83.0, 234289, 2356, 1590, 107608, 1947],
        [61122, 88.5, 259426, 2325, 1456, 108632, 1948],
        [60171, 88.2, 258054, 3682, 1616, 109773, 1949],
        [61187, 89.5, 284599, 3351, 1650, 110929, 1950],
        [63221, 96.2, 328975, 2099, 3099, 112075, 1951],
        [63639, 98.1, 346999, 1932, 3594, 113270, 1952],
        [64989, 99.0, 365385, 1870, 3547, 115094, 1953],
        [63761, 100.0, 363112, 3578, 3350, 116219, 1954],
        [66019, 101.2, 397469, 2904, 3048, 117388, 1955],
        [67857, 104.6, 419180, 2822, 2857, 118734, 1956],
        [68169, 108.4, 442769, 2936, 2798, 120445, 1957],
        [66513, 110.8, 444546, 4681, 2637, 121950, 1958],
        [68655, 112.6, 482704, 3813, 2552, 123366, 1959],
        [69564, 114.2, 502601, 3931, 2514, 125368, 1960],
        [69331, 115.7, 518173, 4806, 2572, 127852, 1961],
        [70551, 116.9, 554894, 4007, 2827, 130081, 1962],
    ]
)
LONGLEY_ESTIMATE = [
    -3482258.63459582,
    15.0618722713733,
    -0.358191792925910e-01,
    -2.02022980381683,
    -1.03322686717359,
    -0.511041056535807e-01,
    1829.15146461355,
]
LONGLEY_STD = [
    890420.383607373,
    84.9149257747669,
    0.334910077722432e-01,
    0.488399681651699,
    0.214274163161675,
    0.226073200069370,
    455.478499142212,
]


def system(Y, W, equation=None, names=None, instant=None, shared_error=None):
    r, n = W.shape
    labels = np.zeros(r, dtype=np.intp) if equation is None else equation
    return LinearSystem(
        Y=Y,
        W=W,
        names=names or tuple("abcdefgh"[:n]),
        equations=tuple(f"e{i}" for i in range(int(labels.max()) + 1)),
        equation=labels,
        instant=np.arange(r) if instant is None else instant,
        shared_error=shared_error,
    )


def test_certified_estimates_and_deviations_of_longley_are_reached():
    W = np.column_stack([np.ones(16), LONGLEY[:, 1:]])
    fit = solve_wls(system(LONGLEY[:, 0], W))
    np.testing.assert_allclose(fit.estimate, LONGLEY_ESTIMATE, rtol=1e-8)
    np.testing.assert_allclose(fit.std, LONGLEY_STD, rtol=1e-8)
    assert fit.residual_std["e0"] == pytest.approx(304.854073561965, rel=1e-9)


def ar1(rng, r, rho):
    return lfilter([1.0], [1.0, -rho], rng.normal(size=r))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rho", "classical", "robust"),
    [(0.0, (0.92, 0.98), (0.88, 0.98)), (0.8, (0.4, 0.7), (0.85, 0.98))],
)
def test_intervals_cover_the_truth_and_only_robust_ones_where_residuals_are_correlated(
    rho, classical, robust
):
    truth = np.array([1.0, -2.0, 0.5])
    t = np.arange(600)
    W = np.column_stack([np.ones(600), np.sin(t / 60), np.cos(t / 25)])
    rng = np.random.default_rng(7)
    inside = np.zeros(2)
    seeds = 150
    for _ in range(seeds):
        fit = solve_wls(system(W @ truth + 0.1 * ar1(rng, 600, rho), W))
        gap = np.abs(fit.estimate - truth)
        inside += [np.mean(gap < 1.96 * fit.std), np.mean(gap < 1.96 * fit.std_hac)]
    assert classical[0] < inside[0] / seeds < classical[1]
    assert robust[0] < inside[1] / seeds < robust[1]


@pytest.mark.slow
def test_intervals_contain_an_error_that_all_rows_share():
    rng = np.random.default_rng(11)
    t = np.linspace(0, 1, 200)
    W = np.column_stack([np.ones(200), t])
    D = 0.3 * np.column_stack([t**2, np.sin(9 * t)])
    inside = np.zeros(2)
    runs = 120
    for _ in range(runs):
        Y = W @ [1.0, -2.0] + D @ rng.normal(size=2) + 0.05 * rng.normal(size=200)
        known, ignored = (solve_wls(system(Y, W, shared_error=part)) for part in (D, None))
        for k, fit in enumerate((known, ignored)):
            inside[k] += np.mean(np.abs(fit.estimate - [1.0, -2.0]) < 1.96 * fit.std_hac)
        np.testing.assert_allclose(known.estimate, ignored.estimate)
        np.testing.assert_allclose(known.std, ignored.std)
    assert 0.92 < inside[0] / runs < 0.98
    assert inside[1] / runs < 0.8


def two_equations(rng, r=400, sigma=(0.1, 10.0)):
    W = rng.normal(size=(2 * r, 3))
    equation = np.repeat([0, 1], r)
    Y = W @ [1.0, 2.0, 3.0] + rng.normal(size=2 * r) * np.array(sigma)[equation]
    return Y, W, equation


def test_each_equation_is_weighted_with_its_own_residual_deviation():
    rng = np.random.default_rng(3)
    gaps = []
    for _ in range(60):
        Y, W, equation = two_equations(rng)
        fit = solve_wls(system(Y, W, equation))
        gaps.append((fit.estimate - [1, 2, 3]) / fit.std)
        assert fit.residual_std["e0"] == pytest.approx(0.1, rel=0.15)
        assert fit.residual_std["e1"] == pytest.approx(10.0, rel=0.15)
    assert np.std(gaps) == pytest.approx(1.0, abs=0.15)
    assert np.max(fit.std) < 0.01  # the noisy equation spoils nothing: 10/√400 = 0.5 alone


def test_known_deviations_are_used_as_given():
    Y, W, equation = two_equations(np.random.default_rng(5))
    known = solve_wls(system(Y, W, equation), equation_std={"e0": 0.1, "e1": 10.0})
    weighted = W / np.array([0.1, 10.0])[equation][:, None]
    expected = np.linalg.lstsq(weighted, Y / np.array([0.1, 10.0])[equation], rcond=None)[0]
    np.testing.assert_allclose(known.estimate, expected, rtol=1e-12)


@settings(max_examples=30)
@given(st.lists(st.floats(-9, 9), min_size=3, max_size=3), st.integers(0, 100))
def test_scaling_a_column_scales_its_parameter_and_deviation_inversely(exponents, seed):
    factors = 10.0 ** np.array(exponents)
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(60, 3))
    Y = rng.normal(size=60)
    plain, scaled = solve_wls(system(Y, W)), solve_wls(system(Y, W * factors))
    np.testing.assert_allclose(scaled.estimate * factors, plain.estimate, rtol=1e-9)
    np.testing.assert_allclose(scaled.std * factors, plain.std, rtol=1e-9)
    assert scaled.condition_number == pytest.approx(plain.condition_number, rel=1e-9)


def test_a_rank_deficient_matrix_is_refused_with_the_combinations_that_can_be_estimated():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(80, 2))
    names = ("X_s1", "X_s2", "X_s3")
    words = r"rank 2 for 3 .*X_s2 \+ 0\.97 X_s3.* Hold 1 of X_s2, X_s3 \(`--fix"
    with pytest.raises(FitError, match=words) as caught:
        solve_wls(system(W[:, 0], np.column_stack([W, 0.97 * W[:, 1]]), names=names))
    assert caught.value.partial.expressions == ("X_s1", "X_s2 + 0.97 X_s3")


def test_records_far_apart_share_no_correlation():
    rng = np.random.default_rng(1)
    parts = []
    for _ in range(2):
        W = np.ones((50, 1))
        parts.append(system(rng.normal(size=50), W))
    both = stack_systems(parts)
    assert both.instant[50] - both.instant[49] > 13  # lags for 100 instants


@given(st.integers(12, 40), st.integers(1, 8), st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_the_stationary_covariance_sums_over_all_pairs_of_rows_whatever_is_missing(T, lags, seed):
    rng = np.random.default_rng(seed)
    seen = [np.sort(rng.choice(T, T - 4 * e, replace=False)) for e in range(2)]
    equation, instant = np.repeat([0, 1], [T, T - 4]), np.concatenate(seen)
    W, r = rng.normal(size=(equation.size, 2)), rng.normal(size=equation.size)
    inverse = np.linalg.inv(W.T @ W)
    leverage = np.einsum("ij,jk,ik->i", W, inverse, W)
    kept = np.array([1 - leverage[equation == e].mean() for e in (0, 1)])[equation]
    products = np.outer(r, r) / np.sqrt(np.outer(kept, kept))
    apart = instant[:, None] - instant[None, :]
    omega = np.zeros_like(products)
    for pair in ((0, 0), (0, 1), (1, 0), (1, 1)):
        for j in range(-lags, lags + 1):
            these = (apart == j) & np.outer(equation == pair[0], equation == pair[1])
            if these.any():
                omega[these] = products[these].mean() * (1 - abs(j) / (lags + 1))
    expected = inverse @ W.T @ omega @ W @ inverse
    result = stationary_sandwich(inverse, W, r, equation, instant, lags)
    np.testing.assert_allclose(result, expected, atol=1e-10 * np.abs(expected).max())


def test_values_that_are_not_finite_and_too_few_rows_are_refused():
    with pytest.raises(ModelError, match="not finite"):
        system(np.array([1.0, np.nan, 2.0]), np.ones((3, 1)))
    with pytest.raises(ModelError, match="3 rows cannot determine 3 parameters"):
        system(np.ones(3), np.eye(3))


@pytest.mark.slow
def test_derived_quantities_have_the_spread_of_their_formulas():
    rng = np.random.default_rng(9)
    W = rng.normal(size=(200, 2))
    results, stds = [], []
    for _ in range(300):
        fit = solve_wls(system(W @ [2.0, 4.0] + 0.3 * rng.normal(size=200), W))
        total = linear_combinations(fit, {"sum": {"a": 1.0, "b": 1.0}, "a": {"a": 1.0}})
        ratio = ratios(fit, {"k": ("b", "a")})
        results.append([*total.values, *ratio.values])
        stds.append([*total.std, *ratio.std])
    np.testing.assert_allclose(np.mean(results, axis=0), [6.0, 2.0, 2.0], rtol=5e-3)
    np.testing.assert_allclose(np.std(results, axis=0), np.mean(stds, axis=0), rtol=0.12)
    with pytest.raises(ModelError, match="k: c was not estimated"):
        ratios(fit, {"k": ("c", "a")})
