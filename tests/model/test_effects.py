"""How effects are written, refused and composed."""

from types import MappingProxyType

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.effects import (
    AsymmetricViscousFriction,
    PressureFriction,
    Stribeck,
    ValveDynamics,
)
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect, State
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.parameters import Parameter, Parameters


class Spring(Effect):
    """A spring that nobody registered."""

    name = "spring"
    parameters = (Parameter("c", 0.0, "N/m", lower=0.0, scale=100.0, null=0.0),)

    def force(self, F, at):
        return F - at["c"] * at.x


class Doubling(Effect):
    """Twice whatever force arrives, so that the order shows."""

    name = "doubling"
    parameters = (Parameter("share", 1.0, "1", null=0.0),)

    def force(self, F, at):
        return F * (1 + at["share"])


class Drive(Effect):
    """Acts on the drive of a force-driven axis alone."""

    name = "drive_gain"
    parameters = (Parameter("gain", 1.0, "1", null=1.0),)

    def drive(self, F, at):
        return F * at["gain"]


class Leak(Effect):
    """Acts on a chamber."""

    name = "leak"
    parameters = (Parameter("g", 0.0, "kg/(s Pa)", null=0.0),)

    def chamber_flow(self, q_m, at):
        return Pair(q_m.P - at["g"] * (at.p.P - at.axis["p_ext"]), q_m.N)


def test_an_effect_defined_here_works_without_registration_on_either_axis(made):
    for axis, x in (
        (made.true_axis(Spring()), [4e5, 5e5, 0.1, 0.2]),
        (made.true_force_axis(Spring()), [0.1, 0.2]),
    ):
        u = np.zeros(len(axis.inputs))
        stiff = axis.with_parameters({"spring.c": 300.0})
        one, two = (a.rhs(x, u, a.parameters.values).full().ravel() for a in (axis, stiff))
        assert (two - one)[-1] == pytest.approx(-300.0 * 0.1 / axis.parameters["M"].value)
        np.testing.assert_array_equal(one[:-1], two[:-1])


def test_two_effects_at_one_junction_act_in_the_order_given(made):
    x, u = [0.1, 0.2], [50.0]
    nominal = made.true_force_axis()
    M = nominal.parameters["M"].value
    F = M * float(nominal.rhs(x, u, nominal.parameters.values)[1])
    for effects, wanted in (
        ((Spring(), Doubling()), 2 * (F - 30.0)),
        ((Doubling(), Spring()), 2 * F - 30.0),
    ):
        axis = made.true_force_axis(*effects).with_parameters({"spring.c": 300.0})
        found = M * float(axis.rhs(x, u, axis.parameters.values)[1])
        assert found == pytest.approx(wanted, rel=1e-12)


def test_added_one_by_one_or_together_effects_make_the_same_axis(made):
    together = made.true_axis(Stribeck(), ValveDynamics())
    apart = made.true_axis(Stribeck()).with_effects(ValveDynamics())
    assert together.states == apart.states and together.parameters == apart.parameters


def test_an_effect_at_a_junction_the_axis_lacks_is_refused_by_name(made):
    with pytest.raises(ModelError, match="effect leak acts at chamber_flow, which a force-driven"):
        made.true_force_axis(Leak())
    with pytest.raises(ModelError, match="effect drive_gain acts at drive, which a servo axis"):
        made.true_axis(Drive())
    with pytest.raises(ModelError, match="effect valve_dynamics acts at spool"):
        made.true_force_axis(ValveDynamics())


def test_an_effect_that_reads_pressures_is_refused_where_there_are_none(made):
    with pytest.raises(ModelError, match="effect pressure_friction needs pressures"):
        made.true_force_axis(PressureFriction())


def test_effects_are_put_where_a_fit_starts_all_or_by_name(made):
    axis = made.true_axis(Stribeck(), PressureFriction())
    starts = {
        f"{effect.name}.{item.name}": item.start
        for effect in (Stribeck, PressureFriction)
        for item in effect.parameters
        if item.start is not None
    }
    at_start = axis.at_starting_values()
    assert {name: at_start.parameters[name].value for name in starts} == starts
    one = axis.at_starting_values("stribeck")
    assert one.parameters["stribeck.delta_F"].value == starts["stribeck.delta_F"]
    assert one.parameters["pressure_friction.k_p"].value == 0.0
    assert axis.parameters["stribeck.delta_F"].value == 0.0
    with pytest.raises(ModelError, match="the axis has no effect stribek"):
        axis.at_starting_values("stribek")


def test_a_start_outside_the_bounds_is_refused_and_follows_bounds_that_move():
    with pytest.raises(ModelError, match="c: a fit would start at 5 N, outside"):
        Parameter("c", 0.0, "N", lower=0.0, upper=2.0, null=0.0, start=5.0)
    wide = Parameters([Parameter("c", 0.0, "N", lower=0.0, upper=9.0, null=0.0, start=5.0)])
    assert wide.bounded("c", 0.0, 2.0)["c"].start == 2.0


def test_the_same_effect_twice_is_refused(made):
    with pytest.raises(ModelError, match="named twice: stribeck"):
        made.true_axis(Stribeck(), Stribeck())


def test_effects_that_break_the_rules_are_refused_when_they_are_written():
    with pytest.raises(ModelError, match="must be an identifier"):

        class Nameless(Effect):
            pass

    with pytest.raises(ModelError, match="no null value for c"):

        class NoNull(Effect):
            name = "no_null"
            parameters = (Parameter("c", 0.0, "N"),)

    with pytest.raises(ModelError, match="different names"):

        class Clash(Effect):
            name = "clash"
            parameters = (Parameter("z", 0.0, "N", null=0.0),)
            states = (State("z", "N"),)


def test_a_range_for_a_parameter_that_an_effect_has_not_is_refused():
    with pytest.raises(ModelError, match="effect vague: credible names no parameter: d"):

        class Vague(Effect):
            name = "vague"
            credible = MappingProxyType({"d": (0.0, 1.0)})


def test_states_without_rates_are_refused(made):
    class Still(Effect):
        name = "still"
        states = (State("z", "N"),)

        def force(self, F, at):
            return F - at["z"]

    with pytest.raises(ModelError, match="effect still has states but no rates"):
        _ = made.true_force_axis(Still()).rhs


def test_asymmetric_viscous_friction_has_another_slope_each_way(made):
    axis = made.true_force_axis(AsymmetricViscousFriction())
    odd = axis.with_parameters({"asymmetric_viscous_friction.delta_f_v": 4.0})
    for v, slope in ((0.4, 25.0 + 4.0), (-0.4, 25.0 - 4.0)):
        f = odd.rhs.jacobian()
        damping = -float(f([0, v], [0], odd.parameters.values, 0)[0][1, 1]) * 18.0
        assert damping == pytest.approx(slope, rel=1e-9)


def test_an_effect_may_be_written_with_casadi_functions_on_a_spline_axis(made):
    class Bump(Effect):
        name = "bump"
        parameters = (Parameter("h", 0.0, "N", null=0.0),)

        def force(self, F, at):
            return F - at["h"] * ca.sin(50 * at.x)

    axis = made.spline_axis(Bump()).with_parameters({"bump.h": 5.0})
    plain = made.spline_axis()
    x, u = [4e5, 5e5, 0.01, 0.2], [0.5, -0.5]
    one, two = (float(a.rhs(x, u, a.parameters.values)[3]) for a in (axis, plain))
    assert (one - two) * made.TRUE["M"] == pytest.approx(-5.0 * np.sin(0.5), rel=1e-9)
