"""With every effect off and a valve that both can describe, bench and model are one axis."""

from dataclasses import replace

import pytest

from pneumo_casadi.virtual_bench import random_axis


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 3])
def test_without_coulomb_friction_the_model_follows_the_bench(bench_sanity, seed):
    axis = replace(bench_sanity.common_axis(random_axis(seed)), F_c_plus=0.0, F_c_minus=0.0)
    apart = bench_sanity.differences(axis, 1e-3, duration=2.0, seed=seed)
    assert max(apart.values()) < 1e-5  # per cent of the signals' ranges


@pytest.mark.slow
def test_smoothed_friction_comes_to_the_set_valued_one_as_its_width_vanishes(bench_sanity):
    axis = bench_sanity.common_axis(random_axis(3))
    coarse, fine = (bench_sanity.differences(axis, v_s, 1.0, 3)["x"] for v_s in (1e-2, 1e-3))
    assert fine < 0.2 * coarse
    assert fine < 0.5


def test_a_wrong_mass_is_seen(bench_sanity):
    axis = replace(bench_sanity.common_axis(random_axis(0)), F_c_plus=0.0, F_c_minus=0.0)
    heavy = replace(axis, M=1.01 * axis.M)
    # The bench runs the heavy axis, the model is told the light one's mass.
    found = bench_sanity.differences(heavy, 1e-3, 1.0, 0, mass=axis.M)
    assert found["v"] > 0.01
