"""Records made with an effect at its starting values, and the fit that must find it again."""

from dataclasses import dataclass

import numpy as np
import pytest

from pneumo_casadi.compilation import compiled
from pneumo_casadi.integration import Stepping, step_function
from pneumo_casadi.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.recording import InputHold

#: Steps per sample with which records are integrated, four times what a fit takes or more.
FINE = 8


@dataclass(frozen=True)
class Recovered:
    """Truth and fit of an effect's parameters, in the effect's order."""

    names: tuple[str, ...]
    truth: np.ndarray
    null: np.ndarray
    found: np.ndarray
    std: np.ndarray
    result: object

    @property
    def deviations(self):
        """Errors in standard deviations."""
        return (self.found - self.truth) / self.std


def _closed_loop(axis, x_ref, period):
    """Run an axis under its controller, which reads the sensor; returns u (N, nu), x (nx, N)."""
    step, show = compiled(
        [step_function(axis, Stepping(period, InputHold.ZERO, FINE)), axis.output]
    )
    theta, law = axis.parameters.values, axis.bench.controller
    still = [3.5e5, 4.7e5, 0.0, 0.0] if axis.flow is not None else [0.0, 0.0]
    x = axis.rest(still, np.zeros(len(axis.inputs)), theta).full().ravel()
    all_u, all_x = [], []
    for wanted in x_ref:
        shown = show(x, np.zeros(len(axis.inputs)), theta).full().ravel()[-1]
        u = law.command(wanted, shown, x[axis.states.index("v")])
        all_x.append(x)
        all_u.append(u)
        x = step(x, u, theta).full().ravel()
    return np.array(all_u), np.array(all_x).T


@pytest.fixture(scope="session")
def recover(made):
    """Make a record with effects at their starting values and fit it from somewhere else.

    Free are the parameters of the effects and all nominal ones but those named in `hold`; the
    flow map is known.
    """

    def run(*effects, force_driven=False, hold=(), N=1000, seed=0, values=None, begin=None):
        make = made.true_force_axis if force_driven else made.true_axis
        axis = make(*effects).at_starting_values().with_parameters(values or {})
        u, x = _closed_loop(axis, made.reference(np.arange(N) / made.FS), 1 / made.FS)
        record = made.recorded(axis, u, x, seed)
        known = {"v_s", *hold, *(() if force_driven else axis.flow.parameters.names)}
        start = _elsewhere(axis, known, begin or {})
        start = start.with_parameters(start.parameters.fix(*known))
        options = OutputErrorOptions(widths=(axis.parameters["v_s"].value,))
        result = fit_output_error(start, [record], options=options)
        names = tuple(n for n in axis.parameters.names if "." in n and n not in hold)
        truth = axis.parameters.select(names)
        return Recovered(
            names,
            truth.values,
            np.array([item.null for item in truth]),
            result.parameters.select(names).values,
            np.array([result.std(name) for name in names]),
            result,
        )

    return run


def _elsewhere(axis, held, begin):
    """The axis with nominal parameters 3 % off, amplitudes at 60 %, shapes at 115 %."""
    moved = {}
    for item in axis.parameters:
        if "." not in item.name:
            if item.free and item.name not in held:
                moved[item.name] = 1.03 * item.value
        elif item.value != item.null:
            moved[item.name] = item.null + 0.6 * (item.value - item.null)
        else:
            moved[item.name] = 1.15 * item.value
    return axis.with_parameters(moved | begin)
