"""Columns of a log file: which channel each is, in which unit, counted from where."""

import numpy as np
import pytest

from pneumo_casadi.data.cylinder import Cylinder
from pneumo_casadi.data.proposed_columns import guess_columns
from pneumo_casadi.data.readers.column_guess import guess_channels, guess_unit
from pneumo_casadi.errors import CaseError


def test_columns_named_by_symbol_are_that_channel_and_not_one_in_newtons():
    names = ("t", "u_P", "u_N", "p_P", "p_N", "x")
    assert guess_channels(names) == {name: name for name in names}
    assert guess_channels(("log.u_P", "log.u_N")) == {"u_P": "log.u_P", "u_N": "log.u_N"}
    assert guess_unit("u_N", "u_N", np.array([-3.0, 3.0]), 0.5) == "V"


@pytest.mark.parametrize(
    ("channel", "name", "unit"),
    [("u_N", "u_N_mV", "mV"), ("F_load", "force_N", "N"), ("x", "x_mm", "mm"), ("t", "t_ms", "ms")],
)
def test_a_unit_behind_a_name_is_still_read(channel, name, unit):
    assert guess_channels((name,)) == {channel: name}
    assert guess_unit(channel, name, np.array([0.0, 1.0]), 0.5) == unit


CYLINDER = Cylinder(0.033, 0.019, 0.5, 7e5)
WAVE = np.sin(2 * np.pi * 0.05 * np.arange(200))
PLAIN = {
    "t_s": np.arange(200) / 1000.0,
    "u": WAVE,
    "pA_bar": 4 + WAVE,
    "pB_bar": 4 - WAVE,
    "x_m": 0.1 * WAVE,
}


def guessed(cylinder=CYLINDER, stated=None, without=(), **columns):
    kept = {name: values for name, values in PLAIN.items() if name not in without}
    guesses = guess_columns(kept | columns, cylinder, stated or {})
    return {guess.channel: guess for guess in guesses}


def test_one_pressure_below_ambient_tells_that_all_are_gauge():
    file = {"pA_bar": 2.6 + 2.4 * WAVE, "pB_bar": 3.5 + 2 * WAVE, "ps_bar": np.full(200, 6.0)}
    gauge, absolute = guessed(**file), guessed(**{name: 1 + p for name, p in file.items()})
    for channel in ("p_P", "p_N", "p_supply"):
        assert (gauge[channel].offset, absolute[channel].offset) == (101325.0, 0.0)
    starting = {
        **{name: 1 + p for name, p in file.items()},
        "ps_bar": np.r_[0, 0, 7 + 0 * WAVE[2:]],
    }
    assert guessed(**starting)["p_P"].offset == 0.0


def test_a_null_voltage_is_rounded_to_half_a_volt_and_found_for_two_valves():
    assert guessed(u=2.52 + 2 * WAVE)["u_P"].offset == -2.5
    two = guessed(without=("u",), u_P=5.1 + 4 * WAVE, u_N=4.9 - 4 * WAVE)
    assert (two["u_P"].offset, two["u_N"].offset) == (-5.0, -5.0)
    stroke = np.repeat([0.0, 3.0], 100)
    open_loop = guessed(without=("u",), u_P=stroke, u_N=-stroke)
    assert (open_loop["u_P"].offset, open_loop["u_N"].offset) == (0.0, 0.0)


def test_the_unit_is_asked_for_where_pressures_may_be_in_psi():
    without = ("pA_bar", "pB_bar")
    psi = {"pA": 60 + 30 * WAVE, "pB": 60 - 30 * WAVE}
    with pytest.raises(
        CaseError, match=r"`pA` reaches 90, which is 0\.9 bar in kPa or 6\.21 .*psi"
    ):
        guessed(without=without, **psi)
    stated = {"p_P": ("pA", "psi"), "p_N": ("pB", "psi")}
    assert guessed(without=without, stated=stated, **psi)["p_N"].unit == "psi"
    low = {name: p / 2 for name, p in psi.items()}  # 45 kPa would hardly move the axis
    assert guessed(without=without, **low)["p_P"].unit == "psi"
    kPa = {name: 5 * p for name, p in psi.items()}
    assert guessed(without=without, **kPa)["p_P"].unit == "kPa"


@pytest.mark.parametrize(("unit", "factor"), [("V", 1.0), ("mV", 1e3)])
def test_a_command_about_a_null_voltage_gets_its_offset_in_volts(unit, factor):
    t = np.arange(200) / 1000.0
    wave = np.sin(2 * np.pi * 10 * t)
    columns = {"t_s": t, f"valve_{unit}": factor * (5 + 5 * wave)}
    columns |= {"pA_bar": 3 + wave, "pB_bar": 3 - wave, "x_m": 0.1 * wave}
    guesses = guess_columns(columns, Cylinder(0.033, 0.019, 0.5, 7e5), {})
    offsets = {guess.channel: guess.offset for guess in guesses}
    assert (offsets["u_P"], offsets["u_N"]) == (-5.0, 5.0)
