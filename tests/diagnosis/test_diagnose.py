"""What a diagnosis says of cases whose cause is known to the test only."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneumo_casadi.data import Case, Clock, InputHold, Recording
from pneumo_casadi.diagnosis import Verdict, diagnose, prepare_study
from pneumo_casadi.diagnosis.prepare.fit_store import Store
from pneumo_casadi.diagnosis.prepare.prepare_study import HELD_OUT, split_records
from pneumo_casadi.diagnosis.prepare.usable_records import require_rows, require_usable
from pneumo_casadi.errors import CaseError
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import Parameter
from pneumo_casadi.valve import FlowMap


@pytest.mark.slow
def test_the_hidden_effect_is_named_sized_and_placed(rubbing):
    assert rubbing.verdict is Verdict.EFFECT
    assert [effect.name for effect in rubbing.effects] == ["stribeck"]
    assert rubbing.ranking[0].names == ("stribeck",)
    assert rubbing.where.balance == "force"
    assert rubbing.effects[0].parameters["delta_F"].value > 1.0
    assert rubbing.effects[0].parameters["delta_F"].unit == "N"


@pytest.mark.slow
def test_the_gap_of_simulations_closes_on_data_that_no_fit_has_seen(rubbing):
    gap = rubbing.gap
    assert gap.after < 0.5 * gap.before
    assert gap.closure.lower <= gap.closure.value <= gap.closure.upper
    assert gap.closure.value == pytest.approx(1 - gap.after / gap.before)
    assert set(gap.views) == {"balances", "windows", "closed_loop"}


@pytest.mark.slow
def test_the_json_has_what_the_design_asks_for(rubbing):
    told = json.loads(json.dumps(rubbing.as_dict(), allow_nan=False))
    assert told["verdict"] == "effect"
    assert set(told["effects"][0]) == {
        *("name", "probability", "parameters", "contribution", "form", "forms", "rivals"),
    }
    assert set(told["effects"][0]["parameters"]["delta_F"]) == {"value", "std", "unit"}
    assert {"name", "probability", "held_out_shrink"} <= set(told["ranking"][0])
    assert {"balance", "junction", "regimes"} <= set(told["where"])
    assert {"before", "after", "noise_floor", "shrink", "shrink_interval"} <= set(told["gap"])


@pytest.mark.slow
def test_probabilities_are_shares_of_one(rubbing):
    shares = [candidate.probability for candidate in rubbing.ranking]
    assert all(0 <= share <= 1 for share in shares)
    assert sum(shares) <= 1 + 1e-9
    assert shares == sorted(shares, reverse=True)


@pytest.mark.slow
def test_nothing_wrong_is_called_so(quick_diagnosis):
    assert quick_diagnosis.verdict is Verdict.NONE
    assert quick_diagnosis.effects == () and quick_diagnosis.hint == ""
    assert quick_diagnosis.gap.before == quick_diagnosis.gap.after


@pytest.mark.slow
def test_a_cause_outside_the_catalogue_is_unknown_and_has_no_name(unlisted):
    assert unlisted.verdict is Verdict.UNKNOWN
    assert unlisted.effects == () and "mass flow N" in unlisted.hint


@pytest.mark.slow
def test_an_effect_of_ones_own_needs_no_registration_nor_a_validation_record(made_case):
    """Without one the end of the record is held out, which is said."""

    class Pull(Effect):
        """A spring by another name."""

        name = "pull"
        parameters = (Parameter("k", 0.0, "N/m", scale=100.0, null=0.0, start=50.0),)

        def force(self, F, at):
            return F - at["k"] * at.x

    case = replace(made_case(12, 5.5, spring_load="medium"), validate=())
    diagnosis = diagnose(case, {"pull": Pull})
    assert [effect.name for effect in diagnosis.effects] == ["pull"]
    assert any("held out" in note for note in diagnosis.notes)


@pytest.mark.slow
def test_another_executor_gives_the_same_numbers(rubbing_case, rubbing, small):
    with ThreadPoolExecutor(1) as executor:
        other = diagnose(rubbing_case, small, executor=executor)
    assert [effect.name for effect in other.effects] == ["stribeck"]
    assert other.effects == rubbing.effects
    assert other.gap == rubbing.gap


@pytest.mark.slow
def test_interrupted_work_goes_on_from_what_was_fitted(resumed):
    """Its numbers are compared with those of uninterrupted work above, by the other executor."""
    assert resumed.kept
    assert [effect.name for effect in resumed.diagnosis.effects] == ["stribeck"]
    assert resumed.fitted and ("stribeck",) not in resumed.fitted


@pytest.mark.slow
def test_a_delay_that_no_spool_is_fast_enough_for_is_no_valve_dynamics(rubbing):
    """The start of a fit lets it through, its end does not: 0.3 ms are the sampling's."""
    assert [effect.name for effect in rubbing.effects] == ["stribeck"]
    assert any("valve_dynamics.tau" in note and "not credible" in note for note in rubbing.notes)


@pytest.mark.slow
def test_kept_fits_of_another_flow_map_are_not_taken(rubbing_case, tmp_path):
    study, _ = prepare_study(rubbing_case)
    table = study.flow_map
    other = replace(study, flow_map=FlowMap(table.u, table.p, 1.001 * table.q_m, table.p_supply))
    again, _ = prepare_study(rubbing_case)
    assert Store.of(tmp_path, study).token == Store.of(tmp_path, again).token
    assert Store.of(tmp_path, study).token != Store.of(tmp_path, other).token


def _changed(case, **channels):
    records = []
    for record in case.identify:
        values = {name: record[name].copy() for name in record.channels} | {
            name: make(record) for name, make in channels.items()
        }
        records.append(replace(record, channels=values))
    return replace(case, identify=tuple(records))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("x", lambda record: np.random.default_rng(0).normal(0, 1e-5, record.N)),
        ("p_P", lambda record: np.full(record.N, 4e5)),
        ("p_N", lambda record: 4e5 + np.random.default_rng(1).normal(0, 150.0, record.N)),
    ],
)
def test_noise_and_rest_are_refused_by_name(made_case, small, name, values):
    with pytest.raises(CaseError, match=f"{name} varies"):
        diagnose(_changed(made_case(12), **{name: values}), small)


@pytest.mark.slow
def test_a_single_short_move_in_a_long_rest_is_refused(made_case, small):
    def step(record):
        x = np.where(np.arange(record.N) < record.N // 2, 0.0, 0.05)
        return x + np.random.default_rng(0).normal(0, 1e-5, record.N)

    with pytest.raises(CaseError, match="moves during"):
        diagnose(_changed(made_case(12), x=step), small)


def test_slow_motion_is_no_rest(made_case):
    def sine(record):
        slow = 0.1 * np.sin(2 * np.pi * np.arange(record.N) / record.N)
        return slow + np.random.default_rng(0).normal(0, 1e-5, record.N)

    require_usable(_changed(made_case(12), x=sine).identify, ("x",))


def test_held_out_records_of_which_no_row_of_a_balance_counts_are_refused():
    """Friction at rest disturbs all rows of the force: no effect on it could ever be seen."""
    moving, still = np.ones((3, 40), bool), np.ones((3, 60), bool)
    still[2] = False
    require_rows([moving, still], "validate.csv")
    with pytest.raises(CaseError, match=r"validate\.csv: too slow throughout .* faster motion"):
        require_rows([still], "validate.csv")


@pytest.mark.slow
def test_half_a_second_is_refused(made_case, small):
    case = made_case(12)
    short = tuple(record.window(record.t[0], record.t[0] + 0.5) for record in case.identify)
    with pytest.raises(CaseError, match="too short"):
        diagnose(replace(case, identify=short), small)


def moving(seconds):
    """A record of a force-driven axis that moves to and fro, with all that may be measured."""
    t = np.arange(round(1e3 * seconds)) / 1e3
    wave = np.sin(2 * np.pi * 1.3 * t)
    channels = {"F": 80.0 * wave, "F_load": 0.0 * wave, "x": 0.1 * wave, "v": wave, "a": wave}
    return Recording(t, channels, "made", "identify.csv", InputHold.ZERO)


def test_recorded_velocity_and_acceleration_are_left_out_and_said(made, monkeypatch):
    given = []
    monkeypatch.setattr(
        "pneumo_casadi.diagnosis.prepare.prepare_study.start_study",
        lambda axis, table, *records: given.extend(records[:2]) or axis,
    )
    bench = replace(made.FORCE_BENCH, signals={"v", "a", "F_load"})
    axis, (note,) = prepare_study(Case(Path("made"), bench, (moving(3.0),), (moving(3.0),)))
    assert axis.outputs == ("x",)
    assert axis.inputs == ("F", "F_load")  # a force on the rod drives the motion: it is used
    assert note.startswith("a, v: recorded but not used")
    # A filtered record would take its motion from them.
    assert {name for some in given for record in some for name in record.names} == {
        *("F", "F_load", "x")
    }


def test_records_to_fit_of_two_sampling_rates_are_refused_with_a_remedy(made, monkeypatch):
    """Their user was told to plan the filters anew, in which a diagnosis has no say."""
    fast = moving(3.0)
    slow = replace(fast.decimate(2), source="identify_2.csv")
    words = r"identify.csv: sampled at 1000 Hz, but identify_2.csv at 500 Hz; .*or leave one"
    with pytest.raises(CaseError, match=words):
        prepare_study(Case(Path("made"), made.FORCE_BENCH, (fast, slow), (fast,)))
    # A record held out is smoothed by its own filters.
    monkeypatch.setattr(
        "pneumo_casadi.diagnosis.prepare.prepare_study.start_study", lambda *given: "a study"
    )
    study, _ = prepare_study(Case(Path("made"), made.FORCE_BENCH, (fast,), (slow,)))
    assert study == "a study"


@pytest.mark.parametrize("hour", [0.0, 43_200.0, 1.7e9])
def test_the_clock_of_a_study_begins_with_its_first_record(made, monkeypatch, hour):
    """Logs count from midnight or from 1970: a formula over such times has no usable scale."""
    given = []
    monkeypatch.setattr(
        "pneumo_casadi.diagnosis.prepare.prepare_study.start_study",
        lambda axis, table, *records: given.extend(records[:2]),
    )
    fitted, held_out = moving(3.0), moving(3.0)
    shifted = [replace(r, t=r.t + hour + s) for r, s in ((fitted, 10.0), (held_out, 0.0))]
    prepare_study(Case(Path("made"), made.FORCE_BENCH, shifted[:1], shifted[1:]))
    (first,), (second,) = given
    assert second.t == pytest.approx(held_out.t, abs=1e-6)
    assert np.ptp(np.diff(second.t)) < 1e-12  # not the rounding of stamps since 1970
    assert first.t == pytest.approx(fitted.t + 10.0, abs=1e-6)


def test_conductances_are_read_from_the_records_that_are_fitted(made, monkeypatch):
    class Stop(Exception):
        pass

    def read_flow(case, options, records):
        seen.extend(records)
        raise Stop

    seen = []
    monkeypatch.setattr("pneumo_casadi.diagnosis.prepare.prepare_study.read_flow", read_flow)
    case = Case(Path("made"), made.BENCH, (moving(6.0),), ())
    with pytest.raises(Stop):
        prepare_study(case)
    (record,) = seen
    assert record.t[-1] < (1 - HELD_OUT) * 6.0


def test_short_stretches_between_gaps_are_left_out_and_said(made):
    def stretch(seconds):
        return replace(moving(seconds), clock=Clock.AS_RECORDED)

    case = Case(
        Path("made"), made.FORCE_BENCH, (stretch(6.0), stretch(1.9)), (stretch(0.3), stretch(3.0))
    )
    fitted, held_out, notes = split_records(case)
    assert [[record.N for record in records] for records in (fitted, held_out)] == [[6000], [3000]]
    assert notes[0] == (
        "identify.csv: 1 of 2 stretches between gaps, 1.9 of 7.9 s, are shorter than 2 s and are "
        "not used"
    )
    # Without a validation record a part of each is held out, which must be long enough.
    fitted, held_out, notes = split_records(
        replace(case, identify=(stretch(6.0), stretch(4.5)), validate=())
    )
    assert [record.N for record in (*fitted, *held_out)] == [3600, 2400]
    assert "shorter than 5 s" in notes[0] and "no validation record" in notes[1]
    # A record of its own that is too short is refused: its user can record anew.
    uniform = replace(case, identify=(moving(6.0), moving(4.5)), validate=())
    with pytest.raises(CaseError, match=r"4\.5 s without a validation record"):
        split_records(uniform)


def test_a_record_too_short_to_hold_out_a_part_is_refused_with_its_own_length(made):
    """Of the part that would be held out one cannot tell which record must be longer."""
    case = Case(Path("made"), made.FORCE_BENCH, (moving(4.0),), ())
    words = r"identify.csv: 4 s without .* last 40 %: record at least 5 s.* add a validation record"
    with pytest.raises(CaseError, match=words):
        split_records(case)
    train, held_out, _ = split_records(replace(case, identify=(moving(6.0),)))
    assert (train[0].N, held_out[0].N) == (3600, 2400)
