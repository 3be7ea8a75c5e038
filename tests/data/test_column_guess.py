"""Columns of a log file: which channel each is, in which unit, counted from where."""

import numpy as np
import pytest

from pneumo_casadi.data.new_case import Cylinder, guess_columns
from pneumo_casadi.data.readers.column_guess import guess_channels, guess_unit


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


@pytest.mark.parametrize(("unit", "factor"), [("V", 1.0), ("mV", 1e3)])
def test_a_command_about_a_null_voltage_gets_its_offset_in_volts(unit, factor):
    t = np.arange(200) / 1000.0
    wave = np.sin(2 * np.pi * 10 * t)
    columns = {"t_s": t, f"valve_{unit}": factor * (5 + 5 * wave)}
    columns |= {"pA_bar": 3 + wave, "pB_bar": 3 - wave, "x_m": 0.1 * wave}
    guesses = guess_columns(columns, Cylinder(0.033, 0.019, 0.5, 7e5), {})
    offsets = {guess.channel: guess.offset for guess in guesses}
    assert (offsets["u_P"], offsets["u_N"]) == (-5.0, 5.0)
