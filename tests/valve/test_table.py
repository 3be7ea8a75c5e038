"""A flow map is refused where its numbers cannot be what they claim to be."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumo_casadi.errors import CaseError
from pneumo_casadi.valve import FlowMap, project_flow_map, read_flow_map

U = np.array([-1.0, -1.0, 1.0, 1.0])
P = np.array([1e5, 7e5, 1e5, 7e5])
Q = np.array([0.0, -4e-3, 3e-3, -1e-4])
HEADER = "u_V,p_Pa,q_m_kg_per_s\n"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"p": P / 1e5}, r"`p` is 1 Pa \(4 such points\); .* is it in bar"),
        ({"p": P - 1e5}, "gauge"),
        ({"q_m": Q * 1e3}, r"row 2: `q_m` is -4 kg/s.* NL/min or g/s"),
        ({"q_m": np.array([0, np.nan, 1e-3, 0])}, "row 2: `q_m` is nan"),
        ({"q_m": 0 * Q}, "zero at all 4 points"),
        ({"q_m": Q[:3]}, "`u` has 4 points but `q_m` has 3"),
        ({"u": np.array([-1.0, -1.0, np.inf, 1.0])}, "row 3: `u` is inf V"),
        ({"p_supply": 7.0}, "`p_supply` is 7 Pa.* is it in bar"),
        ({"p_supply": 6e5}, "exceeds the supply pressure .* gauge"),
        ({"p_supply": [7e5, 7e5]}, "one for each of the 4 points"),
        ({"p_ext": 1.0}, "`p_ext` is 1 Pa"),
        ({"u": np.zeros((2, 2))}, "flat array"),
        ({"u": [], "p": [], "q_m": []}, "no points"),
    ],
)
def test_a_wrong_value_is_named_with_its_unit_and_remedy(change, message):
    with pytest.raises(CaseError, match=message):
        FlowMap(**({"u": U, "p": P, "q_m": Q} | change))


def test_points_are_copied_and_read_only():
    q = Q.copy()
    table = FlowMap(U, P, q)
    q[0] = 1.0
    assert table.q_m[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        table.q_m[0] = 1.0


@given(st.permutations(range(12)))
def test_a_grid_is_found_in_any_order_of_its_points(order):
    u, p = (a.ravel()[list(order)] for a in np.meshgrid([-1.0, 0, 1], [1e5, 2e5, 3e5, 4e5]))
    table = FlowMap(u, p, 1e-9 * p * (1 + u))
    assert table.is_grid
    u_grid, p_grid, q = table.grid()
    np.testing.assert_array_equal(q, 1e-9 * p_grid * (1 + u_grid[:, None]))


@pytest.mark.parametrize("keep", [[0, 1, 2], [0, 1, 2, 2], [0, 1, 2, 3, 3]])
def test_missing_or_repeated_points_are_no_grid(keep):
    table = FlowMap(U[keep], P[keep], Q[keep])
    assert not table.is_grid
    with pytest.raises(CaseError, match="not a grid"):
        table.grid()


def test_selected_points_keep_their_rows_and_supplies():
    table = FlowMap(U, P, Q, p_supply=[7e5, 7e5, 8e5, 8e5]).select(U > 0)
    np.testing.assert_array_equal(table.rows, [3, 4])
    np.testing.assert_array_equal(table.p_supply, [8e5, 8e5])


def test_a_file_is_read_with_its_pressures(tmp_path: Path):
    path = tmp_path / "flow_map.csv.gz"
    path.write_bytes(gzip.compress((HEADER + "-1,100000,0\n1,700000,2e-3\n").encode()))
    table = read_flow_map(path, p_supply=7e5, p_ext=1e5)
    np.testing.assert_array_equal(table.q_m, [0.0, 2e-3])
    assert (table.p_supply, table.p_ext, table.source) == (7e5, 1e5, str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            HEADER + "-1,1e5,0\n1,7e5,fast\n",
            "line 3.*`q_m_kg_per_s`: 'fast' is no number",
        ),
        (HEADER + "-1,1e5,0\n\n1,7e5\n", "row 4: q_m_kg_per_s is empty"),
        (HEADER + "-1,1e5,0\n1,7,1e-3\n", "row 3: `p` is 7 Pa.* is it in bar"),
        (HEADER + "-1,1e5,0\n1,7e5,180\n", "row 3: `q_m` is 180 kg/s.* NL/min"),
        ("u_V,p_bar,q_m_kg_per_s\n1,1,1\n", "row 1: column p_Pa missing; found u_V, p_bar"),
        (HEADER, "no rows of data"),
        ("", "the file is empty"),
    ],
)
def test_a_bad_file_is_named_with_row_value_and_remedy(tmp_path: Path, text, message):
    path = tmp_path / "flow_map.csv"
    path.write_text(text)
    with pytest.raises(CaseError, match=message) as caught:
        read_flow_map(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(CaseError, match="no such file"):
        read_flow_map(tmp_path / "flow_map.csv")


@given(st.binary(max_size=200))
def test_arbitrary_bytes_raise_only_case_errors(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "bytes.csv"  # a folder for each takes longer than all
    path.write_bytes(content)
    with pytest.raises(CaseError):
        read_flow_map(path)


def test_the_closed_outlet_pressure_rises_from_exhaust_to_supply(spool_valve):
    view = project_flow_map(spool_valve())
    assert view.q_m.shape == (21, 25)
    assert np.all(np.diff(view.p_closed) > 0)
    # Pressure gain at null: equal leakage of both edges meets well above the mean pressure.
    assert 4e5 < view.p_closed[10] < 6.9e5


def columns_of(pressures, scatter=0.0, n_u=21):
    """Columns of a map with these nominal pressures, metered at each command with scatter."""
    u, p = np.meshgrid(np.linspace(-3, 3, n_u), pressures)
    p = p + scatter * np.random.default_rng(0).standard_normal(p.shape)
    return FlowMap(u.ravel(), p.ravel(), 1e-3 * u.ravel()).column_numbers.reshape(p.shape)


@pytest.mark.parametrize("scatter", [0.0, 200.0, 1000.0])
def test_measured_pressures_have_the_columns_of_the_nominal_ones(scatter):
    dense_at_the_ends = np.array([1.0, 1.1, 1.3, 2.0, 3.0, 4.0, 5.0, 6.0, 6.7, 6.9, 7.0]) * 1e5
    expected = np.repeat(np.arange(11)[:, None], 21, axis=1)
    np.testing.assert_array_equal(columns_of(dense_at_the_ends, scatter), expected)


def test_pressures_metered_twice_are_the_same_columns():
    nominal = np.linspace(1e5, 7e5, 7)
    upwards_and_down = columns_of(np.r_[nominal, nominal[::-1]], scatter=500.0)
    np.testing.assert_array_equal(upwards_and_down[:, 0], [*range(7), *range(6, -1, -1)])


def test_swept_pressures_have_columns_of_one_point_of_each_command():
    p = np.random.default_rng(0).uniform(1e5, 7e5, (21, 100))
    u = np.repeat(np.linspace(-3, 3, 21), 100)
    columns = FlowMap(u, p.ravel(), 1e-3 * u).column_numbers
    assert 90 < columns.max() + 1 < 120


def test_points_at_a_pressure_and_a_command_of_their_own_are_columns_of_their_own():
    u, p = np.random.default_rng(0).uniform([[-3], [1e5]], [[3], [7e5]], (2, 200))
    assert np.unique(FlowMap(u, p, 1e-3 * u).column_numbers).size == 200
    assert np.unique(FlowMap(np.ones(200), p, 1e-3 * u).column_numbers).size == 200


def test_a_flow_without_zero_has_no_closed_outlet_pressure():
    view = project_flow_map(FlowMap(U, P, [0.0, -4e-3, 3e-3, 1e-4]))
    assert view.p_closed[0] == 1e5
    assert np.isnan(view.p_closed[1])
