"""Where model and measurement disagree."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.data import InputHold, Recording, read_case
from pneumo_casadi.diagnosis.locate import signatures as signature_module
from pneumo_casadi.diagnosis.locate.locate import (
    balance_of_effect,
    locate,
    rival_sensor_effects,
    with_other_chamber,
)
from pneumo_casadi.diagnosis.locate.regime_maps import map_regimes
from pneumo_casadi.diagnosis.locate.regimes import find_regimes
from pneumo_casadi.diagnosis.locate.signatures import (
    HYPOTHESES,
    Signatures,
    noise_variance,
    row_signals,
    signatures,
)
from pneumo_casadi.diagnosis.metrics.findings import Where
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Condition, Regime, RegimeKind
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.diagnosis.prepare.study import start_study
from pneumo_casadi.diagnosis.wording.conclusions import unknown_hint
from pneumo_casadi.diagnosis.wording.location_sentences import location_sentences
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.equation_error.smoothed_motion import smooth_motions
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import make_axis
from pneumo_casadi.valve import FlowForm
from pneumo_casadi.virtual_bench import make_case, random_axis

FORCE_X = ("force", "x")


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Return a function that fits the nominal axis to a bench with hidden effects."""
    axis = replace(random_axis(5), F_c_plus=14.0, F_c_minus=18.0)
    known = {}

    def opened(duration=5.0, **effects):
        key = repr((duration, effects))
        if key not in known:
            folder = tmp_path_factory.mktemp("bench") / "case"
            made = make_case(folder, 5, effects, duration=duration, axis=axis)
            case = read_case(made.case.folder)
            table, flow = read_flow(case, IdentifyOptions(FlowForm.POLYNOMIALS))
            study = start_study(make_axis(case, flow), table, case.identify, case.validate)
            known[key] = study, fit_model(study, ())
        return known[key]

    return opened


@pytest.fixture
def sprung(bench):
    """A hidden spring, and records long enough to come often to the ends of the travel."""
    return bench(10.0, spring_load="medium")


@pytest.mark.slow
def test_a_term_that_explains_the_gap_says_where_it_lies(bench):
    both = (Location.MASS_FLOW_P, Location.MASS_FLOW_N)
    where = locate(*bench(cogging="medium"), explained=both)
    assert where.balance in both and set(where.balances) == set(both)
    assert where.sensor_error is None and not where.rivals


@pytest.mark.slow
def test_nothing_is_located_where_nothing_is_wrong(bench):
    where = locate(*bench())
    assert (where.balance, where.junction, where.regimes, where.rivals) == ("none", None, (), ())
    assert set(where.shares.values()) == {0.0}
    # Who knows better, from held-out simulations, may say that there is a gap.
    assert locate(*bench(), gap=True).balance != "none"
    assert locate(*bench(cogging="medium"), gap=False).balance == "none"
    # Without a gap the place is that of the parameters that contradict the bench.
    where = locate(*bench(), gap=False, contradicted=Location.MASS_FLOW_N)
    assert (where.balance, where.in_parameters) == ("mass_flow_N", True)
    assert (where.regimes, where.rivals) == ((), ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "size", "balance"),
    [
        ("cogging", "medium", "force"),
        ("leakage_N", "medium", "mass_flow_N"),
        ("position_nonlinearity", "large", "measurement"),
    ],
)
def test_a_cause_that_no_effect_explains_is_found_by_inputs_and_signatures(
    bench, effect, size, balance
):
    where = locate(*bench(**{effect: size}))
    assert where.balance == balance
    if balance != "measurement":
        assert where.shares[balance] > 0.9
        assert where.shares[balance] <= 1.0
    assert sum(where.shares.values()) == pytest.approx(1.0)
    assert any("disagree in" in sentence for sentence in location_sentences(where))


@pytest.mark.slow
def test_the_location_of_an_effect_is_where_it_acts(bench):
    study, nominal = bench(leakage_N="medium")
    leak, lag, spring = (
        EFFECTS[name]() for name in ("leakage_N", "pressure_sensor_lag", "spring_load")
    )
    fitted = fit_model(study, (leak,), nominal.values)
    where = locate(study, nominal, (leak,), fitted)
    assert (where.balance, where.junction) == ("mass_flow_N", "chamber_flow")
    assert where.balances == ("mass_flow_N",)
    added = where.sizes["leakage_N"]
    assert max(added, key=lambda name: added[name]) == "mass_flow_N"
    assert added["mass_flow_P"] == added["force"] == 0.0
    assert "leakage_N" in " ".join(location_sentences(where))
    # Beside another effect that mends more elsewhere it stays where it is.
    spring_too = fit_model(study, (leak, spring), nominal.values)
    both = locate(study, nominal, (leak, spring), spring_too)
    assert both.balance == "mass_flow_N"
    assert both.balances == ("mass_flow_N", "force")
    assert set(both.sizes["spring_load"]) == {"force"}
    # It is the effect that tells, not the residuals.
    assert balance_of_effect(lag, {}) == "measurement"
    assert balance_of_effect(spring, {"mass_flow_P": 1.0, "force": 0.0}) == "force"
    # Its load moves: that the piston is elsewhere, and volumes with it, is what follows.
    ahead = EFFECTS["position_on_elastic_load"]()
    assert balance_of_effect(ahead, {"mass_flow_N": 1.0, "force": 0.1}) == "force"


def test_an_effect_of_both_chambers_is_where_it_adds_more():
    valve = EFFECTS["valve_dynamics"]()
    added = {"mass_flow_P": 0.2, "mass_flow_N": 0.3, "force": 0.9}
    assert balance_of_effect(valve, added) == "mass_flow_N"
    flows = ("mass_flow_N", "mass_flow_P")
    assert with_other_chamber(Location.MASS_FLOW_N, added) == flows
    assert with_other_chamber(Location.MASS_FLOW_N, added | {"mass_flow_P": 0.05}) == flows[:1]


@pytest.mark.slow
def test_one_error_of_the_position_explains_what_no_single_input_does(bench):
    signature = signatures(*with_values(bench(position_nonlinearity="large")))
    assert set(signature.left) == set(HYPOTHESES)
    assert signature.before > 20
    assert signature.left["position"] < 0.3 * min(signature.inputs.values())
    unknown_force = signatures(*with_values(bench(cogging="medium")))
    assert unknown_force.left["force"] < 0.5 * min(unknown_force.sensors.values())


def test_signatures_of_a_long_record_count_by_its_rows(monkeypatch):
    """A short record had as much to say as a long one."""
    sizes = {"long": Signatures(10.0, {"force": 2.0}), "short": Signatures(40.0, {"force": 6.0})}
    monkeypatch.setattr(signature_module, "_record_signatures", lambda *given: sizes[given[-1]])
    monkeypatch.setattr(
        signature_module, "rows_that_count", lambda *given: np.array([[200, 100], [60, 40]])
    )
    study = SimpleNamespace(axis=None, smoothed=((), ("long", "short")))
    pooled = signatures(study, {})
    assert (pooled.before, pooled.left["force"]) == pytest.approx((17.5, 3.0))


def with_values(opened):
    study, nominal = opened
    return study, nominal.values


def test_sensors_are_rivals_only_where_they_explain_about_as_much():
    left = {"mass_flows": 1.0, "force": 30.0, "position": 2.0, "pressures": 8.0}
    assert rival_sensor_effects(Signatures(40.0, left), EFFECTS) == ("position_delay", "backlash")
    # A gap that is hardly larger than noise has no signature.
    assert rival_sensor_effects(Signatures(3.0, left), EFFECTS) == ()
    # A cause is named once, whatever its forms.
    left |= {"position": 9.0, "pressures": 1.0}
    rivals = rival_sensor_effects(Signatures(40.0, left), EFFECTS)
    assert rivals == ("pressure_sensor_lag", "pressure_sensor_bias")


@pytest.mark.slow
def test_regimes_say_where_a_spring_acts_and_are_silent_where_nothing_does(bench, sprung):
    assert find_regimes(*bench()) == ()
    regimes = find_regimes(*sprung)
    assert regimes[0].balance == "force"
    assert any("ends of the travel" in regime.name for regime in regimes)
    assert all(regime.ratio > 1.3 and regime.p_value < 0.01 for regime in regimes)


@pytest.mark.slow
def test_shuffled_blocks_find_no_regime_in_drifting_noise(bench):
    """Noise that remembers a quarter of a second has no regimes, as often as its level says."""
    study, nominal = bench()
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(8):
        walks = [
            np.array([smooth(rng.normal(0.0, 1e5, r.shape[1])) for _ in r])
            for r in (*nominal.train, *nominal.held_out)
        ]
        noise = replace(nominal, train=tuple(walks[:1]), held_out=tuple(walks[1:]))
        hits += sum(
            regime.condition.kind is not RegimeKind.BAND for regime in find_regimes(study, noise)
        )
    # Eight draws of three balances with some twenty regimes each at a level of one per cent.
    assert hits < 25


def smooth(values):
    return np.convolve(values, np.hanning(16), mode="same")


@pytest.mark.slow
def test_maps_show_the_spring_as_a_slope_over_position(sprung):
    maps = {(m.balance, m.name): m for m in map_regimes(*sprung)}
    slope = maps["force", "x"]
    assert slope.mean.size == slope.band.size == slope.edges.size - 1
    assert np.all(np.diff(slope.edges) > 0)
    # The model pushes too far out: it has no spring that pulls back to the middle.
    assert slope.mean[0] < -slope.band[0]
    assert slope.mean[-1] > slope.band[-1]


def test_the_position_is_resolved_to_its_ends(sprung):
    (x,) = (m for m in map_regimes(*sprung) if (m.balance, m.name) == FORCE_X)
    widths = np.diff(x.edges)
    assert widths.max() < 4 * np.median(widths)
    assert x.mean.size > 40


def test_signals_and_noise_of_a_force_driven_axis_are_accelerations(made):
    """Its balance is divided by M: so are force and noise, which it is compared with."""
    axis, t = made.true_force_axis(), np.arange(4000) / made.FS
    x = axis.bench.noise.x * np.random.default_rng(0).normal(size=t.size)
    F = 40.0 * np.sin(2 * np.pi * 2.0 * t)
    record = Recording(t, {"F": F, "x": x}, "at rest", "made", InputHold.ZERO)
    (data,) = smooth_motions(axis, [record])
    values = axis.parameters.as_dict()
    (signal,) = row_signals(axis, values, data)
    assert signal == pytest.approx(40.0 / np.sqrt(2) / values["M"], rel=0.02)
    (variance,) = noise_variance(axis, values, data)
    shown = data.averaged(data.dx[1:])
    assert np.sqrt(variance) == pytest.approx(np.std(shown), rel=0.25)


def test_a_force_driven_axis_has_a_force_alone(emps_like):
    study, nominal = emps_like
    where = locate(study, nominal)
    assert set(where.shares) == {"force"}
    assert where.balance == "force"


@pytest.fixture(scope="module")
def emps_like(data_folder):
    case = read_case(data_folder / "emps")
    study = start_study(make_axis(case, None), None, case.identify, case.validate)
    return study, fit_model(study, ())


def test_a_condition_that_two_balances_share_is_told_once():
    late = Condition(RegimeKind.AFTER_REVERSAL, upper=0.05)
    flows = Location.MASS_FLOW_P, Location.MASS_FLOW_N
    regimes = [Regime(late, balance, 0.5, 0.1, 0.001) for balance in flows]
    regimes.append(Regime(Condition(RegimeKind.FORWARD), flows[0], 0.5, 0.3, 0.01))
    where = Where(Location.MEASUREMENT, None, tuple(regimes), {"x": 1.0}, ())
    told = "what is missing acts in measurement; most within 50 ms after a reversal, moving in +x"
    assert unknown_hint(where, (), None, 1.0) == told
