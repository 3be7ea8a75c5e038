"""Parameters: names and vectors are two views of one thing, and nothing changes in place."""

import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import Parameter, Parameters

NAMES = ("M", "f_v", "F_c_plus", "F_c_minus")
finite = st.floats(-1e6, 1e6)


@pytest.fixture
def p():
    return Parameters(
        [
            Parameter("M", 17.0, "kg", lower=0.0),
            Parameter("f_v", 0.0, "N s/m", lower=0.0, upper=100.0),
            Parameter("F_c", -2.0, "N", free=False),
        ]
    )


@given(st.lists(finite, min_size=4, max_size=4))
def test_a_vector_put_in_comes_out_again_in_order(values):
    p = Parameters(Parameter(n, 0.0, "N") for n in NAMES).with_values(values)
    np.testing.assert_array_equal(p.values, values)
    assert p.as_dict() == dict(zip(NAMES, values, strict=True))
    assert [p[n].value for n in NAMES] == values


@given(st.permutations(NAMES), st.sets(st.sampled_from(NAMES)))
def test_free_names_keep_the_order_of_the_collection(order, fixed):
    p = Parameters(Parameter(n, 1.0, "N") for n in order)
    held = p.fix(*fixed)
    assert held.free_names == tuple(n for n in order if n not in fixed)
    assert [n for n, free in zip(order, held.free_mask, strict=True) if free] == list(
        held.free_names
    )
    assert held.release(*fixed) == held.release_all() == p


def test_an_empty_selection_changes_nothing_and_all_has_a_name_of_its_own(p):
    assert p.fix() == p.release() == p
    assert p.fix_all().free_names == ()
    assert p.release_all().free_names == ("M", "f_v", "F_c")
    assert p.fix_all().release("F_c").free_names == ("F_c",)


def test_the_scale_is_the_size_of_the_value_unless_given(p):
    np.testing.assert_array_equal(p.scales, [17.0, 1.0, 2.0])
    assert Parameter("M", -3.0, "kg", scale=5.0).scale == 5.0


def test_a_new_value_keeps_the_scale_so_that_an_optimiser_s_units_stay(p):
    assert p.with_values({"M": 1.0})["M"].scale == 17.0


def test_copies_leave_the_original_alone(p):
    before = p.values
    p.with_values({"M": 1.0}), p.fix("M"), p.bounded("M", 1.0, 20.0)
    p.values[0] = 99.0
    np.testing.assert_array_equal(p.values, before)
    assert p.free_names == ("M", "f_v") and p["M"].lower == 0.0
    with pytest.raises(FrozenInstanceError):
        p["M"].value = 3.0
    with pytest.raises(FrozenInstanceError):
        p.items = ()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_no_number_is_refused_by_name_and_unit(p, value):
    with pytest.raises(ModelError, match=r"parameter M: -?(nan|inf) kg"):
        p.with_values({"M": value})


def test_a_value_outside_its_bounds_is_refused_with_value_bounds_and_unit(p):
    with pytest.raises(ModelError, match=r"f_v: 101 N s/m lies outside its bounds \[0, 100\]"):
        p.with_values({"f_v": 101.0})
    with pytest.raises(ModelError, match="outside its bounds"):
        p.bounded("M", 18.0, 20.0)
    with pytest.raises(ModelError, match="outside its bounds"):
        Parameter("a", 1.0, "N", lower=2.0, upper=0.0)


def test_a_scale_that_is_no_size_is_refused():
    for scale in (-1.0, np.inf, np.nan):
        with pytest.raises(ModelError, match="must be positive"):
            Parameter("M", 1.0, "kg", scale=scale)


def test_unknown_names_are_answered_with_those_that_exist(p):
    for call in (
        lambda: p["m"],
        lambda: p.fix("m"),
        lambda: p.with_values({"m": 1.0}),
        lambda: p.bounded("m", 0, 1),
        lambda: p.select(["m"]),
    ):
        with pytest.raises(ModelError, match="no parameter 'm'; there are M, f_v, F_c"):
            call()


@pytest.mark.parametrize("shape", [(2,), (4,), (3, 1), ()])
def test_a_vector_of_another_shape_is_refused(p, shape):
    with pytest.raises(ModelError, match="expected 3 values"):
        p.with_values(np.ones(shape))


def test_names_must_differ_also_when_collections_are_joined(p):
    with pytest.raises(ModelError, match="named twice: M"):
        p + Parameters([Parameter("M", 1.0, "kg")])
    joined = p + Parameters([Parameter("c", 1.0, "N/m")])
    assert joined.names == ("M", "f_v", "F_c", "c") and joined.index("c") == 3


def test_selection_follows_the_order_asked_for(p):
    assert p.select(["F_c", "M"]).names == ("F_c", "M")
    assert "M" in p and "m" not in p and len(p) == 3
    assert [item.unit for item in p] == list(p.units)


def test_pickling_keeps_everything(p):
    assert pickle.loads(pickle.dumps(p)) == p


def test_an_empty_collection_has_empty_vectors():
    empty = Parameters()
    assert len(empty) == 0 and empty.values.shape == empty.free_mask.shape == (0,)
    assert empty.free_mask.dtype == bool and empty + empty == empty
