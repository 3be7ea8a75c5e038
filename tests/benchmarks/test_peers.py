"""The comparison with other tools: rivals solve the problem that ours does; tables say all."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.stepping import Stepping

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
#: Samples of the short record.
N = 12
TIMES = ("cold", "warm", "restart")


@pytest.fixture
def benchmarks(monkeypatch):
    """Make the benchmarks' modules importable."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))


@pytest.fixture(params=["common", "long"])
def short(request, benchmarks):
    """Return a problem cut to a few samples, and our own states at them, (N + 1, 4)."""
    from dataclasses import replace

    from peer_tools.problems import KINDS

    problem = KINDS[request.param].make(quick=True)
    axis, *_ = pickle.loads(problem.own)
    parts = {name: getattr(problem, name)[:N] for name in ("u", "y", "states")}
    step = step_function(axis, Stepping(problem.dt, InputHold.ZERO, problem.steps))
    states = [problem.states[0]]
    for u in parts["u"]:
        states.append(step(states[-1], u, axis.parameters.values).full().ravel())
    return replace(problem, **parts), np.array(states)


def check(problem, states, ends, J, outputs):
    """Compare one interval of all samples with ours: its end, outputs and slopes to x_0."""
    from peer_tools.estimation import STATE_SCALES

    assert ends * STATE_SCALES == pytest.approx(states[-1], rel=1e-10)
    measured = problem.scaled_y + outputs / problem.weights
    assert measured * STATE_SCALES[:3] == pytest.approx(states[:-1, :3], rel=1e-10, abs=1e-14)
    assert np.abs(J).max(axis=(0, 1)).min() > 0  # everything free is seen


def test_the_model_in_numba_is_ours(short, monkeypatch):
    pytest.importorskip("numba")
    from peer_tools import numba_kernel
    from peer_tools.estimation import STATE_SCALES

    # Uncompiled: the same code, without seconds of compiling.
    monkeypatch.setattr(numba_kernel, "simulate", numba_kernel.simulate.py_func)
    monkeypatch.setattr(numba_kernel, "_rates", numba_kernel._rates.py_func)
    problem, states = short
    intervals = numba_kernel.Intervals(problem, N)
    x, eta = states[0] / STATE_SCALES, problem.start / problem.scales
    e, J, end, _ = intervals.residuals(0, x, eta, True)
    check(problem, states, end, J[1:], e)
    for column, size in ((0, 1e-6), (6, 1e-6), (eta.size - 1, 1e-4), (eta.size, 1e-6)):
        z = np.concatenate([eta, x])
        z[column] += size
        ahead = intervals.residuals(0, z[eta.size :], z[: eta.size], False)[0]
        slope = (ahead - e) / size
        assert J[..., column] == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max())


def test_the_model_in_jax_is_ours(short):
    pytest.importorskip("jax")
    from peer_tools import jax_kernel
    from peer_tools.estimation import STATE_SCALES

    problem, states = short
    intervals = jax_kernel.Intervals(problem, N)
    eta = problem.start / problem.scales
    at = intervals.linearise((states[0] / STATE_SCALES)[None], eta)
    e = (states[:-1, :3] - problem.y) / problem.sigma
    assert at.ends[0] * STATE_SCALES == pytest.approx(states[-1], rel=1e-10)
    assert at.cost == pytest.approx(0.5 * np.sum(e**2), rel=1e-8)
    assert np.diag(at.H[0]).min() > 0


def test_gauss_newton_by_hand_solves_a_linear_problem_with_windows_in_one_step(benchmarks):
    from types import SimpleNamespace

    from peer_tools.gauss_newton import Linearised, condensed_step

    rng = np.random.default_rng(1)
    W, K, n, rows = 2, 3, 2, 40
    A = 0.3 * rng.normal(size=(W * K, 4, 4 + n))
    C, y = rng.normal(size=(W * K, rows, 4 + n)), rng.normal(size=(W * K, rows))

    def at(x, eta):
        z = np.concatenate([x, np.tile(eta, (W * K, 1))], axis=1)
        e = np.einsum("irm,im->ir", C, z) - y
        H, g = C.swapaxes(1, 2) @ C, np.einsum("irm,ir->im", C, e)
        return Linearised(np.einsum("ism,im->is", A, z), A, H, g, 0.5 * np.sum(e**2))

    problem, own = SimpleNamespace(windows=W), (np.zeros((n, n)), np.zeros(n), 0.0)
    x, eta = rng.normal(size=(W * K, 4)), np.zeros(n)
    step = condensed_step(problem, at(x, eta), own, x, 0.0)
    x, eta = x + step.x, eta + step.eta
    ends = at(x, eta).ends.reshape(W, K, 4)
    assert ends[:, :-1] == pytest.approx(x.reshape(W, K, 4)[:, 1:])
    again = condensed_step(problem, at(x, eta), own, x, 0.0)
    assert again.size < 1e-9 and np.abs(again.x).max() < 1e-9


def row(seconds, reached=True):
    numbers = {"version": "1", "peak_GB": 0.1, "cost": 10.0, "parameter_error_percent": 0.1}
    return {**{f"{t}_s": seconds for t in TIMES}, **numbers, "reached": reached}


def test_the_fastest_rival_is_one_that_reached_the_optimum(script):
    peers = script(BENCHMARKS / "peers.py")
    tools = {"pneumo_casadi": row(1.0), "a": row(5.0), "b": row(3.0), "c": row(2.0, False)}
    tools["b"]["warm_s"] = None
    told = peers.speed_ups(tools)
    assert told["speed_up_cold"] == 3.0 and told["fastest_cold"] == "b"
    assert told["speed_up_warm"] == 5.0 and told["fastest_warm"] == "a"
    tools["pneumo_casadi"]["reached"] = False
    assert peers.speed_ups(tools)["speed_up_cold"] is None


def test_tools_that_failed_stay_in_the_table_with_the_reason(script):
    speed = script(BENCHMARKS / "result_pages.py").TABLES["peers_long"][0]
    tools = {"pneumo_casadi": row(1.0), "a": row(5.0), "b": {"failure": "no answer within 60 s"}}
    ratios = {f"speed_up_{t}": 5.0 for t in TIMES} | {f"fastest_{t}": "a" for t in TIMES}
    text = speed({"problems": {"long": {"title": "long", "tools": tools, **ratios}}})
    assert "no answer within 60 s" in text and text.count("\n| ") == 5
    assert text.startswith(
        "Fastest other tool that reaches the optimum, in times of ours: cold 5.0"
    )
