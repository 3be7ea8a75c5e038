"""Identifiability: the gauge, collinear pairs, and records are called by their names."""

import numpy as np
import pytest

from pneumo_casadi.estimation.uncertainty import (
    analyse_identifiability,
    block_bootstrap,
    collinear_groups,
    profile_likelihoods,
)
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.report.figures.identification.identifiability import (
    clustered_correlation_figure,
    profile_figure,
)
from pneumo_casadi.report.tables.identifiability import identifiability_tables, interval_table
from pneumo_casadi.report.text.identification import render

CHAMBERS = [f"X_s{i}" for i in range(1, 7)]


class Drag(Effect):
    """Force growing with v and, by a share, with v³: beside f_v nearly or exactly the same."""

    name = "drag"
    parameters = (Parameter("c", 0.0, "N s/m", scale=10.0, null=0.0),)

    def __init__(self, cubic):
        self.cubic = cubic

    def force(self, F, at):
        return F - at["c"] * at.v * (1 + self.cubic * at.v**2)


@pytest.fixture(scope="module")
def both(made, motion, forward, optimum):
    axis, u, x = motion
    return optimum(axis, [forward, made.recorded(axis, u, x, 0, name="both ways")])


@pytest.fixture(scope="module")
def two_records(both):
    return analyse_identifiability(both)


def test_a_parameter_is_informed_by_the_record_that_excites_it(two_records):
    assert two_records.sources == ("forward", "both ways")
    assert two_records.informing("F_c_minus") == {"both ways": 1.0, "forward": 0.0}
    np.testing.assert_allclose(two_records.share.sum(axis=0), 1.0)
    at = two_records.names.index("F_c_minus")
    # Forward alone says nothing; without it the other says less, but something.
    assert two_records.std_without[1, at] == np.inf
    assert 1.0 < two_records.std_without[0, at] < 20.0
    others = [i for i in range(4) if i != at]
    assert np.isfinite(two_records.std_without[:, others]).all()
    assert np.all(two_records.std_without >= 1 - 1e-9)


def test_what_records_say_adds_up_to_what_the_fit_knows(both, two_records):
    parts = [both.information_of(i) for i in range(2)]
    np.testing.assert_allclose(
        sum(parts), both.information, atol=1e-6 * np.abs(both.information).max()
    )
    covariance = np.linalg.inv(sum(parts)) * np.outer(both.sizes, both.sizes)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), both.result.uncertainty.std, rtol=1e-4)
    s = two_records.singular_values
    assert np.all(np.diff(s) <= 0) and two_records.condition == pytest.approx(s[0] / s[-1])
    np.testing.assert_allclose(s**2, np.linalg.eigvalsh(both.information)[::-1], rtol=1e-6)
    # The variance of the worst direction is that of its combination.
    worst = two_records.directions[-1]
    assert worst.relative_std == pytest.approx(1 / s[-1])


def test_one_record_is_all_there_is(white):
    analysis = analyse_identifiability(white)
    assert analysis.sources == ("made",) and np.all(analysis.share == 1.0)
    assert np.all(np.isinf(analysis.std_without))
    assert not analysis.weak() and not analysis.at_bound and not analysis.uninformed


@pytest.mark.slow
def test_the_gauge_is_named_where_its_anchor_is_weak(servo):
    """All flows and all X_s times one constant change no trajectory."""
    strong, weak = (analyse_identifiability(servo(noise)) for noise in (1.0, 200.0))
    assert not strong.weak(0.02)
    gauge = weak.weak(0.02)[0]
    parts = [gauge.weights[name] for name in CHAMBERS]
    assert np.ptp(parts) < 0.25 * np.mean(parts)  # all alike, in units of their values
    assert {"psi_plus_0", "psi_minus_0"} <= set(gauge.weights)
    assert gauge.relative_std > 10 * strong.directions[-1].relative_std
    # The map alone knows the scale of the flows: without it they and X_s are lost.
    assert weak.sources[-1] == "flow map"
    lost = [weak.names.index(name) for name in CHAMBERS]
    assert np.all(np.isinf(weak.std_without[-1, lost]))
    mass = weak.names.index("M")
    assert weak.std_without[-1, mass] < 2 and weak.share[0, mass] == 1.0
    assert {*CHAMBERS} - {"X_s2"} <= set(weak.clusters[0])  # X_s2 is the least known by itself


@pytest.mark.slow
def test_pairs_made_collinear_are_named(made, motion, optimum):
    axis, u, x = motion
    record = made.recorded(axis, u, x, 0)
    nearly = analyse_identifiability(optimum(axis.with_effects(Drag(0.3)), [record]))
    pair = nearly.collinear[0]
    assert [group for group in nearly.collinear if len(group.names) == 2] == [pair]
    assert pair.names == ("f_v", "drag.c") and 10 < pair.index < 1000
    assert any({"f_v", "drag.c"} <= set(cluster) for cluster in nearly.clusters)
    worst = nearly.directions[-1].weights
    assert set(worst) >= {"f_v", "drag.c"} and worst["f_v"] * worst["drag.c"] < 0
    assert not nearly.uninformed


@pytest.mark.slow
def test_parameters_that_do_the_same_have_no_interval(made, motion, optimum):
    axis, u, x = motion
    analysis = analyse_identifiability(
        optimum(axis.with_effects(Drag(0.0)), [made.recorded(axis, u, x, 0)])
    )
    assert set(analysis.uninformed) == {"f_v", "drag.c"} and analysis.condition == np.inf
    at = [analysis.names.index(name) for name in ("f_v", "drag.c")]
    assert np.all(np.isinf(analysis.std[at])) and np.isfinite(analysis.std[0])
    worst = analysis.weak()[0]
    assert worst.relative_std == np.inf and set(worst.weights) == {"f_v", "drag.c"}
    assert analysis.collinear[0].names == ("f_v", "drag.c") and analysis.collinear[0].index > 1e4
    text = "\n".join(render(table) for table in identifiability_tables(analysis))
    assert "∞ (no information)" in text and "drag.c" in text


def test_a_parameter_at_its_bound_has_no_interval(made, motion, optimum):
    axis, u, x = motion
    p = axis.parameters.with_values({"f_v": 15.0}).bounded("f_v", 0.0, 20.0)
    analysis = analyse_identifiability(
        optimum(axis.with_parameters(p), [made.recorded(axis, u[:600], x[:, :600], 0)])
    )
    assert analysis.at_bound == ("f_v",) and analysis.singular_values.size == 3
    assert analysis.std[analysis.names.index("f_v")] == np.inf
    assert not any("f_v" in d.weights for d in analysis.directions)
    assert "∞ (at its bound)" in render(identifiability_tables(analysis)[0])


def test_three_parameters_of_one_plane_are_a_triple_and_no_pair():
    rng = np.random.default_rng(0)
    J = rng.standard_normal((500, 5))
    J[:, 4] = J[:, 0] + J[:, 1] + 1e-2 * rng.standard_normal(500)
    (group,) = collinear_groups(J.T @ J, list("abcde"))
    assert group.names == ("a", "b", "e")
    # Brun et al.: 1/γ is what remains of the unit combination of the normalised columns.
    normal = J[:, [0, 1, 4]] / np.linalg.norm(J[:, [0, 1, 4]], axis=0)
    assert group.index == pytest.approx(1 / np.linalg.svd(normal)[1][-1], rel=1e-6)


@pytest.mark.slow
def test_uncertainty_is_printed_and_drawn(white, one_way, two_records):
    tables = {t.title: render(t) for t in identifiability_tables(two_records)}
    first = tables["Sources of information on each parameter"]
    row = next(line for line in first.splitlines() if line.startswith("F_c⁻"))
    assert "100 % (×∞)" in row and " 0 % (×" in row
    assert "Condition number of the scaled sensitivities" in "".join(tables.values())
    profiles = profile_likelihoods(white, ["M", "F_c"])
    intervals = render(interval_table(white.result, profiles, block_bootstrap(white, 40)))
    M = next(line for line in intervals.splitlines() if line.startswith("M "))
    low, high = white.result.interval("M")
    assert f"[{low:.5f}, {high:.5f}]" in M and M.count("[") == 5
    profiles |= profile_likelihoods(one_way, ["F_c_minus"])
    open_sided = render(interval_table(one_way.result, profiles))
    assert "[-∞, +∞]" in open_sided
    for figure in (profile_figure(profiles), clustered_correlation_figure(two_records)):
        labels = [axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes]
        assert any("[" in label for label in labels)
        figure.draw_without_rendering()
