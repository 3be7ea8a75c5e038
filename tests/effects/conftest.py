"""Axes with each effect of the catalogue; an axis moved by hand; records and the fit of them."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.data import FORCE_DRIVEN, PNEUMATIC, InputHold
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.stepping import Stepping, substeps_for

#: Records are integrated with so many times the steps that a fit takes.
FINER = 2


KINDS = {"servo": "true_axis", "force-driven": "true_force_axis"}
JUNCTIONS_OF = {"servo": PNEUMATIC.junctions, "force-driven": FORCE_DRIVEN.junctions}


def fits(effect, kind):
    """Whether an effect belongs on an axis of a kind."""
    there = set(effect().junctions) <= JUNCTIONS_OF[kind]
    return there and (kind == "servo" or not effect.needs_chambers)


CASES = [(name, kind) for name, effect in EFFECTS.items() for kind in KINDS if fits(effect, kind)]


@pytest.fixture(scope="session")
def nominals(made):
    return {kind: getattr(made, make)() for kind, make in KINDS.items()}


@pytest.fixture(scope="session")
def members():
    """Effects of the catalogue by the kind of axis on which they belong."""
    return {kind: [EFFECTS[name] for name, on in CASES if on == kind] for kind in KINDS}


@pytest.fixture(scope="module", params=CASES, ids=" on ".join)
def pair(request, nominals):
    """The axis with one effect at its null values, and the nominal axis."""
    name, kind = request.param
    return nominals[kind].with_effects(EFFECTS[name]()), nominals[kind]


@dataclass(frozen=True)
class Dragged:
    """An axis moved by hand: what it shows and how it resists, at N instants."""

    t: np.ndarray
    x: np.ndarray
    v: np.ndarray
    y: np.ndarray  # what the sensors show, (ny, N)
    F: np.ndarray  # resistance against the motion, inertia excepted, (N,)

    @property
    def taken(self):
        """Energy taken from the hand so far, (N - 1,)."""
        power = self.F * self.v
        return np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(self.t))


@pytest.fixture(scope="session")
def drag():
    """Move an axis along x(t), at constant pressures, its effects starting at rest."""

    def run(axis, motion, seconds, h=1e-4, p=(4e5, 5e5)):
        t = np.arange(0.0, seconds, h / 2)
        x = motion(t)
        v = np.gradient(x, t, edge_order=2)
        n, theta, u = len(axis.motion_states), axis.parameters.values, np.zeros(len(axis.inputs))
        p = np.array(p)[: n - 2]
        z, at = ca.SX.sym("z", len(axis.states) - n), ca.SX.sym("at", 2)
        full = ca.vertcat(p, at, z)
        dx, y = axis.rhs(full, u, theta), axis.output(full, u, theta)
        f = ca.Function("f", [z, at], [dx[n:]])
        now, half, then = (ca.SX.sym(name, 2) for name in ("now", "half", "then"))
        k1 = f(z, now)
        k2 = f(z + h / 2 * k1, half)
        k3 = f(z + h / 2 * k2, half)
        after = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(z + h * k3, then))
        step = ca.Function("step", [z, now, half, then], [after])
        path = np.stack([x, v])[:, : 2 * ((t.size - 1) // 2) + 1]
        begin, middle, end = path[:, :-2:2], path[:, 1:-1:2], path[:, 2::2]
        start = axis.rest([*p, *path[:, 0]], u, theta).full()[n:]
        states = start
        if n < len(axis.states):
            states = np.hstack(
                [start, step.mapaccum(begin.shape[1])(start, begin, middle, end).full()]
            )
        show = ca.Function("show", [z, at], [y, dx[n - 1]]).map(states.shape[1])
        shown, a = (part.full() for part in show(states, path[:, ::2]))
        effort = 0.0
        if p.size:
            S_P, S_N, p_ext = (axis.constants[name] for name in ("S_P", "S_N", "p_ext"))
            effort = S_P * p[0] - S_N * p[1] - (S_P - S_N) * p_ext
        F = effort - axis.parameters["M"].value * a[0]
        return Dragged(t[: path.shape[1]][::2], *path[:, ::2], shown, F)

    return run


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
    # A thousand samples are run sooner than the functions would be compiled.
    substeps = FINER * substeps_for(axis, period)
    step, show = step_function(axis, Stepping(period, InputHold.ZERO, substeps)), axis.output
    theta, law = axis.parameters.values, axis.bench.controller
    still = [3.5e5, 4.7e5, 0.0, 0.0] if axis.kind.chambers else [0.0, 0.0]
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
    flow map is known. What an effect holds stays held.
    """

    def run(*effects, force_driven=False, hold=(), N=1000, seed=0, values=None, begin=None):
        make = made.true_force_axis if force_driven else made.true_axis
        axis = make(*effects).at_starting_values().with_parameters(values or {})
        u, x = _closed_loop(axis, made.reference(np.arange(N) / made.FS), 1 / made.FS)
        record = made.recorded(axis, u, x, seed)
        known = {"v_s", *hold, *(() if force_driven else axis.flow.parameters.names)}
        start = _run_in_worker(axis, known, begin or {})
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


def _run_in_worker(axis, held, begin):
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
