"""The catalogue: what effects declare, the index, the table, and how all of them compose."""

import ast
import inspect
import re
from collections import Counter, defaultdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import pneumo_casadi
from pneumo_casadi.effects import EFFECTS, catalogue_table
from pneumo_casadi.model.effect import NOMINAL, Effect
from pneumo_casadi.model.junctions import JUNCTIONS

PACKAGE = Path(pneumo_casadi.__file__).parent


#: What the name of a size says of the side that it belongs to.
SIDE = re.compile("_(P|N|plus|minus)(_(plus|minus))?$")
#: That of version 0.1.0; new forms stand behind those of their cause.
ORDER = (
    "asymmetric_viscous_friction",
    "backlash",
    "backlash_before_load",
    "constant_force",
    "drive_lag",
    "gain_error",
    "elastic_load",
    "elastic_load_progressive",
    "exhaust_restriction",
    "flow_map_shape",
    "flow_map_shape_fittings",
    "heat_transfer",
    "heat_transfer_forced",
    "hose",
    "hose_per_chamber",
    "hose_sensor_at_valve",
    "hose_travel_time",
    "hose_travel_time_per_chamber",
    "hose_volume",
    "hose_volume_per_chamber",
    "leakage_N",
    "leakage_P",
    "piston_seal_leakage",
    "piston_seal_leakage_per_direction",
    "piston_seal_leakage_scored",
    "position_delay",
    "position_friction",
    "position_friction_curve",
    "position_friction_step",
    "position_on_elastic_load",
    "position_on_guided_load",
    "position_on_load_with_play",
    "position_on_progressive_load",
    "presliding",
    "presliding_dahl",
    "presliding_maxwell",
    "pressure_friction",
    "pressure_friction_per_seal",
    "pressure_sensor_second_order",
    "pressure_sensor_bias",
    "pressure_sensor_lag",
    "pressure_sensor_lag_per_sensor",
    "quadratic_drag",
    "quadratic_drag_per_direction",
    "spring_load",
    "spring_load_progressive",
    "spring_load_two_sided",
    "stribeck",
    "stribeck_film",
    "stribeck_rational",
    "supply_droop",
    "supply_droop_proportional",
    "valve_dead_time",
    "valve_dead_zone",
    "valve_dead_zone_per_edge",
    "valve_dead_zone_edges",
    "valve_dynamics",
    "valve_dynamics_limited",
    "valve_dynamics_per_valve",
    "valve_hysteresis",
    "valve_hysteresis_per_valve",
    "valve_mismatch",
    "valve_mismatch_edges",
    "valve_null_shift",
    "valve_null_shift_warming",
    "valve_stiction",
)


def test_effects_keep_their_order():
    """Models list parameters in this order, and a diagnosis resolves ties by it."""
    assert tuple(EFFECTS) == ORDER


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_an_effect_declares_what_it_is(effect, members):
    instance = effect()
    assert isinstance(instance, Effect) and EFFECTS[instance.name] is effect
    assert instance.junctions and set(instance.junctions) <= set(JUNCTIONS)
    assert instance.parameters and instance.__doc__
    for text in (
        instance.equation,
        instance.source,
        instance.shows,
        instance.separated_by,
    ):
        assert text and text == text.strip()
    assert instance.confused_with and instance.name not in instance.confused_with
    assert EFFECTS[instance.cause].cause == instance.cause, "a cause is named after its first form"
    unknown = set(instance.confused_with) - {*EFFECTS, *NOMINAL}
    assert not unknown, f"{instance.name} is confused with what is not in the catalogue: {unknown}"
    assert any(effect in some for some in members.values()), f"{instance.name} fits no axis"
    assert all(state.unit and state.scale > 0 for state in instance.states)


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_parameters_are_documented_and_their_bounds_bracket_null_and_start(effect):
    for item in effect.parameters:
        assert item.unit and item.description and item.source, item.name
        assert item.value == item.null, f"{item.name} does not begin at its null value"
        assert item.lower < item.upper and item.lower <= item.null <= item.upper, item.name
        assert np.isfinite([item.lower, item.upper]).all(), f"{item.name} is not bounded"
        start = item.null if item.start is None else item.start
        assert item.lower <= start <= item.upper, item.name
        inside = item.lower < start < item.upper
        assert inside or not item.free, f"a fit of {item.name} starts at a bound"
        assert 0 < item.scale <= item.upper - item.lower, item.name
    moved = [item for item in effect.parameters if item.start not in (None, item.null)]
    assert moved, f"{effect.name} starts at its null values: no fit would find a shape"


@pytest.mark.slow
def test_the_index_names_an_effect_once_and_no_other_file_but_its_own_does():
    """So a new one is a new file and a line."""
    index = PACKAGE / "effects" / "__init__.py"
    any_effect = re.compile("|".join(effect.__name__ for effect in EFFECTS.values()))
    texts = {path: path.read_text("utf-8") for path in PACKAGE.rglob("*.py")}
    used = {path: names_in(text) for path, text in texts.items() if any_effect.search(text)}
    for effect in EFFECTS.values():
        own = Path(inspect.getfile(effect))
        naming = {path for path, names in used.items() if names[effect.__name__]}
        assert naming - {own} == {index}, effect.name
        assert used[index][effect.__name__] == 1


def names_in(text):
    """How often a module imports or uses each name."""
    nodes = ast.walk(ast.parse(text))
    kinds = {ast.Name: "id", ast.Attribute: "attr", ast.alias: "name"}
    return Counter(getattr(node, kinds[type(node)]) for node in nodes if type(node) in kinds)


def test_the_table_of_the_catalogue_holds_every_effect_as_it_declares_itself():
    rows = catalogue_table()
    assert [row.name for row in rows] == list(EFFECTS)
    for row in rows:
        effect = EFFECTS[row.name]
        assert row.junctions == effect().junctions and row.parameters == effect.parameters
        assert (row.equation, row.source) == (effect.equation, effect.source)
        assert (row.shows, row.confused_with) == (effect.shows, effect.confused_with)
        assert (row.separated_by, row.states) == (effect.separated_by, effect.states)


def numbers(axis, x, dx, u):
    """All that the balances say at a point, as numbers by name."""
    theta = axis.parameters.as_dict()
    written = axis.balances(
        [x[name] for name in axis.states], [dx[name] for name in axis.states], u, theta
    )
    parts = (written.residual, written.rates, written.output, written.rest)
    return {name: float(value) for part in parts for name, value in part.items()}


def forms_by_cause(effects):
    """The forms of each cause, in the order of the catalogue."""
    forms = defaultdict(list)
    for cls in effects:
        forms[cls().cause].append(cls())
    return list(forms.values())


@pytest.mark.slow
def test_any_two_causes_compose_and_their_order_matters_only_at_a_shared_junction(
    made, nominals, members
):
    """Forms of a cause take turns from pair to pair."""
    rng, ordered = np.random.default_rng(8), 0
    for kind, nominal in nominals.items():
        causes = forms_by_cause(members[kind])
        x, u = made.states(nominal, rng)
        for i, j in combinations(range(len(causes)), 2):
            first, second = (causes[k][(i + j) % len(causes[k])] for k in (i, j))
            axis = nominal.with_effects(first, second).at_starting_values()
            state = dict(zip(nominal.states, x, strict=True))
            for name, scale in zip(axis.states, axis.state_scales, strict=True):
                state.setdefault(name, 0.3 * scale)
            rate = dict.fromkeys(axis.states, 0.1)
            a = numbers(axis, state, rate, u)
            assert np.isfinite([*a.values()]).all(), f"{first.name}, {second.name}"
            if not set(first.junctions) & set(second.junctions):
                other = nominal.with_effects(second, first).at_starting_values()
                b = numbers(other, state, rate, u)
                assert a == pytest.approx(b, rel=1e-12), f"{first.name}, {second.name}"
                ordered += 1
    assert ordered > 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["servo", "force-driven"])
def test_all_causes_of_the_catalogue_at_once_are_nominal_at_null_and_finite_at_their_start(
    made, nominals, members, kind
):
    nominal = nominals[kind]
    axis = nominal.with_effects(*(forms[-1] for forms in forms_by_cause(members[kind])))
    x, u = made.states(nominal, np.random.default_rng(9))
    still = np.array([4e5, 5e5, 0.0, 0.0])[-len(x) :]
    full, n = axis.rest(x, u, axis.parameters.values), len(x)
    plain = nominal.rhs(x, u, nominal.parameters.values).full()
    result = axis.rhs(full, u, axis.parameters.values).full()
    np.testing.assert_allclose(result[:n], plain, rtol=1e-9)
    start = axis.at_starting_values()
    derivative = axis.rhs.jacobian()
    for point in (x, still):
        at = start.rest(point, u, start.parameters.values)
        for block in derivative(at, u, start.parameters.values, 0):
            assert np.isfinite(block.full()).all()


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.generalises])
def test_a_form_is_with_equal_sizes_and_nothing_more_the_form_that_it_contains(
    name, nominals, made
):
    own = EFFECTS[name]
    contained = EFFECTS[own.generalises]
    assert own.cause == contained.cause
    nominal, rng = nominals["servo"], np.random.default_rng(3)
    axis, plain = (nominal.with_effects(each()).at_starting_values() for each in (own, contained))
    values = plain.parameters.as_dict()
    sizes = {
        f"{name}.{item.name}": values.get(f"{contained.name}.{SIDE.sub('', item.name)}", item.null)
        for item in own.parameters
    }
    axis = axis.with_parameters(sizes)
    for _ in range(4):
        x, u = made.states(nominal, rng)
        full = plain.rest(x, u, plain.parameters.values).full().ravel()
        full[len(x) :] += 0.1 * plain.state_scales[len(x) :]
        for f in ("rhs", "output"):
            mine, other = (
                getattr(a, f)(full, u, a.parameters.values).full() for a in (axis, plain)
            )
            np.testing.assert_allclose(mine, other, rtol=1e-12)
