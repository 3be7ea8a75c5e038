"""Memory of results is lent, and comes back when nothing refers to it."""

import pickle
import weakref

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.model.machine_code.calls import ResultMemory, call_side_by_side

SHAPES = st.sampled_from([(1, 6), (2, 3), (4, 2)])


@given(st.lists(st.tuples(SHAPES, st.booleans(), st.integers(0, 5)), max_size=30))
def test_no_two_arrays_in_use_share_memory(asked):
    memory = ResultMemory()
    in_use = []
    for value, (shape, part, released) in enumerate(asked):
        array = memory.empty(shape)
        array[:] = value
        in_use.append((array.T[1:] if part else array, value))
        del array
        if released < len(in_use):
            del in_use[released]
        assert all((kept == its).all() for kept, its in in_use)


def test_what_is_released_serves_again():
    memory = ResultMemory()
    addresses = set()
    for _ in range(20):
        addresses.add(memory.empty((50, 40)).ctypes.data)
    assert len(addresses) == 1


def test_a_result_that_is_kept_does_not_keep_the_memory_of_others():
    memory = ResultMemory()
    kept, other = memory.empty((2, 3)), memory.empty((50, 40))
    gone = weakref.ref(memory)
    del memory, other
    assert gone() is None
    kept[:] = 1.0
    assert (kept == 1.0).all()


def test_what_is_free_goes_back_to_the_system_and_what_is_in_use_stays():
    memory = ResultMemory()
    kept, other = memory.empty((2, 3)), memory.empty((50, 40))
    kept[:] = 1.0
    del other
    memory.release()
    assert memory._free == {} and (kept == 1.0).all()
    del kept
    assert [len(arrays) for arrays in memory._free.values()] == [1]


def test_results_in_lent_memory_are_those_in_new_memory():
    x = ca.MX.sym("x", 3)
    f = ca.Function("f", [x], [x**2, ca.sum1(x)])
    memory = ResultMemory()
    for k in range(4):  # while one result is in use, the next one has other memory
        values = np.arange(600.0).reshape(3, 200) + k
        lent = call_side_by_side(f, values, memory=memory)
        np.testing.assert_array_equal(lent[0], values**2)
        np.testing.assert_array_equal(lent[1][0], values.sum(axis=0))


def test_another_process_has_memory_of_its_own():
    memory = ResultMemory()
    memory.empty((2, 2))
    assert pickle.loads(pickle.dumps(memory))._free == {}
