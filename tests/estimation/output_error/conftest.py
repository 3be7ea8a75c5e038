"""Records of axes of known truth, made once for all tests here."""

import pytest

from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error


@pytest.fixture(scope="session")
def servo(made):
    """A servo axis of known truth under control for 1.2 s: axis, commands, states."""
    axis = made.true_axis()
    return axis, *made.controlled(axis, 1200)


@pytest.fixture(scope="session")
def force(made):
    """A force-driven axis of known truth under control for 1.2 s."""
    axis = made.true_force_axis()
    return axis, *made.controlled(axis, 1200)


@pytest.fixture(scope="session")
def start(made):
    """Factory of a measured map and the axis that starts from its fit."""

    def make(seed=0, **values):
        table = made.measured_map(seed)
        flow = made.fit_polynomials(table, (3, 3, 3))
        axis = made.Servosystem(made.BENCH, flow).with_parameters(made.TRUE | values)
        return table, axis

    return make


@pytest.fixture(scope="session")
def fit(made, servo, start):
    """Fit of all parameters to a record of the servo axis with seeded noise."""
    axis, u, x = servo

    def run(seed=0, record=None, **options):
        table, begin = start(seed)
        given = {"widths": (made.TRUE["v_s"],)} | options
        record = record or made.recorded(axis, u, x, seed)
        return fit_output_error(begin, [record], table, OutputErrorOptions(**given))

    return run


@pytest.fixture(scope="session")
def fitted(fit):
    return fit()
