"""Bootstrap: the scatter that white and coloured noise make, by whomever it is computed."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from pneumo_casadi.errors import CaseError, FitError, ModelError
from pneumo_casadi.estimation.uncertainty import IntervalKind, block_bootstrap, bootstrap
from pneumo_casadi.estimation.uncertainty.optimum import solve_from
from pneumo_casadi.estimation.uncertainty.resampling import block_length, draw_circular_blocks
from pneumo_casadi.estimation.uncertainty.resampling_plan import ResamplingPlan, scale_residuals

#: Replicates whose scatter is judged: it is known to 1/√(2 B) itself.
B = 100
#: Noises to which a fit is made anew, for the scatter that is true, and those resampled.
NEW_NOISES, DRAWS = 60, 20


@pytest.fixture(scope="module")
def replicates(white):
    return block_bootstrap(white, B)


@pytest.mark.slow
def test_on_white_noise_replicates_scatter_as_the_covariance_says(white, replicates):
    assert replicates.lengths == {"made": 1} and not replicates.failures
    share = [replicates.std(name) / white.result.std(name) for name in white.names]
    np.testing.assert_allclose(share, 1.0, atol=4 / np.sqrt(2 * B))
    computed = np.corrcoef(replicates.estimates.T)
    np.testing.assert_allclose(computed, white.result.uncertainty.correlation, atol=4 / np.sqrt(B))
    derived = white.result.derived["F_c"]
    assert replicates.std("F_c") / derived.std == pytest.approx(1.0, abs=4 / np.sqrt(2 * B))
    low, high = replicates.interval("M")
    assert low < white.result.parameters["M"].value < high
    normal = replicates.interval("M", kind=IntervalKind.STANDARD_ERROR)
    assert high - low == pytest.approx(normal[1] - normal[0], rel=0.3)


@pytest.mark.slow
def test_on_coloured_noise_they_scatter_as_fits_to_new_noise_do(coloured, slowly_disturbed, slow):
    """Averaged over noises: a dozen blocks, all that one record has, tell their scatter to 22 %.

    The sandwich is wider by what it adds for that.
    """
    problem, fitted = coloured.problem, coloured.result.fitted[0]
    segment, results = problem.segments[0], []
    for seed in range(1000, 1000 + NEW_NOISES):
        e = slow(seed)[: fitted.size * segment.n].reshape(1, -1, segment.n).mean(axis=2)
        disturbed = replace(problem, segments=(replace(segment, y=fitted + e),))
        results.append(
            solve_from(coloured, disturbed, coloured.point).point.theta[coloured.columns]
        )
    true = np.std(results, axis=0, ddof=1)
    claimed, robust = [], []
    for seed in range(DRAWS):
        fit = slowly_disturbed(seed)
        replicates = block_bootstrap(fit, 6, seed=seed)
        claimed.append([replicates.std(name) for name in fit.names])
        robust.append(fit.result.uncertainty.std_scatter)
    claimed, robust = (np.sqrt(np.mean(np.square(s), axis=0)) for s in (claimed, robust))
    np.testing.assert_allclose(claimed / true, 1.0, atol=0.2)
    assert np.all((claimed > 0.7 * robust) & (claimed < 1.3 * robust))


@pytest.mark.slow
def test_blocks_of_a_given_length_are_taken_at_their_word(coloured):
    result = block_bootstrap(coloured, B // 2)
    assert result.lengths["slow"] > 5  # blocks of the fit, of 5 samples each
    assert all(result.std(name) > 1.4 * coloured.result.std(name) for name in coloured.names)
    single = block_bootstrap(coloured, B // 2, length=5e-3)
    assert single.lengths == {"slow": 1}
    assert single.std("M") < 0.75 * result.std("M")


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.7])
def test_scaled_blocks_make_up_for_their_ends_and_for_what_a_fit_took(rho):
    """Ten slow curves fitted to a thousand points, over and over."""
    rng, K, p = np.random.default_rng(0), 1000, 10
    Q, _ = np.linalg.qr(np.cos(np.pi * np.outer(np.arange(K) + 0.5, np.arange(p)) / K))
    noises = lfilter([1.0], [1.0, -rho], rng.standard_normal((300, K + 100)), axis=1)[:, 100:]
    true = Q.T @ toeplitz(rho ** np.arange(K) / (1 - rho**2)) @ Q
    drawn = []
    for e in noises:
        left = (e - Q @ (Q.T @ e))[None]
        length = block_length(left)
        scaled = scale_residuals(left, length, p * length / K)[0]
        drawn += [Q.T @ scaled[draw_circular_blocks(rng, K, length)] for _ in range(5)]
    scatter = np.sqrt(np.mean(np.square(drawn)) / np.mean(np.diag(true)))
    assert scatter == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_the_noise_of_the_flow_map_scatters_too(anchored):
    result = block_bootstrap(anchored, 30)
    assert result.lengths["flow map"] >= 1
    names = [*(f"X_s{i}" for i in range(1, 7)), *anchored.result.axis.flow.parameters.names]
    share = np.array([result.std(name) / anchored.result.std(name) for name in names])
    assert np.all(np.abs(share - 1) < 0.5)
    k_P = result.std("k_P") / anchored.result.derived["k_P"].std
    assert k_P == pytest.approx(1.0, abs=0.4)


@pytest.mark.slow
def test_replicates_do_not_depend_on_who_computes_them(white, replicates):
    with ThreadPoolExecutor(2) as executor:
        threads = block_bootstrap(white, 25, executor=executor)
    assert threads.replicates == replicates.replicates[:25]


@pytest.mark.slow
def test_replicates_come_back_from_other_processes(white, replicates):
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, context) as executor:
        result = block_bootstrap(white, 11, executor=executor)
    assert result.replicates == replicates.replicates[:11]


@pytest.mark.slow
def test_an_interrupted_run_goes_on_where_it_was(white, replicates, tmp_path, monkeypatch):
    refit, made = bootstrap._refit, []

    def interrupted(optimum, plan, index):
        if len(made) == 5:
            raise KeyboardInterrupt
        made.append(index)
        return refit(optimum, plan, index)

    monkeypatch.setattr(bootstrap, "_refit", interrupted)
    with pytest.raises(KeyboardInterrupt):
        block_bootstrap(white, 12, folder=tmp_path / "replicates")
    monkeypatch.setattr(bootstrap, "_refit", lambda *given: made.append(given[2]) or refit(*given))
    result = block_bootstrap(white, 12, folder=tmp_path / "replicates")
    assert made == list(range(12))  # none twice
    assert result.replicates == replicates.replicates[:12]
    names = sorted(path.name for path in (tmp_path / "replicates").iterdir())
    assert names == [f"replicate_{i:05d}.json" for i in range(12)]


def test_replicates_of_another_bootstrap_and_damaged_ones_are_refused(white, tmp_path):
    block_bootstrap(white, 3, folder=tmp_path)
    with pytest.raises(CaseError, match="another bootstrap"):
        block_bootstrap(white, 3, seed=1, folder=tmp_path)
    with pytest.raises(CaseError, match="another bootstrap"):
        block_bootstrap(white, 3, length=0.05, folder=tmp_path)
    (tmp_path / "replicate_00001.json").write_text('{"index": 1')
    with pytest.raises(CaseError, match=r"replicate_00001\.json: not a replicate"):
        block_bootstrap(white, 3, folder=tmp_path)


@pytest.mark.slow
def test_refits_that_fail_are_reported_and_counted_nowhere(white, replicates, monkeypatch, caplog):
    refit = bootstrap._refit

    def failing(optimum, plan, index, every=3):
        replicate = refit(optimum, plan, index)
        lost = index % every == 0
        return replace(replicate, status="no step helps", values=(0.0,) * 4) if lost else replicate

    monkeypatch.setattr(bootstrap, "_refit", failing)
    result = block_bootstrap(white, 9)
    assert [r.index for r in result.failures] == [0, 3, 6] and len(result.replicates) == 9
    assert "3 of 9 refits failed" in caplog.text
    kept = [r.values for r in replicates.replicates[:9] if r.index % 3]
    np.testing.assert_array_equal(result.estimates, kept)
    monkeypatch.setattr(bootstrap, "_refit", lambda *given: failing(*given, every=1))
    with pytest.raises(FitError, match="9 of 9 refits failed") as caught:
        block_bootstrap(white, 9)
    assert len(caught.value.partial.failures) == 9


def test_what_the_data_say_nothing_about_has_an_infinite_interval(one_way):
    result = block_bootstrap(one_way, 5)
    for name in ("F_c_minus", "F_c"):
        assert result.std(name) == np.inf and result.interval(name) == (-np.inf, np.inf)
    assert 0 < result.std("f_v") < np.inf


def test_too_few_replicates_are_refused(white):
    with pytest.raises(ModelError, match="no scatter"):
        block_bootstrap(white, 1)
    with pytest.raises(ModelError, match=r"too few for quantiles at 0\.95: at least 40"):
        block_bootstrap(white, 3).interval("M")


def test_windows_and_records_keep_their_own_residuals(made, motion, forward, optimum):
    axis, u, x = motion
    loud = made.recorded(axis, u, x, 4, noise=30.0, name="loud")
    fitted = optimum(axis, [loud, forward], window=0.3)
    plan = ResamplingPlan.make(fitted, 0.02, 0)
    assert plan.lengths == (4, 4)
    assert [e.shape[1] for e in plan.residuals] == [199, 99]
    drawn = plan.draw_residuals(0)
    for e, own in zip(drawn, plan.residuals, strict=True):
        assert set(e[0]) <= set(own[0])
    assert np.std(drawn[0]) > 10 * np.std(drawn[1])
    assert not block_bootstrap(fitted, 3, length=0.02).failures


def test_all_channels_are_drawn_together(anchored):
    plan = ResamplingPlan.make(anchored, None, 0)
    own = {tuple(column) for column in plan.residuals[0].T}
    assert {tuple(column) for column in plan.draw_residuals(7)[0].T} <= own


def test_blocks_grow_with_correlation_and_every_residual_is_drawn_equally_often():
    rng = np.random.default_rng(0)
    lengths = []
    for rho in (0.0, 0.5, 0.9):
        e = np.zeros(4000)
        for k in range(1, e.size):
            e[k] = rho * e[k - 1] + rng.standard_normal()
        lengths.append(block_length(e[None]))
        # Twice Politis and White (2004): (1.5 (2 ρ/(1 - ρ²))²)^⅓ K^⅓ for an autoregression.
        wanted = 2 * (1.5 * (2 * rho / (1 - rho**2)) ** 2 * e.size) ** (1 / 3)
        assert 0.5 * wanted <= lengths[-1] <= 1.7 * wanted + 2
    assert lengths == sorted(lengths) and lengths[0] <= 2
    drawn = np.concatenate([draw_circular_blocks(rng, 10, 4) for _ in range(4000)])
    np.testing.assert_allclose(np.bincount(drawn) / drawn.size, 0.1, atol=0.01)
