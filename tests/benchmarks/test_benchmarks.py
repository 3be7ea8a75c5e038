"""Benchmarks keep running: each as its own quick script, and committed results hold the bars."""

import json
from pathlib import Path

import numpy as np
import pytest

RESULTS = Path(__file__).resolve().parents[2] / "benchmarks" / "results"


def result(name):
    return json.loads((RESULTS / f"{name}.json").read_text("utf-8"))


@pytest.mark.parametrize("path", sorted(RESULTS.parent.glob("*.py")), ids=lambda path: path.stem)
def test_a_benchmark_finds_all_that_it_imports(path, script):
    assert script(path).__doc__


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.stem)
def test_a_committed_result_says_how_it_was_made_and_is_no_quick_run(path):
    content = json.loads(path.read_text("utf-8"))
    assert content["machine"] and content["versions"]["casadi"] and "seed" in content
    assert content.get("quick") is not True


def test_ten_minutes_of_recording_are_fitted_in_less_than_one():
    figures = result("scaling")
    longest = max(figures["records"], key=lambda record: record["length_s"])
    assert longest["length_s"] == 600 and longest["samples"] == 3_000_000
    assert longest["seconds"] < 40 and longest["peak_GB"] < 2.5
    assert figures["exponent"] <= 1.05
    assert all(record["iterations"] <= 15 for record in figures["records"])
    six = figures["six_records"]
    assert six["memory_ratio"] < 1.1 and six["time_ratio"] < 1.25
    assert six["largest_difference_in_std"] < 0.1


def test_an_iteration_takes_as_long_as_a_sweep_and_a_half_at_every_length():
    records = result("scaling")["records"]
    assert max(record["iteration_over_sweep"] for record in records) <= 1.5


def test_starts_half_off_reach_the_optimum():
    figures = result("starts")
    assert figures["starts"] == 100 and figures["spread"] == 0.5 and figures["reached"] >= 95


def test_intervals_cover_and_errors_stay_at_the_bound():
    figures = result("wls_vs_output_error")
    assert figures["replicates"] >= 400 and figures["coloured"]["replicates"] >= 400
    # All that is free: chambers, mechanics, the coefficients of the flow map, k_P and k_N.
    assert len(figures["output_error"]) == 33 > len(figures["wls"])
    for name, item in figures["output_error"].items():
        assert item["rms_error_over_bound"] <= 1.1, name
        assert 93 <= item["coverage_percent"] <= 97, name


def test_printed_intervals_of_output_error_cover_under_all_noises_disturbed_or_not():
    figures = result("wls_vs_output_error")
    shares = printed_coverage(figures)
    assert figures["replicates"] >= 1200 and len(shares) == 4 * 33 and min(shares) >= 93
    # A true share of 96.5 % is told to ± 1.1 %.
    assert sum(share > 97 for share in shares) <= 6 and max(shares) < 97.6


def printed_coverage(figures):
    under = (figures, figures["coloured"], *figures["disturbed"].values())
    return [
        item["coverage_percent"] for part in under for item in part["output_error_printed"].values()
    ]


def test_printed_intervals_of_wls_cover_under_all_noises_disturbed_or_not():
    figures = result("wls_coverage")
    assert figures["replicates"] >= 1200
    shares = [
        item["coverage_percent"]
        for by_noise in (figures, figures["disturbed"])
        for noise in ("white", "coloured")
        for item in by_noise[noise]["printed"].values()
    ]
    assert len(shares) == 48 and min(shares) >= 93
    # A true share of 96.5 % is told to ± 1.1 %.
    assert sum(share > 97 for share in shares) <= 2 and max(shares) < 97.5


def test_the_default_form_of_the_flow_map_errs_less_than_eq_12():
    figures = result("flow_form")["summary"]
    default, eq_12 = (figures["forms"][form] for form in ("iso6358", "polynomials_7_7_4"))
    assert set(figures["chosen"]) == {"iso6358"} and figures["chosen"]["iso6358"] >= 20
    assert default["median_rms_error_percent_wls"] < 0.5 * eq_12["median_rms_error_percent_wls"]
    assert default["failed"] <= eq_12["failed"]


def test_errors_by_case_take_k_from_the_quotients_and_tell_what_failed(script):
    table, _ = script(RESULTS.parent / "result_pages.py").TABLES["flow_default"]
    exact = {f"X_s{i}": 0.0 for i in range(1, 7)} | {"X_s2": -50.0, "X_s6": 10.0}
    fits = {
        "polynomials_7_7_4": {"wls": {"errors_percent": exact}, "output_error": None},
        "iso6358": {
            "wls": {"errors_percent": {"X_s3": 1.0, "X_s6": -2.0}},
            "output_error": {"errors_percent": exact, "held_out_percent": 1.234},
        },
    }
    case = {"selection": {"chosen": "iso6358"}, "forms": fits}
    row = table({"cases": {"practice/p00": case}}).splitlines()[-1]
    shown = "50.0 / +100.0 / +10.0"
    assert row == f"| p00, ISO 6358 | {shown} | 2.0 | failed | {shown} |  | 1.23 |"


@pytest.mark.parametrize("name", ["common", "windows", "long"])
@pytest.mark.parametrize("time", ["cold", "warm"])
@pytest.mark.xfail(strict=True, reason="not reached beside JAX, numba and acados")
def test_no_peer_that_reaches_the_optimum_is_near(name, time):
    assert result("peers")["problems"][name][f"speed_up_{time}"] >= 10


def test_programs_written_down_whole_are_far_behind():
    tools = result("peers")["tools"]
    ours = tools["pneumo_casadi"]
    assert ours["reached"]
    for name in ("pyomo.dae + pyomo-pounce", "opty", "do-mpc", "SciPy least_squares", "lmfit"):
        seconds = tools[name].get("total_s") or 60.0  # none: no answer within a minute
        assert seconds >= 10 * ours["total_s"], name


@pytest.mark.parametrize("name", ["common", "windows", "long"])
def test_all_three_problems_are_compared_cold_and_warm(name):
    figures = result("peers")
    problem = figures["problems"][name]
    tools = problem.get("tools", figures["tools"])
    ours = tools["pneumo_casadi"]
    assert ours["reached"] and ours["cost"] <= problem["best_cost"] * 1.001
    rivals = {"JAX", "JAX, multiple shooting", "numba + SciPy", "numba, multiple shooting"}
    assert rivals <= tools.keys()
    assert set(figures["tools"]) == set(tools)  # what is left out stands there with its reason
    for time in ("cold", "warm", "restart"):
        seconds = [row[f"{time}_s"] for row in tools.values() if row["reached"] and row is not ours]
        fastest = min(value for value in seconds if value is not None)
        expected = pytest.approx(fastest / ours[f"{time}_s"])
        assert problem[f"speed_up_{time}"] == expected


def test_real_closed_loops_err_less_than_published():
    figures = result("emps_output_error")
    for name in ("symmetric", "asymmetric"):
        ours = figures["estimators"][f"closed-loop OE, {name} friction"]["closed_loop_percent"]
        for record, theirs in figures["authors"]["closed_loop"].items():
            for signal in ("position", "velocity"):
                assert ours[record][signal] < theirs[signal]


def visible_of(figures, key):
    return figures["scores"]["visible"][key]["percent"]


def weak_of(figures, key):
    return figures["background"]["visible"][key]["percent"]


#: Targets of the sealed check with forms drawn and weak effects besides.
TARGETS = {
    "first": lambda figures: visible_of(figures, "ranked_first") >= 96,
    "alone": lambda figures: visible_of(figures, "right_first") >= 96,
    "all alone": lambda figures: figures["scores"]["all"]["right_first"]["percent"] >= 80,
    "pair_one": lambda figures: visible_of(figures, "pair_one") >= 96,
    "pair_both": lambda figures: visible_of(figures, "pair_both") >= 80,
    "false_alarm": lambda figures: figures["scores"]["all"]["false_alarm"]["percent"] <= 3,
    "unknown_caught": lambda figures: visible_of(figures, "unknown_caught") >= 92,
    "wrongly_named": lambda figures: visible_of(figures, "wrongly_named") <= 2,
    "located": lambda figures: visible_of(figures, "located") >= 95,
    "set_covers": lambda figures: visible_of(figures, "set_covers") >= 97,
    "set_size": lambda figures: figures["scores"]["all"]["set_size"]["mean"] <= 1.3,
    "calibration": lambda figures: figures["calibration"]["expected_calibration_error"] <= 0.05,
    "oracle": lambda figures: figures["scores"]["all"]["shrink_of_oracle"]["median"] >= 0.95,
    "driver_right": lambda figures: figures["discovered"]["driver_right"]["percent"] >= 85,
    "closes": lambda figures: figures["discovered"]["closes"]["median"] >= 0.7,
    "weak names_true": lambda figures: weak_of(figures, "names_true") >= 97,
    "weak dominant_named": lambda figures: weak_of(figures, "dominant_named") >= 95,
    "weak dominant_first": lambda figures: weak_of(figures, "dominant_first") >= 88,
    "weak unknown_caught": lambda figures: weak_of(figures, "unknown_caught") >= 92,
    "weak false_alarm": lambda figures: weak_of(figures, "false_alarm") <= 3,
}


def test_the_sealed_check_is_whole():
    figures = result("withheld_forms")
    assert figures["cases"] >= 200 and figures["background"]["cases"] >= 80
    assert figures["scores"]["all"]["failed"]["hits"] == 0 and not figures["unmeasured"]


@pytest.mark.parametrize("target", TARGETS)
def test_a_target_of_the_sealed_check_is_reached(target):
    assert TARGETS[target](result("withheld_forms"))


def test_stated_probabilities_come_true():
    """One check has too few cases to tell: see `error_if_exact`."""
    figures = result("calibration")
    assert figures["cases"] >= 300
    assert figures["together"]["expected_calibration_error"] <= 0.05


def test_causes_withheld_are_named_and_nothing_else_is():
    figures = result("withheld")
    every, visible = (figures["scores"][key] for key in ("all", "visible"))
    assert figures["cases"] >= 150 and figures["duration_seconds"] == 20
    assert every["right_first"]["percent"] >= 70 and visible["right_first"]["percent"] >= 90
    assert every["set_size"]["mean"] <= 1.5
    assert every["false_alarm"]["percent"] <= 4 and every["unknown_caught"]["percent"] >= 85
    assert every["false_unknown"]["percent"] <= 5
    assert visible["set_covers"]["percent"] >= 95 and visible["located"]["percent"] >= 92
    assert every["pair_one"]["percent"] >= 95 and every["pair_both"]["percent"] >= 65
    assert every["shrink_of_oracle"]["median"] >= 0.9
    assert figures["calibration"]["expected_calibration_error"] <= 0.08
    assert every["failed"]["hits"] == 0 and not figures["unmeasured"]


def test_a_diagnosis_is_timed_on_practice_cases_draws_and_a_long_record():
    figures = result("diagnosis_time")
    assert len(figures["each"]) == 12 and len(figures["draws"]) == 160
    assert figures["median_s"] == np.median(list(figures["each"].values()))
    assert figures["slowest_s"] == max(figures["draws"].values())
    assert figures["median_s"] <= 10 and figures["draws_median_s"] <= 10
    assert figures["cold_extra_s"] <= 10
    assert figures["long_s"] <= 60 and figures["long_GB"] <= 2 and figures["peak_GB"] <= 1.5


def test_the_slowest_draw_is_diagnosed_within_half_a_minute():
    assert result("diagnosis_time")["slowest_s"] <= 30


def test_practice_cases_are_told_right_and_in_time():
    figures = result("practice_verdicts")
    assert figures["right"] >= 11 and figures["of"] == 12
    assert figures["longest_s"] < 60 and figures["peak_GiB"] < 2 / 1.0737


def test_verdicts_without_labels_are_there_for_all_cases():
    cases = {
        name: item
        for name, item in result("blind_verdicts").items()
        if isinstance(item, dict) and "verdict" in item
    }
    assert len(cases) == 18
    for name, case in cases.items():
        assert {"verdict", "effects", "ranking", "where", "gap"} <= case.keys(), name


def test_designed_experiments_keep_their_promise_on_the_bench():
    figures = result("design")
    assert len(figures["precision"]) >= 4
    for axis, item in figures["precision"].items():
        assert item["gain"] > 1.2
        for name, errors in item["parameters"].items():
            assert errors["real"] == pytest.approx(errors["predicted"], rel=0.3), (axis, name)
        shares = item["shares_of_limits"]
        assert shares["position"] <= 1 and shares["command"] <= 1, axis
        assert shares["p_min"] >= 1 and shares["p_max"] <= 1, axis


def test_a_designed_experiment_resolves_what_the_ordinary_record_leaves_open():
    resolved = 0
    for item in result("design")["separation"].values():
        before, after = item["said"]
        assert after["effects"] == [item["hidden"]] and not after["ambiguous"]
        assert (
            after["probability"][item["wrong"]] < 0.1 < 0.8 < after["probability"][item["hidden"]]
        )
        resolved += item["wrong"] in before["ambiguous"]
    assert resolved >= 3


def test_a_batch_costs_little_beside_its_diagnoses():
    figures = result("batch")
    assert {"in turn", "processes", "dask"} <= figures["executors"].keys()
    for name, executor in figures["executors"].items():
        assert executor["outside_percent"] < 5 and executor["same_verdicts"], name
    assert figures["executors"]["processes"]["speed_up"] >= 1.7
    assert figures["executors"]["dask"]["speed_up"] >= 1.7


def test_a_thousand_cases_take_hardly_more_memory_than_two():
    figures = result("many_cases")
    assert figures["cases"] == 1000 and figures["grown_MB"] < 20


def test_the_gap_of_emps_is_friction_that_changes_and_depends_on_position():
    figures = result("emps_gap")
    closed = figures["closure"]
    assert closed["asymmetric viscous friction"] < 0.3
    assert closed["friction of the record"] > 0.6 and closed["terms over position"] > 0.7
    assert all(ripple["share_of_squares"] < 0.1 for ripple in figures["ripple"])
