"""Decision rules on small cases made by hand: every threshold is met from both sides.

Balances are those of the servo axis: two mass flows and the force. Noise floors are one, so that
residuals are in units of them.
"""

from dataclasses import replace
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest

from pneumo_casadi.data import Bench, FlowSource, ValveData, Valves
from pneumo_casadi.diagnosis import Check, Location, Verdict
from pneumo_casadi.diagnosis.checks.absorbed import absorbed_candidates
from pneumo_casadi.diagnosis.checks.parameter_checks import check_parameters
from pneumo_casadi.diagnosis.decide.credibility import near_noise, review_verdict
from pneumo_casadi.diagnosis.decide.decision import decide_verdict
from pneumo_casadi.diagnosis.decide.judgement import Judgement, judge, missed_gain
from pneumo_casadi.diagnosis.decide.what_is_left import open_balances, unexplained
from pneumo_casadi.diagnosis.locate.locate import balance_of_gap, rival_sensor_effects
from pneumo_casadi.diagnosis.locate.signatures import Signatures
from pneumo_casadi.diagnosis.metrics.residual_size import BalanceLevels
from pneumo_casadi.diagnosis.metrics.simulated_fit import WINDOW
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, in_floors
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.select import contributions as missed
from pneumo_casadi.diagnosis.select.acceptance import accepted, surely_gains
from pneumo_casadi.diagnosis.select.complete import Completed
from pneumo_casadi.diagnosis.select.contributions import SHORT, contributions
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.estimation.output_error.result import FlowMapDeviation

LEVELS = BalanceLevels(np.ones(3), np.full(3, 100.0))
METERED = ValveData(FlowSource.METERED)
ROWS = 640  # twenty blocks of the bootstrap


def fitted(*rms, cost=0.0, rows=None):
    """A fit whose residuals have these root mean squares in every block, held out or not."""
    r = np.outer(rms, np.ones(ROWS)) if rows is None else rows
    used = np.ones(r.shape, dtype=bool)
    return FittedModel((), {}, {}, cost, (r,), (r,), (used,), (used,), True)


def with_gap(gap):
    """The residual that leaves a gap [noise floors] above what a right model leaves."""
    return float(np.hypot(gap, in_floors(CRITERIA.background)))


def selected(nominal, fits=None, path=(), **given):
    return Selection(
        nominal, fits or {}, (), {}, path, LEVELS, given.get("refined", {}),
        given.get("gap_left", {}), given.get("trials", {}), None, {},
        given.get("contributions", {}), given.get("completed"),
    )  # fmt: skip


ONE = (("stribeck",),)


# Contributions.


def ledger_of(left, soon):
    """A ledger whose models leave these shares of the simulated gap; None for a fit that fails.

    In short windows they leave those of `soon`, where it has others.
    """

    def fit_without(names, some):
        keys = {name: tuple(sorted(set(names) - {name})) for name in some}
        return {name: None if left[key] is None else key for name, key in keys.items()}

    def fit_all(models):
        fits.update({key: key for key in models if left[key] is not None})

    def share(nominal, fit, effects, window):
        return {**left, **(soon if window == SHORT else {})}[effects]

    fits = {}
    return SimpleNamespace(
        fits=fits, output_error_fits={}, fit_without=fit_without, fit_all=fit_all,
        key=lambda names: tuple(sorted(names)), effects=lambda names: names,
        begin_simulations=lambda fits, window=WINDOW: None,
        simulations=SimpleNamespace(share=share, tells=lambda *given: True),
        study=SimpleNamespace(held_out=(SimpleNamespace(dt=1e-3),)),
    )  # fmt: skip


class Fit(tuple):
    """A fit that is known by its effects."""

    values = MappingProxyType({})


@pytest.mark.parametrize(
    ("left", "soon", "lost", "named", "expected"),
    [
        (
            {("a", "b"): 0.1, ("a",): 0.7, ("b",): 0.3},
            {},
            {("a",): 50, ("b",): 50},
            "ab",
            {"b": 0.6, "a": 0.2},
        ),
        # Without b the motion drifts further off, but not at once.
        (
            {("a", "b"): 0.1, ("a",): 0.7, ("b",): 0.3},
            {("a",): 0.2, ("b",): 0.4},
            {("a",): 50, ("b",): 50},
            "ab",
            {"a": 0.2, "b": 0.6},
        ),
        # Balances that miss b more do not decide where the motion hardly misses it; nor the other.
        (
            {("a", "b"): 0.1, ("a",): 0.11, ("b",): 0.8},
            {},
            {("a",): 500, ("b",): 50},
            "ab",
            {"a": 0.7, "b": 0.01},
        ),
        (
            {("a", "b"): 0.1, ("a",): 0.4, ("b",): 0.5},
            {},
            {("a",): 500, ("b",): 50},
            "ab",
            {"b": 0.3, "a": 0.4},
        ),
        # Without b the balances lose nothing: the motion tells.
        (
            {("a", "b"): 0.1, ("a",): 0.2, ("b",): 0.6},
            {},
            {("a",): -50, ("b",): -90},
            "ab",
            {"a": 0.5, "b": 0.1},
        ),
        # Where simulation is no better with either, the balances tell.
        (
            {("a", "b"): 0.9, ("a",): 0.8, ("b",): 0.9},
            {},
            {("a",): 500, ("b",): 50},
            "ab",
            {"b": -0.1, "a": 0.0},
        ),
        ({("a",): 0.2}, {}, {}, "a", {"a": 0.8}),  # alone it contributes what it closes
        # Without an effect that a model needs to be fitted at all the whole gap is back.
        (
            {("a", "b"): 0.2, ("a",): None, ("b",): 0.5},
            {},
            {("b",): 50},
            "ab",
            {"b": 0.8, "a": 0.3},
        ),
        # One besides that can stand for another does not make that one superfluous.
        (
            {("a", "b", "w"): 0.05, ("a", "b"): 0.1, ("b", "w"): 0.06, ("a",): 0.3, ("b",): 0.8},
            {},
            {("b", "w"): 2, ("a",): 50, ("b",): 50},
            "ab",
            {"a": 0.7, "b": 0.2},
        ),
    ],
)
def test_the_effect_that_balances_and_motion_miss_most_is_first(
    left, soon, lost, named, expected, monkeypatch
):
    """What is told of each is the gap that comes back without it."""
    final = max(left, key=len)
    ledger = ledger_of(left, soon)
    ledger.fits[final] = Fit(final)
    monkeypatch.setattr(missed, "gain_on_all_records", lambda before, after: lost[before])
    shares = contributions(ledger, None, final, tuple(named), LEVELS)
    assert list(shares) == list(expected)
    assert shares == pytest.approx(expected)


# Acceptance.


@pytest.mark.parametrize(
    ("origin", "before", "after", "expected"),
    [
        # A gain of log σ of one twentieth, near the noise where little closes much of the gap.
        ((1, 1, 1.3), None, (1, 1, 1.1894), True),
        ((1, 1, 1.3), None, (1, 1, 1.2057), False),
        # A tenth of the first gap.
        ((1, 1, with_gap(10)), None, (1, 1, with_gap(8.9)), True),
        ((1, 1, with_gap(10)), None, (1, 1, with_gap(9.1)), False),
        ((1, 1, with_gap(30)), (1, 1, with_gap(10)), (1, 1, with_gap(7.2)), False),
        # Or, in the force balance, three tenths of a visible gap that is left.
        ((1, 1, with_gap(30)), (1, 1, with_gap(2.5)), (1, 1, with_gap(1.7)), True),
        ((1, 1, with_gap(30)), (1, 1, with_gap(2.5)), (1, 1, with_gap(1.8)), False),
        ((1, 1, with_gap(30)), (1, 1, 1.45), (1, 1, 1.0), False),
        ((with_gap(30), 1, 1), (with_gap(2.5), 1, 1), (with_gap(1.7), 1, 1), False),
        # A further effect in a mass flow must gain twice as much ...
        ((2.2, 1, 1), (2.0, 1, 1), (1.7403, 1, 1), True),
        ((2.2, 1, 1), (2.0, 1, 1), (1.7775, 1, 1), False),
        ((1, 1, 2.2), (1, 1, 2.0), (1, 1, 1.7775), True),  # the force need not
        # ... on residuals that are more than what a coarse map leaves.
        ((1.8, 1, 1), (1.55, 1, 1), (1, 1, 1), True),
        ((1.8, 1, 1), (1.45, 1, 1), (1, 1, 1), False),
        # What another balance loses counts.
        ((1, 1, 10), None, (4, 4, 8), False),
    ],
)
def test_a_model_is_accepted(origin, before, after, expected):
    first = fitted(*origin)
    current = first if before is None else fitted(*before)
    assert accepted(first, current, fitted(*after), LEVELS) is expected


@pytest.mark.parametrize(("better", "expected"), [(20, True), (12, True), (5, False), (1, False)])
def test_a_gain_in_few_blocks_is_not_sure(better, expected):
    """Blocks in which the residual falls from 3 to 1.5; in the others it grows from 3 to 3.6."""
    before, after = np.ones((3, ROWS)), np.ones((3, ROWS))
    before[2], after[2] = 3.0, 3.6
    after[2, : better * ROWS // 20] = 1.5
    current = fitted(rows=before)
    assert accepted(current, current, fitted(rows=after), LEVELS) is expected
    assert surely_gains(current, fitted(rows=after), LEVELS) is expected


@pytest.mark.parametrize(
    ("flow", "force", "expected"), [(1.0, 2.97, True), (1.0, 3.03, False), (1.02, 2.97, False)]
)
def test_a_sure_gain_of_any_size_counts_unless_another_balance_loses_more(flow, force, expected):
    before, after = np.ones((3, ROWS)), np.ones((3, ROWS))
    before[2], after[2], after[0] = 3.0, force, flow
    current, better = fitted(rows=before), fitted(rows=after)
    assert surely_gains(current, better, LEVELS) is expected
    assert not accepted(current, current, better, LEVELS)


# Verdict.


@pytest.mark.parametrize(
    ("rms", "expected"),
    [
        ((1, 1, 1.45), Verdict.NONE),
        ((1, 1, 1.55), Verdict.UNKNOWN),
        ((1.55, 1, 1), Verdict.UNKNOWN),
    ],
)
def test_a_gap_without_an_accepted_effect_is_unknown_where_it_is_visible(rms, expected):
    assert judge(selected(fitted(*rms)), ()).verdict is expected


@pytest.mark.parametrize(
    ("rms", "corrected", "expected"),
    [
        ((1.9, 1, 1), (1.4, 1, 1), Verdict.NONE),
        ((1.9, 1.6, 1), (1.4, 1.4, 1), Verdict.NONE),
        ((1.9, 1, 1), (1.6, 1, 1), Verdict.UNKNOWN),  # something else is left
        ((1.9, 1.6, 1), (1.4, 1.6, 1), Verdict.UNKNOWN),
        ((2.1, 1, 1), (1.0, 1, 1), Verdict.UNKNOWN),  # more than a coarse map leaves
        ((1.9, 1, 1.6), (1.4, 1, 1.0), Verdict.UNKNOWN),  # the force has no map
    ],
)
def test_the_misfit_of_a_coarse_map_is_no_gap(rms, corrected, expected):
    selection = selected(fitted(*rms), {("flow_map_shape",): fitted(*corrected)})
    assert judge(selection, (), corrections={"flow_map_shape"}).verdict is expected
    assert judge(selection, ()).verdict is Verdict.UNKNOWN
    with_term = judge(selection, (), surpassed=True, corrections={"flow_map_shape"})
    assert with_term.verdict is Verdict.UNKNOWN
    assert decide_verdict(selection, (), EFFECTS).verdict is expected


@pytest.mark.parametrize(
    ("nominal", "final", "expected"),
    [
        ((0, 0, 10), (0, 0, 4.5), 0.45),
        ((0, 0, 10), (0, 0, 0), 0.0),
        ((8, 0, 10), (4, 0, 1), 0.5),  # the worst balance counts
        ((3.3, 0, 10), (3.3, 0, 1), 1.0),  # a third of the largest gap is one
        ((2.2, 0, 10), (2.2, 0, 3), 0.3),  # a quarter is not
        # ... unless what is left is clear of the noise: misfit would have gone with its cause.
        ((2.7, 0, 10), (2.7, 0, 3), 1.0),
        ((2.7, 0, 10), (2.2, 0, 3), 0.3),
        ((0.5, 0, 10), (2.7, 0, 1), 5.4),
        ((0, 0, 10), (2.7, 0, 1), 1.0),
        ((0, 0, 0), (0, 0, 0), 0.0),
    ],
)
def test_what_is_unexplained_is_the_share_left_in_the_worst_balance(nominal, final, expected):
    before, after = (fitted(*map(with_gap, gaps)) for gaps in (nominal, final))
    assert unexplained(selected(before, {ONE[0]: after}, ONE)) == pytest.approx(expected)


@pytest.mark.parametrize("simulated", [False, True])
def test_a_balance_that_no_effect_touches_casts_no_doubt_where_simulations_are_explained(simulated):
    """Friction over position closed 88 % of what one sees, and a coarse data sheet leaves a gap."""
    before, after = (fitted(*map(with_gap, gaps)) for gaps in ((2.7, 0, 10), (2.7, 0, 1)))
    chosen = replace(selected(before, {ONE[0]: after}, ONE), simulated=simulated)
    assert unexplained(chosen) == pytest.approx(0.1 if simulated else 1.0)
    assert open_balances(chosen) == ((0,) if simulated else ())
    judgement = judge(chosen, (EFFECTS["position_friction"](),))
    assert judgement.verdict is (Verdict.EFFECT if simulated else Verdict.UNKNOWN)
    assert judgement.probability[ONE[0]] == pytest.approx(0.75 if simulated else 0.08)


@pytest.mark.parametrize(
    ("nominal", "final", "kept"),
    [
        ((2.7, 0, 10), (2.7, 0, 1), True),
        ((3.3, 0, 10), (3.3, 0, 1), False),  # it was no small one
        ((2.4, 0, 10), (2.7, 0, 1), False),  # the effects named have made it larger
        ((0, 0, 10), (2.7, 0, 1), False),
    ],
)
def test_a_small_gap_alone_may_be_kept(nominal, final, kept):
    before, after = (fitted(*map(with_gap, gaps)) for gaps in (nominal, final))
    chosen = replace(selected(before, {ONE[0]: after}, ONE), simulated=True)
    assert open_balances(chosen) == ((0,) if kept else ())
    verdict = judge(chosen, (EFFECTS["position_friction"](),)).verdict
    assert verdict is (Verdict.EFFECT if kept else Verdict.UNKNOWN)


@pytest.mark.parametrize(("explained", "kept"), [(100.0, False), (300.0, True)])
def test_a_gap_of_many_floors_may_be_small_beside_what_the_balance_explains(explained, kept):
    """A supply that sags behind a pipe, and bristles of which 1.3 % of the force are left."""
    levels = BalanceLevels(np.ones(3), np.array([100.0, 100.0, explained]))
    before, after = (fitted(*map(with_gap, gaps)) for gaps in ((10, 10, 5), (1, 1, 5)))
    chosen = replace(selected(before, {ONE[0]: after}, ONE), simulated=True, levels=levels)
    assert open_balances(chosen) == ((2,) if kept else ())


def test_a_gap_that_is_kept_beside_contradicted_parameters_is_not_believed():
    before, after = (fitted(*map(with_gap, gaps)) for gaps in ((2.7, 0, 10), (2.7, 0, 0.5)))
    chosen = replace(selected(before, {ONE[0]: after}, ONE), simulated=True)
    judgement = judge(chosen, (EFFECTS["position_friction"](),))
    assert judgement.unexplained < CRITERIA.contradicted and judgement.left_open == 1.0
    assert review_verdict(judgement, failing("M"), EFFECTS)[0] is Verdict.UNKNOWN
    assert review_verdict(judgement, (), EFFECTS)[0] is Verdict.EFFECT


@pytest.mark.parametrize(("flow", "expected"), [(2.0, 1.0), (1.8, 0.0)])
def test_a_mass_flow_near_what_a_coarse_map_leaves_does_not_count_beside_another(flow, expected):
    before, after = fitted(flow, 1, with_gap(4)), fitted(flow, 1, 1)
    assert unexplained(selected(before, {ONE[0]: after}, ONE)) == pytest.approx(expected)


def test_where_simulations_decide_it_is_their_share():
    before, after = fitted(1, 1, 10), fitted(1, 1, 10)
    given = {"fits": {ONE[0]: after}, "path": ONE}
    assert unexplained(selected(before, **given, gap_left={ONE[0]: 0.34})) == 0.34
    assert unexplained(selected(before, **given, gap_left={ONE[0]: 0.36})) == pytest.approx(1.0)
    pair = ("backlash", "stribeck")
    refined = {"fits": {pair: after}, "path": (pair,), "refined": {pair: after}}
    assert unexplained(selected(before, **refined, gap_left={pair: 0.8})) == 0.8


@pytest.mark.parametrize(
    ("left", "one_form", "nominal", "expected"),
    [
        (0.45, False, 40.0, Verdict.EFFECT),
        (0.55, False, 40.0, Verdict.UNKNOWN),
        # An offset has no other form: what it leaves has another cause.
        (0.07, True, 40.0, Verdict.EFFECT),
        (0.09, True, 40.0, Verdict.UNKNOWN),
        # ... where what is left is clear.
        (0.2, True, 5 * np.sqrt(2.65**2 - in_floors(CRITERIA.background) ** 2), Verdict.UNKNOWN),
        (0.2, True, 5 * np.sqrt(2.35**2 - in_floors(CRITERIA.background) ** 2), Verdict.EFFECT),
    ],
)
def test_an_effect_that_leaves_too_much_is_not_the_cause(left, one_form, nominal, expected):
    before = fitted(1, 1, with_gap(nominal), cost=100.0)
    after = fitted(1, 1, with_gap(left * nominal))
    effects = (acting("force", one_form),)
    assert judge(selected(before, {ONE[0]: after}, ONE), effects).verdict is expected


def test_effects_that_a_term_surpasses_are_not_the_cause():
    selection = selected(fitted(1, 1, with_gap(40), cost=100.0), {ONE[0]: fitted(1, 1, 1)}, ONE)
    assert judge(selection, ()).verdict is Verdict.EFFECT
    assert judge(selection, (), surpassed=True).verdict is Verdict.UNKNOWN


def acting(junction, one_form):
    return SimpleNamespace(one_form=one_form, junctions=(junction,))


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        # Friction, which may have another law, says nothing of what a leak leaves in a mass flow.
        ((acting("force", False),), Verdict.UNKNOWN),
        ((acting("chamber_flow", False),), Verdict.EFFECT),
        ((acting("output", False),), Verdict.EFFECT),  # a sensor's error shows in all balances
    ],
)
def test_what_effects_of_one_form_leave_is_asked_balance_by_balance(others, expected):
    before, after = fitted(1, with_gap(40), 1, cost=100.0), fitted(1, with_gap(4), 1)
    leak = acting("chamber_flow", True)
    assert judge(selected(before, {ONE[0]: after}, ONE), (leak, *others)).verdict is expected


@pytest.mark.parametrize(("left", "expected"), [(1.45, Verdict.EFFECT), (1.55, Verdict.UNKNOWN)])
def test_a_large_share_of_a_gap_is_no_unknown_cause_unless_it_is_visible(left, expected):
    before, after = fitted(1, 1, 1.7, cost=100.0), fitted(1, 1, left)
    assert judge(selected(before, {ONE[0]: after}, ONE), ()).verdict is expected


def test_weak_effects_besides_are_no_part_of_an_alternative():
    large, weak = ("stribeck",), ("hose", "stribeck")
    fits = {large: fitted(1, 1, 2.0), weak: fitted(1, 1, 1.0)}
    fits["hose", "presliding"] = fitted(1, 1, 1.1)
    fits["leakage_N", "stribeck"] = fitted(1, 1, 1.01)
    completed = Completed(weak, large)
    selection = selected(fitted(1, 1, 10.0), fits, ONE, completed=completed)
    assert (selection.chosen, selection.named, selection.besides) == (weak, large, ("hose",))
    judgement = judge(selection, ())
    assert judgement.verdict is Verdict.EFFECT
    # What may stand for the hose is no alternative to the cause.
    assert judgement.alike == (("stribeck",), ("presliding",))


@pytest.mark.parametrize(
    ("final", "expected"),
    [
        (1.25, 0.97),  # clean
        (with_gap(1.0), 0.97 - 1.5 * 0.1),
        (with_gap(2.0), 0.75),
        (1.35, 0.97 - 1.5 * np.sqrt(1.35**2 - in_floors(CRITERIA.background) ** 2) / 10),
    ],
)
def test_the_probability_falls_with_what_is_left(final, expected):
    before, after = fitted(1, 1, with_gap(10.0)), fitted(1, 1, final)
    judgement = judge(selected(before, {ONE[0]: after}, ONE), ())
    assert judgement.probability[ONE[0]] == pytest.approx(expected)


def rivals(ratio):
    """Two effects; the second one's weight is `ratio` of the first one's."""
    missed = -np.log(ratio) / 25.0
    fits = {("stribeck",): fitted(1, 1, 1.0), ("presliding",): fitted(1, 1, 10.0**missed)}
    return selected(fitted(1, 1, 10.0), fits, ONE)


@pytest.mark.parametrize(
    ("ratio", "expected", "alike"),
    [(0.6, Verdict.EFFECT, 2), (0.75, Verdict.AMBIGUOUS, 2), (0.13, Verdict.EFFECT, 2),
     (0.10, Verdict.EFFECT, 1)],
)  # fmt: skip
def test_an_effect_with_a_close_rival_is_ambiguous(ratio, expected, alike):
    judgement = judge(rivals(ratio), ())
    assert judgement.verdict is expected
    assert len(judgement.alike) == alike
    assert judgement.alike[0] == ("stribeck",)
    assert sum(judgement.probability.values()) == pytest.approx(0.97)


@pytest.mark.parametrize(
    ("share", "verdict", "undecided"),
    [
        (0.01, Verdict.EFFECT, ("valve_null_shift",)),
        # It matters: the verdict must say that it is open, and still not name one of two.
        (0.06, Verdict.AMBIGUOUS, ("valve_null_shift",)),
    ],
)
def test_a_weak_effect_with_a_close_rival_leaves_the_strong_one_named(share, verdict, undecided):
    first = {("stribeck",): fitted(1, 1, 2.0), ("presliding",): fitted(1, 1, 9.0)}
    weak = {("stribeck", n): fitted(1, 1, 1.0) for n in ("leakage_N", "valve_null_shift")}
    chosen = ("stribeck", "valve_null_shift")
    selection = selected(
        fitted(1, 1, 10.0), first | weak, (("stribeck",), chosen),
        contributions={"stribeck": 0.9, "valve_null_shift": share},
    )  # fmt: skip
    judgement = judge(selection, ())
    assert (judgement.verdict, judgement.undecided) == (verdict, undecided)


@pytest.mark.parametrize(
    ("ratio", "first", "undecided"),
    [
        (0.2, "stribeck", ()),  # 0.83 of the probability: a further effect, and sure
        (0.4, "stribeck", ("valve_null_shift",)),  # 0.71
        (0.4, "valve_null_shift", ()),  # enough for the one that closes most
    ],
)
def test_of_a_further_effect_more_is_asked(ratio, first, undecided):
    chosen, missed = ("stribeck", "valve_null_shift"), -np.log(ratio) / CRITERIA.sharpness
    fits = {
        ("stribeck",): fitted(1, 1, 2.0),
        chosen: fitted(1, 1, 1.0),
        ("leakage_N", "stribeck"): fitted(1, 1, 2.0**missed),
    }
    selection = selected(
        fitted(1, 1, 10.0), fits, (("stribeck",), chosen),
        contributions={first: 0.5, **dict.fromkeys(chosen, 0.4)},
    )  # fmt: skip
    judgement = judge(selection, ())
    assert (judgement.verdict, judgement.undecided) == (Verdict.EFFECT, undecided)


@pytest.mark.parametrize(("left", "expected"), [(4.9, 0.5), (5.1, 1.0)])
def test_a_model_whose_verdict_would_be_unknown_is_no_alternative(left, expected):
    """Its records fitted may look as good: what is held out tells."""
    after = fitted(1, 1, 1.0)
    other = replace(after, held_out=fitted(1, 1, with_gap(left)).train)
    fits = {("stribeck",): after, ("presliding",): other}
    judgement = judge(selected(fitted(1, 1, with_gap(10)), fits, ONE), ())
    assert judgement.probability[ONE[0]] == pytest.approx(0.97 * expected)


def test_the_best_guess_of_an_unknown_cause_has_little_probability():
    before, after = fitted(1, 1, 10), fitted(1, 1, 9)
    judgement = judge(selected(before, {ONE[0]: after}, ONE), ())
    assert judgement.verdict is Verdict.UNKNOWN
    assert judgement.probability == {ONE[0]: pytest.approx(0.08)}


@pytest.mark.parametrize(
    ("other", "expected"),
    [((1, 1, 1), 0.0), ((1, 1, 10), 1.0), ((1, 1, 10**0.5), 0.5), ((0.1, 1, 10**0.5), 0.5)],
)
def test_a_rival_misses_the_share_of_the_gain_that_it_lacks(other, expected):
    """What it gains in another balance does not count."""
    fits = {("stribeck",): fitted(1, 1, 1), ("hose",): fitted(*other)}
    selection = selected(fitted(1, 1, 10), fits, ONE)
    assert missed_gain(selection, ("stribeck",), ("hose",)) == pytest.approx(expected)


@pytest.mark.parametrize(("share", "expected"), [(0.2, 0.0), (0.4, 0.5), (0.6, 1.0), (None, 1.0)])
def test_beside_a_sensor_simulations_say_what_a_rival_misses(share, expected):
    best, other = ("backlash", "stribeck"), ("backlash", "hose")
    trials = {("backlash",): 0.6, best: 0.2} | ({} if share is None else {other: share})
    selection = selected(fitted(1, 1, 10), {}, (best,), refined={best: None}, trials=trials)
    assert missed_gain(selection, best, other) == pytest.approx(expected)


# Credibility.


def failing(*names, tolerances=2.0):
    value = 1.0 + 0.05 * tolerances
    return tuple(Check(name, value, 0.0, 1.0, 0.05, "1", False, "") for name in names)


def judged(verdict, left=0.0, excess=9.0):
    return Judgement(verdict, (), {}, left, np.array([1.0, excess, 1.0]), np.zeros(3))


@pytest.mark.parametrize(("excess", "expected"), [(5.5, True), (6.5, False)])
def test_a_gap_is_near_the_noise_up_to_six_times(excess, expected):
    assert near_noise(judged(Verdict.NONE, excess=excess)) is expected


@pytest.mark.parametrize(
    ("verdict", "left", "excess", "checks", "expected"),
    [
        (Verdict.EFFECT, 0.11, 9, failing("M"), Verdict.UNKNOWN),
        (Verdict.EFFECT, 0.09, 9, failing("M"), Verdict.EFFECT),
        (Verdict.AMBIGUOUS, 0.11, 9, failing("M"), Verdict.UNKNOWN),
        (Verdict.EFFECT, 0.2, 9, failing("S_P", tolerances=3.3), Verdict.UNKNOWN),
        (Verdict.EFFECT, 0.2, 9, failing("S_P", tolerances=2.7), Verdict.EFFECT),
        (Verdict.EFFECT, 0.2, 9, failing("k_P"), Verdict.EFFECT),
        (Verdict.EFFECT, 0.0, 5.5, failing("S_N/S_P"), Verdict.ABSORBED),
        (Verdict.EFFECT, 0.0, 6.5, failing("S_N/S_P"), Verdict.EFFECT),
        (Verdict.NONE, 0.0, 1.0, failing("M"), Verdict.ABSORBED),
        (Verdict.NONE, 0.0, 1.0, (), Verdict.NONE),
    ],
)
def test_parameters_that_the_axis_cannot_have_change_a_verdict(
    verdict, left, excess, checks, expected
):
    assert review_verdict(judged(verdict, left, excess), checks, EFFECTS)[0] is expected


@pytest.mark.parametrize(
    ("above", "below", "expected"),
    [
        (("S_N/S_P",), (), ("valve_mismatch",)),
        (("S_N/S_P", "k_N"), (), ("leakage_N", "valve_mismatch", "heat_transfer")),
        (("k_N",), ("S_N/S_P",), ("leakage_P", "valve_mismatch", "heat_transfer")),
        (("F_c",), (), ("constant_force", "pressure_sensor_bias")),
        (("S_P", "S_N"), (), ("supply_droop",)),
        (("S_P", "S_N", "map form"), (), ("flow_map_shape",)),
        (("S_P",), (), ()),
        (("V_N(0)",), (), ("hose",)),
        ((), ("V_N(0)",), ()),
        (("M", "flow map", "F_c"), (), ("constant_force", "pressure_sensor_bias", "elastic_load",
                                       "valve_null_shift")),
    ],
)  # fmt: skip
def test_failed_checks_name_what_the_parameters_may_have_absorbed(above, below, expected):
    checks = (*failing(*above), *failing(*below, tolerances=-2.0))
    assert absorbed_candidates(checks, EFFECTS) == expected


# Checks of parameters.


@pytest.fixture(scope="module")
def axis():
    """A bench with r T = 1 and simple numbers: parameters can be read off."""
    bench = Bench.__new__(Bench)
    known = {
        "r": 1.0, "T": 1.0, "S_P": 2.0, "S_N": 1.0, "stroke": 1.0, "datasheet": {"M_kg": 10.0},
        "valves": Valves(METERED, METERED),
    }  # fmt: skip
    for name, value in known.items():
        object.__setattr__(bench, name, value)
    return SimpleNamespace(bench=bench, flow=None)


def parameters(S_P=2.0, S_N=1.0, k_P=1.2, k_N=1.2, dead=0.1, M=10.0, F_c=(10.0, 10.0)):
    """Parameters (eq. 9) of an axis with these areas, exponents, dead length and friction."""
    length = 0.5 + dead
    return {
        "X_s1": S_P / k_P * length, "X_s2": S_P / k_P, "X_s3": S_P,
        "X_s4": S_N / k_N * length, "X_s5": S_N / k_N, "X_s6": S_N,
        "M": M, "F_c_plus": F_c[0], "F_c_minus": F_c[1],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("values", "failed"),
    [
        ({}, set()),
        # Areas: 1 % of geometry and 2 % of metering, together 2.24 %; their ratio to 1 %.
        ({"S_P": 2.044, "S_N": 1.022}, set()),
        ({"S_P": 2.046, "S_N": 1.023}, {"S_P", "S_N"}),
        ({"S_N": 1.009}, set()),
        ({"S_N": 1.011}, {"S_N/S_P"}),
        # Exponents: isothermal to adiabatic with a margin of 0.02, unequal by 0.25.
        ({"k_P": 1.41, "k_N": 1.41}, set()),
        ({"k_P": 1.43, "k_N": 1.41}, {"k_P"}),
        ({"k_P": 1.41, "k_N": 0.97}, {"k_N", "k_P-k_N"}),
        ({"k_P": 1.01, "k_N": 1.25}, set()),
        ({"k_P": 1.01, "k_N": 1.27}, {"k_P-k_N"}),
        # Dead length: none to a quarter of the stroke.
        ({"dead": 0.24}, set()),
        ({"dead": 0.26}, {"V_P(0)", "V_N(0)"}),
        ({"dead": -0.01}, {"V_P(0)", "V_N(0)"}),
        # Mass: 5 %.
        ({"M": 10.4}, set()),
        ({"M": 10.6}, {"M"}),
        # Friction: a factor of four between the directions.
        ({"F_c": (39.0, 10.0)}, set()),
        ({"F_c": (41.0, 10.0)}, {"F_c"}),
        ({"F_c": (5.0, -1.0)}, {"F_c"}),
        ({"F_c": (0.0, 0.0)}, set()),
    ],
)
def test_a_parameter_is_refused_beyond_its_tolerance(axis, values, failed):
    checks = check_parameters(axis, parameters(**values), {})
    assert {check.name for check in checks if not check.agrees} == failed


@pytest.mark.parametrize(("std", "agrees"), [(0.18, True), (0.15, False)])
def test_six_standard_deviations_are_allowed_beyond_the_tolerance(axis, std, agrees):
    checks = check_parameters(axis, parameters(M=11.5), {"M": std})
    assert {check.name: check.agrees for check in checks}["M"] is agrees


@pytest.mark.parametrize(
    ("rms", "scale", "misfit", "failed"),
    [
        (1.45, 1.0, 0.0019, set()),
        (1.55, 1.0, 0.0019, {"flow map"}),
        (1.0, 1.0, 0.0021, {"map form"}),
        (1.0, 1.5, None, {"flow scale"}),
    ],
)
def test_a_flow_map_is_refused_beyond_its_tolerance(axis, rms, scale, misfit, failed):
    checks = check_parameters(axis, parameters(), {}, FlowMapDeviation(rms, scale), misfit)
    assert {check.name for check in checks if not check.agrees} == failed


# Location.


@pytest.mark.parametrize(
    ("position", "expected"), [(0.65, Location.MEASUREMENT), (0.75, Location.FORCE)]
)
def test_a_sensor_is_to_blame_where_its_error_explains_clearly_more(position, expected):
    shares = {"mass_flow_P": 0.1, "mass_flow_N": 0.1, "force": 0.8}
    left = {"force": 1.0, "position": position}
    assert balance_of_gap(shares, Signatures(20.0, left)) is expected


@pytest.mark.parametrize(
    ("position", "expected"), [(1.1, Location.MEASUREMENT), (1.3, Location.FORCE)]
)
def test_hypotheses_with_two_free_signals_pay_for_the_second(position, expected):
    """A position error leaves more than two unknown flows do, but needs one signal only."""
    shares = {"mass_flow_P": 0.1, "mass_flow_N": 0.1, "force": 0.8}
    left = {"force": 9.0, "mass_flows": 1.0, "position": position}
    assert balance_of_gap(shares, Signatures(20.0, left)) is expected


def test_without_a_gap_there_is_no_location():
    shares = dict.fromkeys(("mass_flow_P", "mass_flow_N", "force"), 0.0)
    assert balance_of_gap(shares, Signatures(1.0, {})) is Location.NONE


@pytest.mark.parametrize(
    ("before", "position", "named"), [(100, 2.8, True), (100, 3.2, False), (20, 2.8, True),
                                      (17, 2.8, False)],
)  # fmt: skip
def test_a_sensor_that_explains_about_as_much_is_a_rival(before, position, named):
    left = {"force": 1.0, "position": position}
    assert bool(rival_sensor_effects(Signatures(before, left), EFFECTS)) is named
