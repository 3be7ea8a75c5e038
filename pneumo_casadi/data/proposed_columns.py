"""What ``columns.json`` should say of a log file: channels, units and where they count from."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pneumo_casadi.data.checks.ranges import WIDESPREAD
from pneumo_casadi.data.cylinder import Cylinder
from pneumo_casadi.data.readers.column_guess import (
    ColumnGuess,
    counts_from_end,
    doubtful_lengths,
    guess_channels,
    guess_unit,
    looks_gauge,
    pressure_units,
    states_unit,
)
from pneumo_casadi.data.readers.recordings import WITHOUT_CLOCK
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

NEEDED = ("t", "p_P", "p_N", "x")
#: To which null voltages are rounded [V]: half the span of a command of 0 to 5 V is 2.5 V.
NULL_STEP = 0.5


def guess_columns(
    columns: Mapping[str, FloatArray],
    cylinder: Cylinder,
    stated: Mapping[str, tuple[str, str]],
) -> tuple[ColumnGuess, ...]:
    """Return what `columns.json` should say.

    Parameters
    ----------
    columns : mapping of str to (n,) array
        Columns of the file.
    cylinder : Cylinder
        Its stroke and ambient pressure turn gauge pressures and positions from one end into those
        of the package.
    stated : mapping of str to (str, str)
        Channels that the user has named: column, and unit or an empty text.

    Raises
    ------
    CaseError
        If a needed channel is not found, the message listing the columns of the file, or if a
        pressure may be in psi as well as in another unit.
    """
    channels = _channels(columns, stated)
    units = {channel: unit for channel, (_, unit) in stated.items() if unit}
    unstated = {c: name for c, name in channels.items() if c not in units}
    _refuse_doubtful_units(unstated, columns, cylinder)
    pressures = (cylinder.supply, cylinder.ambient)
    for channel, column in unstated.items():
        values = columns[column]
        units[channel] = guess_unit(channel, column, values, cylinder.stroke, *pressures)
    signals = {
        channel: _scale(channel, column, units[channel]) * columns[column]
        for channel, column in channels.items()
    }
    offsets = _offsets(signals, channels, cylinder)
    doubts = {
        channel: doubtful_lengths(columns[name], units[channel], cylinder.stroke)
        for channel, name in unstated.items()
        if UNITS[channel] == "m" and not states_unit(channel, name)
    }
    return tuple(
        guess
        for channel in sorted(channels, key=tuple(UNITS).index)
        for guess in _as_commands(
            ColumnGuess(
                channel,
                channels[channel],
                units[channel],
                offsets.get(channel, 0.0),
                doubts=doubts.get(channel, ()),
            )
        )
    )


def _channels(
    columns: Mapping[str, FloatArray], stated: Mapping[str, tuple[str, str]]
) -> dict[str, str]:
    """Return the column of each channel, those named by the user first."""
    names = {channel: column for channel, (column, _) in stated.items()}
    for channel, column in names.items():
        if column not in columns:
            raise CaseError(f"no column `{column}`; the file has {', '.join(columns)}")
        if channel not in UNITS:
            raise CaseError(f"no channel `{channel}`; there are {', '.join(UNITS)}")
    left = tuple(name for name in columns if name not in names.values())
    guessed = guess_channels(left)
    channels = {**{c: n for c, n in guessed.items() if c not in names}, **names}
    if {"u_P", "u_N"} & channels.keys():
        channels.pop("u", None)
    commanded = "u" in channels or {"u_P", "u_N"} <= channels.keys()
    missing = [c for c in NEEDED if c not in channels] + ([] if commanded else ["u"])
    if missing:
        free = [name for name in columns if name not in channels.values()] or ["NAME"]
        two = "; of two valves: --column u_P=NAME --column u_N=NAME" if "u" in missing else ""
        raise CaseError(
            f"no column was recognised as {', '.join(missing)}; the file has {', '.join(columns)}; "
            f"name it, as --column '{missing[0]}={free[0]}'{two}"
            + (WITHOUT_CLOCK if "t" in missing else "")
        )
    return channels


def _scale(channel: str, column: str, unit: str) -> float:
    """Return the SI value of a unit of a channel."""
    scale = SI_FACTORS[UNITS[channel]].get(unit)
    if scale is None:
        raise CaseError(
            f"--column {channel}={column}:{unit}: known units are "
            f"{', '.join(SI_FACTORS[UNITS[channel]])}"
        )
    return scale


def _refuse_doubtful_units(
    channels: Mapping[str, str], columns: Mapping[str, FloatArray], cylinder: Cylinder
) -> None:
    """Refuse pressures in psi or another unit, where neither their names nor their sizes tell.

    Units of powers of ten are told apart by size; pounds per square inch lie between them.
    """
    doubtful = {}
    for channel, column in channels.items():
        if UNITS[channel] == "Pa" and not states_unit(channel, column):
            highest = float(columns[column].max())
            units = pressure_units(highest, cylinder.supply, cylinder.ambient)
            if len(units) > 1 and "psi" in units:
                doubtful[channel] = (column, highest, units)
    if doubtful:
        column, highest, units = next(iter(doubtful.values()))
        sizes = [f"{1e-5 * SI_FACTORS['Pa'][unit] * highest:.3g} bar in {unit}" for unit in units]
        options = " ".join(f"--column '{c}={n}:psi'" for c, (n, _, _) in doubtful.items())
        raise CaseError(
            f"column `{column}` reaches {highest:.4g}, which is {' or '.join(sizes)}; state the "
            f"unit, as {options}"
        )


def _offsets(
    signals: Mapping[str, FloatArray], channels: Mapping[str, str], cylinder: Cylinder
) -> dict[str, float]:
    """Return what is added to channels in SI units that count from elsewhere than the package."""
    offsets: dict[str, float] = {}
    pressures = {channel for channel in signals if UNITS[channel] == "Pa"}
    # A logger has one kind of pressure sensors: values below ambient, more of them than a sensor
    # that starts or drops out shows, tell for all of them.
    shares = [np.mean(signals[c] < 0.9 * cylinder.ambient) for c in pressures]
    below = max(shares, default=0.0) > WIDESPREAD
    for channel in pressures:
        if cylinder.gauge or below or looks_gauge(channels[channel]):
            offsets[channel] = cylinder.ambient
    if counts_from_end(signals["x"], cylinder.stroke):
        # One sensor and one reference count from the same end.
        offsets |= dict.fromkeys({"x", "x_ref"} & signals.keys(), -cylinder.stroke / 2)
    commands = {"u", "u_P", "u_N"} & signals.keys()
    # 0 to 5 or 10 V about the null voltage, half of it. Both of two valves have one amplifier.
    if all(signals[channel].min() >= 0 for channel in commands):
        for channel in commands:
            offsets[channel] = -round(float(np.median(signals[channel])) / NULL_STEP) * NULL_STEP
    return offsets


def _as_commands(guess: ColumnGuess) -> tuple[ColumnGuess, ...]:
    """Return a guess, or those of both chambers from the one command that is logged."""
    return _opposed(guess) if guess.channel == "u" else (guess,)


def _opposed(command: ColumnGuess) -> tuple[ColumnGuess, ColumnGuess]:
    """Return the commands of both chambers from the one that is logged."""
    scale = SI_FACTORS["V"][command.unit]
    return (
        replace(command, channel="u_P"),
        replace(command, channel="u_N", scale=-scale, offset=-command.offset),
    )
