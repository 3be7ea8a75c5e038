"""The contract of every effect in the catalogue: a new one is tested without writing a test."""

import pickle

import numpy as np
import pytest

from pneumo_casadi.data import InputHold
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.absorption import Absorption
from pneumo_casadi.model.axis import V_S_SHARP
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.stepping import Stepping, substeps_for

#: Most Runge-Kutta steps per millisecond that an effect may ask for where a fit starts.
MOST_SUBSTEPS = 8
#: Most corners of the bounds that are visited one by one.
MOST_CORNERS = 64


@pytest.fixture(scope="module")
def started(pair):
    """The axis with its effect where a fit starts."""
    return pair[0].at_starting_values()


@pytest.fixture(scope="module")
def derivatives(pair):
    """Right-hand side and outputs, each with its derivatives, which are written once."""
    return [(f, f.jacobian()) for f in (pair[0].rhs, pair[0].output)]


def at_rest(axis, x, u, theta=None):
    return axis.rest(x, u, axis.parameters.values if theta is None else theta).full().ravel()


def drawn(axis, nominal, made, rng, slow=1.0, theta=None):
    """A random state with the effect's own states somewhat off their rest, and inputs."""
    x, u = made.states(nominal, rng)
    x[-1] *= slow
    full = at_rest(axis, x, u, theta)
    full[len(x) :] += 0.1 * axis.state_scales[len(x) :] * rng.standard_normal(full.size - len(x))
    return full, u


@pytest.mark.slow
def test_at_null_values_the_axis_is_the_nominal_one(pair, made):
    axis, nominal = pair
    theta, plain = axis.parameters.values, nominal.parameters.values
    n, rng = len(nominal.states), np.random.default_rng(0)
    for _ in range(4):
        x, u = made.states(nominal, rng)
        full = at_rest(axis, x, u)
        np.testing.assert_array_equal(full[:n], x)
        np.testing.assert_allclose(
            axis.rhs(full, u, theta).full()[:n], nominal.rhs(x, u, plain).full(), rtol=1e-10
        )
        np.testing.assert_allclose(
            axis.output(full, u, theta).full(), nominal.output(x, u, plain).full(), rtol=1e-12
        )


@pytest.mark.slow
def test_at_null_values_trajectories_are_the_nominal_ones_from_rest_on(pair, made):
    axis, nominal = pair
    rng = np.random.default_rng(1)
    n = len(nominal.states)
    x, u = made.states(nominal, rng)
    full = at_rest(axis, x, u)
    step, other = (step_function(a, Stepping(1e-3, InputHold.ZERO, 4)) for a in (axis, nominal))
    for _ in range(10):
        u = u + 0.05 * rng.standard_normal(u.size)
        full = step(full, u, axis.parameters.values).full().ravel()
        x = other(x, u, nominal.parameters.values).full().ravel()
        y, plain = (
            a.output(z, u, a.parameters.values).full() for a, z in ((axis, full), (nominal, x))
        )
        np.testing.assert_allclose(y, plain, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(full[:n], x, rtol=1e-9, atol=1e-12)


def test_values_and_derivatives_are_finite_at_standstill_and_in_motion(
    pair, started, derivatives, made
):
    axis, nominal = pair
    rng = np.random.default_rng(5)
    u = np.zeros(len(axis.inputs))
    still = [np.array([*p, 0.0, 0.0])[-len(nominal.states) :] for p in ((4e5, 5e5), (1e5, 7e5))]
    for item in (axis, started):
        theta = item.parameters.values
        points = [(at_rest(item, x, u), u) for x in still]
        points += [drawn(item, nominal, made, rng) for _ in range(3)]
        for full, inputs in points:
            for f, derivative in derivatives:
                assert np.isfinite(f(full, inputs, theta).full()).all()
                for block in derivative(full, inputs, theta, 0):
                    assert np.isfinite(block.full()).all()


@pytest.mark.slow
def test_equations_stay_finite_at_every_corner_of_the_bounds(pair, made):
    axis, nominal = pair
    added = axis.parameters.names[len(nominal.parameters) :]
    rng = np.random.default_rng(6)
    corners = range(2 ** len(added))
    if len(corners) > MOST_CORNERS:  # a curve has many parameters, which act alike
        corners = [0, len(corners) - 1, *rng.integers(len(corners), size=MOST_CORNERS).tolist()]
    for corner in corners:
        ends = {
            name: getattr(axis.parameters[name], ("lower", "upper")[corner >> i & 1])
            for i, name in enumerate(added)
        }
        theta = axis.parameters.with_values(ends).values
        full, u = drawn(axis, nominal, made, rng, theta=theta)  # equations are written once
        for f in (axis.rhs, axis.output):
            assert np.isfinite(f(full, u, theta).full()).all(), ends


@pytest.mark.slow
def test_the_derivative_at_the_null_is_the_slope_on_its_way_in_and_not_all_zero(
    pair, derivatives, made
):
    """A screen of effects at the nominal fit stands on these derivatives."""
    axis, nominal = pair
    if all(effect.staircase for effect in axis.effects):
        pytest.skip("scans find its parameters, which have no derivatives")
    theta, rng = axis.parameters.values, np.random.default_rng(11)
    largest = 0.0
    for i in range(6):
        full, u = drawn(axis, nominal, made, rng, slow=0.05 if i % 2 else 1.0)
        for f, derivative in derivatives:
            J = derivative(full, u, theta, 0)[2].full() * axis.parameters.scales
            value = f(full, u, theta).full().ravel()
            size = np.abs(value) + axis.state_scales[: f.size1_out(0)]
            for k in range(len(nominal.parameters), len(axis.parameters)):
                item = axis.parameters.items[k]
                if not item.free:
                    continue
                h = 1e-5 if item.null < item.upper else -1e-5
                moved = theta.copy()
                moved[k] += h * item.scale
                slope = (f(full, u, moved).full().ravel() - value) / h
                error = np.abs(slope - J[:, k]) / size
                assert error.max() < 0.02 * np.abs(J[:, k] / size).max() + 1e-6, item.name
                largest = max(largest, np.abs(J[:, k] / size).max())
    assert largest > 1e-6


@pytest.mark.slow
def test_every_free_parameter_changes_the_axis_where_a_fit_starts(pair, started, derivatives, made):
    axis, nominal = pair
    rng = np.random.default_rng(2)
    theta = started.parameters.values
    seen = np.zeros(len(axis.parameters))
    for i in range(20):
        full, u = drawn(started, nominal, made, rng, slow=0.05 if i % 2 else 1.0)
        # What acts near the ends of the stroke too.
        full[axis.states.index("x")] = rng.uniform(-0.45, 0.45) * axis.bench.stroke
        for f, derivative in derivatives:
            value = np.abs(f(full, u, theta).full()).ravel() + axis.state_scales[: f.size1_out(0)]
            slope = np.abs(derivative(full, u, theta, 0)[2].full()) / value[:, None]
            seen = np.maximum(seen, slope.max(axis=0) * axis.parameters.scales)
    for item in axis.parameters.items[len(nominal.parameters) :]:
        if item.free:
            assert seen[axis.parameters.index(item.name)] > 1e-6, f"{item.name} changes nothing"


def test_only_declared_states_and_parameters_are_added(pair):
    axis, nominal = pair
    effect = axis.effects[0]
    states = tuple(f"{effect.name}.{state.name}" for state in effect.states)
    names = tuple(f"{effect.name}.{item.name}" for item in effect.parameters)
    assert axis.states == (*nominal.states, *states)
    assert axis.parameters.names == (*nominal.parameters.names, *names)
    assert axis.rhs.size1_out(0) == len(axis.states)


def test_an_effect_names_the_sensors_that_it_changes(pair, started, made):
    axis, nominal = pair
    rng, changed = np.random.default_rng(11), set()
    for _ in range(10):
        full, u = drawn(started, nominal, made, rng)
        shown = started.output(full, u, started.parameters.values).full().ravel()
        plain = nominal.output(full[: len(nominal.states)], u, nominal.parameters.values).full()
        off = np.abs(shown - plain.ravel()) > 1e-9 * np.abs(plain.ravel())
        changed |= {name for name, differs in zip(axis.outputs, off, strict=True) if differs}
    (effect,) = axis.effects
    assert changed == set(effect.sensors) & set(axis.outputs)
    assert bool(effect.sensors) == ("output" in effect.junctions)


def test_an_effect_that_names_no_check_of_parameters_is_refused():
    with pytest.raises(ModelError, match="absorbed_by names no check: mass; there are S_N/S_P"):
        type("Heavy", (Effect,), {"name": "heavy", "absorbed_by": Absorption(("mass",))})


def test_an_axis_with_effects_survives_pickling(pair, made):
    axis, nominal = pair
    again = pickle.loads(pickle.dumps(axis))
    assert again.states == axis.states and again.parameters == axis.parameters
    full, u = drawn(axis, nominal, made, np.random.default_rng(4))
    first, second = (a.rhs(full, u, a.parameters.values).full() for a in (axis, again))
    np.testing.assert_array_equal(first, second)


@pytest.mark.slow
def test_the_steps_that_standstill_asks_for_are_fine_enough_in_motion(pair, started, made):
    """No rate may grow with the speed beyond what `substeps_for` sees at standstill."""
    axis, nominal = pair
    few = substeps_for(started, 1e-3)
    assert few <= MOST_SUBSTEPS
    theta, rng = started.parameters.values, np.random.default_rng(7)
    coarse, fine = (step_function(axis, Stepping(1e-3, InputHold.ZERO, n)) for n in (few, 8 * few))
    x, u = made.states(nominal, rng)
    x[-1] = 1.0
    full = at_rest(started, x, u)
    # Off its rest: an instability needs something to grow from.
    full[len(x) :] += 0.1 * axis.state_scales[len(x) :] * rng.standard_normal(full.size - len(x))
    few = many = full
    for _ in range(30):
        few = coarse(few, u, theta).full().ravel()
        many = fine(many, u, theta).full().ravel()
    # Within a step a contact opens or closes, which half a per cent of a large force may cost.
    near = {"rtol": 5e-3 if started.effects[0].cause == "backlash" else 1e-7, "atol": 2e-3}
    np.testing.assert_allclose(few / axis.state_scales, many / axis.state_scales, **near)


@pytest.mark.slow
def test_the_regressor_of_an_effect_reproduces_its_equations_where_its_states_rest(
    pair, started, made
):
    """What is linear in the balances is a column; sensors and effects with states give none."""
    axis, nominal = pair
    names = axis.regressor_names
    own = set(names) - set(nominal.regressor_names)
    effect = axis.effects[0]
    assert not own or not (effect.states or effect.junctions == ("output",))
    sharp = started.with_parameters({"v_s": V_S_SHARP})
    theta = sharp.parameters
    regressor, rng = axis.regressor(names, theta), np.random.default_rng(10)
    if effect.through_states:  # it is left out, and the regressor is the nominal one
        plain = nominal.regressor(names, nominal.with_parameters({"v_s": V_S_SHARP}).parameters)
        x, u = made.states(nominal, rng)
        for own_part, part in zip(regressor(x, x, u), plain(x, x, u), strict=True):
            np.testing.assert_array_equal(own_part.full(), part.full())
        return
    for _ in range(4):
        x, u = made.states(nominal, rng)
        dx = axis.rhs(at_rest(sharp, x, u), u, theta.values).full().ravel()[: len(x)]
        Y, W = (part.full() for part in regressor(x, dx, u))
        balances = Y.ravel() - W @ theta.select(names).values
        # Rest values that hang on themselves (pressure behind a hose) are settled in passes.
        near = 0.03 if effect.states else 1e-9
        np.testing.assert_allclose(balances / (np.abs(Y.ravel()) + 1e-6), 0.0, atol=near)


@pytest.fixture(scope="module")
def commanded(made, nominals):
    """Commands and first states of each nominal axis under control for 0.8 s.

    A servo axis begins a second time with its pressures exchanged: so either one is higher.
    """
    runs = {kind: made.controlled(axis, 800, substeps=4) for kind, axis in nominals.items()}
    firsts = {kind: [x[:, 0]] for kind, (_, x) in runs.items()}
    firsts["servo"].append(firsts["servo"][0][[1, 0, 2, 3]])
    return {kind: (u, firsts[kind]) for kind, (u, _) in runs.items()}


def shown(axis, u, firsts):
    """A function of parameters: outputs over sensor noise along free runs, one column."""
    step = step_function(axis, Stepping(1e-3, InputHold.ZERO, substeps_for(axis, 1e-3)))
    N = len(u)
    run, show = step.mapaccum(N), axis.output.map(N)
    sigma = np.array([getattr(axis.bench.noise, name[0]) for name in axis.outputs])

    def at(values):
        theta = axis.parameters.with_values(values).values
        held = np.tile(theta[:, None], (1, N))
        runs = (run(axis.rest(x_0, u[0], theta), u.T, held) for x_0 in firsts)
        return np.hstack([show(x, u.T, held).full() / sigma[:, None] for x in runs]).ravel()

    return at


@pytest.mark.slow
def test_a_record_holds_information_on_each_free_parameter_beside_the_others(
    pair, started, commanded
):
    """Freed in an output-error fit at its start, an effect has a finite covariance."""
    axis, nominal = pair
    kind = "servo" if axis.kind.chambers else "force-driven"
    u, firsts = commanded[kind]
    added = [item for item in started.parameters.items[len(nominal.parameters) :] if item.free]
    if not added:
        pytest.skip("scans find its parameters, none is free")
    columns, at = [], shown(started, u, firsts)
    for item in added:
        h = 1e-3 * item.scale
        below = h if item.value - h >= item.lower else 0.0
        ends = (at({item.name: value}) for value in (item.value + h, item.value - below))
        columns.append(np.subtract(*ends) / (1e-3 * (1 + below / h)))
    known_before = [
        [row.get(item.name.partition(".")[2], 0.0) * item.scale for item in added]
        for row in started.effects[0].prior_rows()
    ]
    J = np.array([*np.array(columns).T, *known_before])
    assert np.isfinite(J).all() and np.linalg.matrix_rank(J) == len(added)
    std = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    # What is known before, of a curve its smoothness, stands in where the record does not reach.
    reached = np.linalg.norm(np.array(columns), axis=1) > (1.0 if known_before else 0.0)
    known = {n.name: s for n, s, at in zip(added, std, reached, strict=True) if at}
    assert max(known.values()) < 1, f"standard deviations in units of the scales: {known}"


PASSIVE = [name for name, effect in EFFECTS.items() if effect.passive]


@pytest.mark.parametrize("level", [0.0, 12.0], ids=["without friction", "with friction"])
@pytest.mark.parametrize("name", PASSIVE)
def test_passive_effects_give_back_no_more_energy_than_they_have_taken(name, level, made, drag):
    axis = made.true_axis(EFFECTS[name]()).at_starting_values()
    axis = axis.with_parameters({"f_v": 0.0, "F_c_plus": level, "F_c_minus": level})

    def wobble(t):
        return 0.06 * np.sin(7.0 * t) * np.sin(2.3 * t) + 0.002 * (1 - np.cos(90.0 * t))

    taken = drag(axis, wobble, 1.0).taken
    assert taken.min() >= -1e-5 * taken.max()
    assert taken.max() > 1e-3 or level == 0
