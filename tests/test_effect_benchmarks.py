"""What a missing effect costs: the committed results of the bench's sanity."""

import json
from pathlib import Path

RESULTS = Path(__file__).resolve().parent.parent / "benchmarks" / "results"


def result(name):
    return json.loads((RESULTS / f"{name}.json").read_text("utf-8"))


def test_the_nominal_fit_of_an_effect_free_bench_leaves_half_a_per_cent_at_most():
    found = result("bench_sanity")
    assert len(found["nominal_fit"]) >= 4
    for one in found["nominal_fit"].values():
        assert one["closed_loop_x_percent_of_motion"] < 0.5
    for one in found["axes"].values():
        assert max(one["mass_error"], one["energy_error"], *one["step_errors"]) < 1e-9
        assert one["agreement_percent"]["without_coulomb_friction"]["x"] < 1e-4
        assert one["agreement_percent"]["with_coulomb_friction"]["v_s = 0.0001 m/s"]["x"] < 0.1
