"""Fits kept on disk: which study they belong to."""

from dataclasses import replace
from types import SimpleNamespace

from pneumo_casadi.data import InputHold, ProportionalController
from pneumo_casadi.diagnosis.prepare.fit_store import Store
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.effects.term.term import Term, term_effect


def test_kept_fits_of_another_term_of_one_name_are_not_taken(tmp_path):
    store = Store(tmp_path, "study")
    slopes = (("x", -150.0), ("x", -120.0), ("v", -150.0), ("x", -150.0))
    effects = [
        term_effect(Term("tight", ("force",), "1", driver, "line", {"slope": slope}))()
        for driver, slope in slopes
    ]
    *paths, same = (store._path([effect]) for effect in effects)
    assert len(set(paths)) == 3 and same == paths[0]


class Signals(frozenset):
    """Signals in a given order: that of a frozenset differs from process to process."""

    def __iter__(self):
        return iter(self.order)


def token_of(tmp_path, made, order=("a", "v"), **bench):
    signals = Signals(order)
    signals.order = order
    bench = replace(made.BENCH, **bench)
    object.__setattr__(bench, "signals", signals)
    axis = SimpleNamespace(bench=bench, parameters=made.true_axis().parameters)
    study = Study(axis, None, (), ())
    return Store.of(tmp_path, study).token


def test_kept_fits_are_those_of_the_same_signals_in_any_order(made, tmp_path):
    token = token_of(tmp_path, made)
    assert token == token_of(tmp_path, made, ("v", "a"))
    assert token != token_of(tmp_path, made, ("v", "F_load"))


def test_fits_are_kept_under_a_controller_of_ones_own(made, tmp_path):
    """Its `repr` is an address, another one in each process."""

    class Own(ProportionalController):
        __repr__ = object.__repr__

    controllers = [Own(4.0, 3.0), Own(4.0, 3.0)]
    first, second = (token_of(tmp_path, made, controller=each) for each in controllers)
    assert first == second


def test_kept_fits_are_those_of_one_criterion_and_of_records_at_their_times(sound_study, tmp_path):
    """What the metered map contradicts was not kept, and a drift is one over time."""
    stricter = replace(sound_study, criteria=replace(sound_study.criteria, map_ratio=1.05))
    (record,) = sound_study.held_out
    later, sampled = replace(record, t=record.t + 9.0), replace(record, hold=InputHold.LINEAR)
    moved = (replace(sound_study, held_out=(each,)) for each in (later, sampled))
    tokens = {Store.of(tmp_path, each).token for each in (sound_study, stricter, *moved)}
    assert len(tokens) == 4
