"""A small axis of its own making: eq. 1 integrated with a simple valve, sampled with noise."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.data import (
    Bench,
    InputHold,
    ProportionalController,
    Recording,
    SensorNoise,
)

STEP, SUBSTEPS = 1e-3, 5


def simulate(bench: Bench, seconds: float, seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    rows = round(seconds / STEP)
    t = STEP * np.arange(rows)
    x_ref = 0.08 * np.sin(2 * np.pi * (0.3 + 0.2 * t) * t) + 0.03 * np.sign(np.sin(1.7 * t))
    p_P, p_N, x, v = 4e5, 5.2e5, 0.0, 0.0
    dead = 0.25 * bench.stroke / 5
    out = np.empty((rows, 5))
    gas, span = bench.r * bench.T, bench.p_supply - bench.p_ext
    for k in range(rows):
        x_m = x + bench.noise.x * rng.standard_normal()
        u = max(-bench.controller.u_max, min(bench.controller.u_max, 2.4 * (x_ref[k] - x_m)))
        noise = bench.noise.p * rng.standard_normal(2)
        out[k] = u, -u, p_P + noise[0], p_N + noise[1], x_m
        for _ in range(SUBSTEPS):
            h = STEP / SUBSTEPS
            flows = []
            for command, p in ((u, p_P), (-u, p_N)):
                drop = bench.p_supply - p if command > 0 else p - bench.p_ext
                flows.append(8e-3 * command * drop / span + 2e-9 * (4.6e5 - p))
            V_P = bench.S_P * (bench.stroke / 2 + dead + x)
            V_N = bench.S_N * (bench.stroke / 2 + dead - x)
            effort = bench.S_P * p_P - bench.S_N * p_N - (bench.S_P - bench.S_N) * bench.p_ext
            v += h * (effort - 60 * v - 10 * np.tanh(v / 5e-3)) / 17.0
            p_P += h * 1.2 / V_P * (gas * flows[0] - bench.S_P * p_P * v)
            p_N += h * 1.2 / V_N * (gas * flows[1] + bench.S_N * p_N * v)
            x += h * v
    names = ("u_P", "u_N", "p_P", "p_N", "x")
    channels = dict(zip(names, out.T, strict=True)) | {"x_ref": x_ref}
    return Recording(t, channels, "identify", "simulated", InputHold.ZERO)


@pytest.fixture(scope="session")
def bench() -> Bench:
    return Bench(
        sampling_frequency=1 / STEP,
        S_P=8.75e-4,
        S_N=6.03e-4,
        stroke=0.5,
        p_ext=1e5,
        p_supply=7e5,
        T=293.15,
        r=287.0,
        controller=ProportionalController(gain=2.4, u_max=5.0),
        datasheet={"M_kg": 17.0},
        noise=SensorNoise(p=150.0, x=1.5e-5),
    )


@pytest.fixture(scope="session")
def recording(bench: Bench) -> Recording:
    return simulate(bench, 4.0, seed=1)


def csv_text(recording: Recording) -> str:
    units = {"u_P": "V", "u_N": "V", "p_P": "Pa", "p_N": "Pa", "x": "m", "x_ref": "m"}
    header = ",".join(["t_s", *(f"{name}_{unit}" for name, unit in units.items())])
    digits = {"V": ".4f", "Pa": ".0f", "m": ".6f"}
    lines = [header]
    for k in range(recording.N):
        cells = (f"{recording[name][k]:{digits[unit]}}" for name, unit in units.items())
        lines.append(",".join([f"{recording.t[k]:.4f}", *cells]))
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="session")
def good_text(recording: Recording) -> str:
    return csv_text(recording)


BENCH_JSON = """{
 "sampling_frequency_Hz": 1000.0,
 "S_P_m2": 8.75e-4,
 "S_N_m2": 6.03e-4,
 "stroke_m": 0.5,
 "p_ext_Pa": 100000.0,
 "p_supply_Pa": 700000.0,
 "T_K": 293.15,
 "r_J_per_kg_K": 287.0,
 "controller": {"type": "proportional", "gain_V_per_m": 2.4, "u_max_V": 5.0},
 "datasheet": {"M_kg": 17.0},
 "sensor_noise": {"p_Pa": 150.0, "x_m": 1.5e-05}
}
"""


@pytest.fixture
def bench_json(tmp_path: Path) -> Callable[[str, str], Path]:
    """Writes bench.json with one piece of its text replaced."""

    def write(old: str = "", new: str = "") -> Path:
        assert old in BENCH_JSON
        path = tmp_path / "bench.json"
        path.write_text(BENCH_JSON.replace(old, new) if old else BENCH_JSON)
        return path

    return write


@pytest.fixture
def case_folder(
    tmp_path: Path, good_text: str, bench_json: Callable[[str, str], Path]
) -> Callable[[Callable[[list[str]], list[str]]], Path]:
    """Writes a case folder whose record has its lines (header first) changed by a function."""

    def write(change: Callable[[list[str]], list[str]] = lambda lines: lines) -> Path:
        bench_json()
        lines = change(good_text.splitlines())
        (tmp_path / "identify.csv").write_text("\n".join(lines) + "\n")
        return tmp_path

    return write
