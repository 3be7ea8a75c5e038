"""Records and cases of the bench: pairing of command and sample, sensors, determinism, folders."""

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import read_case
from pneumo_casadi.errors import CaseError, MissingExtraError, ModelError
from pneumo_casadi.virtual_bench import (
    IDEAL_SENSORS,
    KINDS,
    Experiment,
    make_case,
    random_axis,
    record,
    simulate_axis,
)
from pneumo_casadi.virtual_bench.kernels import jit, layout

SHORT = {"duration": 3.0, "fs": 500.0}


def test_a_command_belongs_to_the_position_of_its_own_row(axis):
    made = record(axis, Experiment.of("multisine"), duration=2.0, seed=2)
    law = np.clip(axis.gain * (made["x_ref"] - made["x"]), -axis.u_max, axis.u_max)
    np.testing.assert_allclose(made["u_P"], law, atol=3.1e-4 + 5e-5)
    np.testing.assert_array_equal(made["u_N"], -made["u_P"])


def test_a_command_acts_from_its_own_sample_on_and_not_before(axis, drive):
    """Two references that part at row k part in u at k and in pressure at k + 1."""
    axis = axis.with_ideal_sensors()
    k = 700
    later = replace(drive, x_ref=np.where(np.arange(drive.x_ref.size) < k, drive.x_ref, 0.1))
    one, two = simulate_axis(axis, drive), simulate_axis(axis, later)
    u_parts = np.flatnonzero(one.rows[:, 0] != two.rows[:, 0])[0]
    p_parts = np.flatnonzero(one.states[:, layout.GAS_P] != two.states[:, layout.GAS_P])[0]
    assert (u_parts, p_parts) == (k, k + 1)


def test_ideal_sensors_show_the_state_of_their_row(axis, drive):
    found = simulate_axis(axis.with_ideal_sensors(), drive)
    shown = found.states[:, [layout.GAS_P, layout.GAS_N, layout.X]]
    np.testing.assert_array_equal(found.rows[:, 2:], shown)


def test_sensors_add_their_noise_and_steps(axis, drive):
    unfiltered = replace(axis, sensors=replace(axis.sensors, bandwidth=0.0))
    found = simulate_axis(unfiltered, drive)
    apart = found.rows[:, 2:] - found.states[:, [layout.GAS_P, layout.GAS_N, layout.X]]
    np.testing.assert_allclose(apart.std(axis=0), [150.0, 150.0, 1.5e-5], rtol=0.1)
    steps = found.rows[:, 4] / axis.sensors.x_quantum
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_an_anti_alias_filter_delays_by_its_two_lags(axis, drive):
    f = 200.0
    filtered = replace(axis.with_ideal_sensors(), sensors=replace(IDEAL_SENSORS, bandwidth=f))
    found = simulate_axis(filtered, drive)
    x, v = found.states[:, layout.X], found.states[:, layout.V]
    smooth = np.abs(np.gradient(v)) < 1e-3  # where the velocity hardly changes within the delay
    assert smooth.sum() > 100
    late = (x - found.rows[:, 4])[smooth]
    np.testing.assert_allclose(late, v[smooth] * 2 / (2 * np.pi * f), atol=2e-5)


def test_equal_seeds_give_equal_records_and_others_do_not(axis):
    def x(seed: int) -> np.ndarray:
        return record(axis, Experiment.of("squares"), duration=1.0, seed=seed)["x"]

    np.testing.assert_array_equal(x(1), x(1))
    assert (x(1) != x(2)).any()


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS))
def test_every_experiment_moves_the_axis_within_its_stroke(axis, kind):
    made = record(axis, Experiment.of(kind), duration=4.0, seed=4)
    assert np.ptp(made["x"]) > 2e-3
    assert np.abs(made["x"]).max() < axis.stroke / 2


def test_common_mode_steps_move_the_mean_pressure_more_than_a_sweep_does(axis):
    def swing(kind: str) -> float:
        made = record(axis, Experiment.of(kind), duration=4.0, seed=4)
        return float(np.ptp(made["p_P"] + made["p_N"]) / 2)

    assert swing("common_mode_steps") > 1.5 * swing("squares")


def test_parts_of_an_experiment_follow_each_other_by_their_shares(axis):
    mixed = Experiment((("holds", 1.0), ("common_mode_steps", 3.0)))
    drive = mixed.excitation(axis, 100.0, 8.0, seed=1)
    assert not drive.common[:200].any()
    assert drive.common[200:].any()
    with pytest.raises(ModelError, match="there are chirp"):
        Experiment.of("dance")


@pytest.mark.slow
def test_a_case_folder_loads_without_notes_and_holds_no_label(tmp_path):
    made = make_case(tmp_path / "a", 11, {"backlash": "large", "cogging": "small"}, duration=4.0)
    case = read_case(tmp_path / "a")
    assert case.findings == ()
    assert case.validate[0].N == case.identify[0].N == 4000
    assert {p.name for p in (tmp_path / "a").iterdir()} == {
        "bench.json",
        "flow_map.csv",
        "identify.csv.gz",
        "validate.csv.gz",
    }
    bench = (tmp_path / "a" / "bench.json").read_text()
    assert not any(word in bench for word in ("backlash", "cogging", "F_c", "seed"))
    assert [effect["name"] for effect in made.labels["effects"]] == ["backlash", "cogging"]
    assert json.loads(json.dumps(made.labels)) == made.labels


@pytest.mark.slow
def test_equal_seeds_give_equal_folders(tmp_path):
    for name in ("a", "b"):
        make_case(tmp_path / name, 5, {"hose": "medium"}, **SHORT)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


@pytest.mark.parametrize("seed", [-1, 1.5, "1"])
def test_a_seed_that_is_no_natural_number_is_refused(tmp_path, seed):
    with pytest.raises(CaseError, match=f"seed {seed}; give a whole number from 0 on"):
        make_case(tmp_path / "case", seed)
    assert not (tmp_path / "case").exists()


def test_a_case_needs_a_record(tmp_path):
    with pytest.raises(CaseError, match="no record"):
        make_case(tmp_path / "a", 5, duration=0.0)
    assert not (tmp_path / "a").exists()


def test_random_axes_are_plausible_and_differ():
    axes = [random_axis(seed) for seed in range(20)]
    assert len({axis.M for axis in axes}) == 20
    for axis in axes:
        assert axis.bench_description(1000.0, axis.M).stroke > 0.3
        assert 1.0 < axis.truth["X_s3"] / axis.truth["X_s2"] < 1.4


def test_without_numba_one_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    fresh = importlib.util.spec_from_file_location("fresh_jit", jit.__file__)
    with pytest.raises(MissingExtraError, match=r"pip install 'pneumo-casadi\[bench\]'"):
        fresh.loader.exec_module(importlib.util.module_from_spec(fresh))


def test_kernels_are_not_cached_where_others_may_write(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("PNEUMO_CASADI_CACHE", str(tmp_path))
    folder = jit.kernel_cache()
    assert folder is not None
    assert folder.parent == tmp_path
    folder.chmod(0o777)
    assert jit.kernel_cache() is None
    assert "others may write" in caplog.text
    monkeypatch.setenv("PNEUMO_CASADI_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").write_text("")
    assert jit.kernel_cache() is None


@pytest.mark.slow
def test_the_bench_runs_without_casadi_ever_being_loaded():
    code = "import sys, pneumo_casadi.virtual_bench; sys.exit('casadi' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
