"""References keep what they promise, whatever numbers a search tries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumo_casadi.design import COMMON, KINDS, Limits, Part
from pneumo_casadi.design.reference import make_reference
from pneumo_casadi.design.space import Space
from pneumo_casadi.errors import ModelError

ALL = tuple(name for name in KINDS if name != COMMON)
SPACE = Space(ALL, True, 6.0)


@given(st.lists(st.floats(0.0, 1.0), min_size=SPACE.start.size, max_size=SPACE.start.size))
@settings(max_examples=60)
def test_every_point_is_a_reference_within_reach(z):
    parts = SPACE.parts(z)
    reference = make_reference(parts, 1e-2, 600, 0.15, 0.3)
    assert reference.x_ref.shape == reference.common.shape == (600,)
    assert np.abs(reference.x_ref).max() <= 0.15 + 1e-6
    assert np.abs(reference.common).max() <= 0.3 + 1e-4
    motions = [part for part in parts if part.kind != COMMON]
    assert sum(part.share for part in motions) == pytest.approx(1.0)


def test_the_search_starts_from_the_papers_experiment():
    parts = SPACE.parts(SPACE.start)
    assert [(part.kind, part.share) for part in parts] == [("chirp", 0.5), ("squares", 0.5)]
    chirp, squares = (part.values for part in parts)
    assert chirp[1] == pytest.approx(2.0)  # from rest to 2 Hz
    assert squares[0] > squares[1]  # several amplitudes


def test_numbers_go_back_and_forth_between_values_and_shares():
    for kind in KINDS.values():
        for number in kind.numbers:
            assert number.at(number.share(number.start)) == pytest.approx(number.start)
            assert number.at(0.0) == pytest.approx(number.lower)
            assert number.at(1.0) == pytest.approx(number.upper)


def test_a_creep_is_folded_at_the_ends_and_keeps_its_speeds():
    reference = make_reference((Part("creep", 1.0, (0.01, 0.16)),), 1e-3, 12000, 0.05, 0.0)
    speed = np.abs(np.diff(reference.x_ref)) / 1e-3
    for expected in (0.01, 0.04, 0.16):
        share = np.mean(np.isclose(speed, expected, rtol=0.11, atol=1.1e-3))
        assert share > 0.25, expected


def test_a_chirp_ends_at_its_frequency():
    reference = make_reference((Part("chirp", 1.0, (1.0, 2.0)),), 1e-3, 10000, 0.1, 0.0)
    crossings = np.flatnonzero(np.diff(np.sign(reference.x_ref)) != 0)
    assert 1 / (2e-3 * np.diff(crossings)[-1]) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("kinds", [("waltz",), ()])
def test_an_unknown_kind_is_refused_with_those_there_are(kinds):
    with pytest.raises(ModelError, match="there are chirp, squares"):
        Space(kinds, False, 5.0)


def test_limits_without_room_are_refused():
    with pytest.raises(ModelError, match="velocity"):
        Limits(0.2, 0.0, 1e5, 7e5, 3.0)
    with pytest.raises(ModelError, match="pressure"):
        Limits(0.2, 0.5, 7e5, 1e5, 3.0)
