"""Small fits of known truth, each with its data: short records, coarse blocks."""

import numpy as np
import pytest

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.uncertainty import Optimum


@pytest.fixture(scope="session")
def optimum(made):
    """Factory: fit an axis to records and keep both together."""

    def make(axis, records, flow_map=None, **options):
        given = {"widths": (made.TRUE["v_s"],), "block": 5e-3} | options
        chosen = OutputErrorOptions(**given)
        result = fit_output_error(axis, records, flow_map, chosen)
        return Optimum(result, records, flow_map, chosen)

    return make


@pytest.fixture(scope="session")
def motion(made):
    """A force-driven axis of known truth under control for a second: axis, forces, states."""
    axis = made.true_force_axis()
    return axis, *made.controlled(axis, 1000)


@pytest.fixture(scope="session")
def forward(made):
    """A record in which the axis never moves backward."""
    axis = made.true_force_axis()
    u = 60.0 + 30.0 * np.sin(25.0 * np.arange(500) / made.FS)[:, None]
    x = made.steps(axis, u, [-0.2, 0.3])
    assert x[1].min() > 0.15
    return made.recorded(axis, u, x, 1, name="forward")


@pytest.fixture(scope="session")
def white(made, motion, optimum):
    axis, u, x = motion
    return optimum(axis, [made.recorded(axis, u, x, 0)])


@pytest.fixture(scope="session")
def slow():
    """Factory: a second of noise of 2 μm that lasts 15 samples."""
    fading = np.exp(-np.arange(60) / 15.0)

    def make(seed):
        e = np.random.default_rng(seed).standard_normal(1060)
        return 2e-6 * np.convolve(e, fading, "valid")[:1000] / np.sqrt(np.sum(fading**2))

    return make


@pytest.fixture(scope="session")
def slowly_disturbed(made, motion, optimum, slow):
    """Factory: the same axis fitted under such noise."""
    axis, u, x = motion
    t = np.arange(len(u)) / made.FS

    def make(seed):
        channels = {"x": x[0] + slow(seed), "F": u[:, 0]}
        return optimum(axis, [Recording(t, channels, "slow", "made", made.InputHold.ZERO)])

    return make


@pytest.fixture(scope="session")
def coloured(slowly_disturbed):
    return slowly_disturbed(0)


@pytest.fixture(scope="session")
def one_way(made, forward, optimum):
    return optimum(made.true_force_axis(), [forward])


@pytest.fixture(scope="session")
def servo(made, optimum):
    """Factory: all parameters of a servo axis fitted to 0.8 s beside a map of so much noise."""
    axis = made.true_axis()
    u, x = made.controlled(axis, 800)
    record = made.recorded(axis, u, x, 0)

    def make(map_noise=1.0):
        exact = made.true_flow()
        table = made.measured_map(0)
        q_m = exact(table.u, table.p)
        noisy = q_m + map_noise * (table.q_m - q_m)
        table = made.FlowMap(table.u, table.p, noisy, made.P_SUPPLY, made.P_EXT, source="made")
        flow = made.fit_polynomials(table, (3, 3, 3))
        begin = made.Servosystem(made.BENCH, flow).with_parameters(made.TRUE)
        return optimum(begin, [record], table)

    return make


@pytest.fixture(scope="session")
def anchored(servo):
    return servo()
