"""Which column of a file is which channel, and in which unit: guessed from names and magnitudes.

A guess is a proposal: it is shown to the user, and the checks of the case tell where it is wrong.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pneumo_casadi.data.bench.quantities import (
    CHARGED,
    COMPRESSION,
    PRESSURES,
    USUAL_AMBIENT,
    USUAL_SUPPLY,
)
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS, column_name
from pneumo_casadi.parameters import FloatArray

#: Names that loggers use, lower case without separators, by channel; tried in this order.
NAMES: Mapping[str, str] = {
    "x_ref": r"xref|xd|xset|ref(erence)?|set(point)?|soll(wert)?|target|xsoll|desired|w",
    "p_supply": r"p?(supply|sup)|ps|p0|versorgung",
    "F_load": r"f?load(cell)?|kraft|force|fl",
    "t": r"t|time|times|timestamp|zeit|ms|us|s|sec|seconds?|clock",
    "p_P": r"pp|pa|p1|pressurea|pressure1|pcap|druck1|drucka|chambera",
    "p_N": r"pn|pb|p2|pressureb|pressure2|prod|druck2|druckb|chamberb",
    "u_P": r"up|ua|u1|valvea|valve1|cmda|cmd1|commanda|command1",
    "u_N": r"un|ub|u2|valveb|valve2|cmdb|cmd2|commandb|command2",
    "u": r"u|valve|cmd|command|spool|voltage|volt|uv|ventil|control(signal)?",
    "x": r"x|pos(ition)?|xpos|weg|disp(lacement)?|y|stroke|piston",
    "v": r"v|vel(ocity)?|speed|xdot|dx",
    "a": r"a|acc(eleration)?|ddx|xddot",
}
UNIT_NAMES = {unit.lower(): unit for factors in SI_FACTORS.values() for unit in factors}
#: Longest name that is searched for a unit: the search takes the third power of the length.
LONGEST = 100
GAUGE_NAMES = ("barg", "bar_g", "gauge", "rel", "relativ")


@dataclass(frozen=True, slots=True)
class ColumnGuess:
    """Proposal for one channel.

    Parameters
    ----------
    channel : str
        Symbol.
    column : str
        Name in the file.
    unit : str
        Unit of the column.
    offset : float
        Added last [SI].
    scale : float, optional
        In place of the unit: −1 for the opposite command.
    doubts : tuple of (str, float), optional
        Units that it may be in as far as its size tells, the guessed one first, and the travel of a
        position in each [m]; empty where name or size leave no doubt.
    """

    channel: str
    column: str
    unit: str
    offset: float = 0.0
    scale: float | None = None
    doubts: tuple[tuple[str, float], ...] = ()

    @property
    def entry(self) -> dict[str, Any]:
        """The entry of ``columns.json``, as short as it can be."""
        entry: dict[str, Any] = {"column": self.column}
        if self.scale is not None:
            entry["scale"] = self.scale
        elif self.unit != UNITS[self.channel]:
            entry["unit"] = self.unit
        entry |= {"offset": float(f"{self.offset:.10g}")} if self.offset else {}
        return {column_name(self.channel): self.column if len(entry) == 1 else entry}


def guess_channels(names: tuple[str, ...]) -> dict[str, str]:
    """Return the column that each channel is read from, as far as names tell.

    Examples
    --------
    >>> guess_channels(("time [ms]", "valve", "pA_bar", "pB_bar", "pos (mm)", "note"))
    {'t': 'time [ms]', 'u': 'valve', 'p_P': 'pA_bar', 'p_N': 'pB_bar', 'x': 'pos (mm)'}
    """
    channels: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^a-z0-9]", "", _without_unit(name)[0].lower())
        for channel, pattern in NAMES.items():
            if channel not in channels and re.fullmatch(pattern, plain):
                channels[channel] = name
                break
    return channels


def guess_unit(
    channel: str,
    name: str,
    values: FloatArray,
    stroke: float,
    supply: float = USUAL_SUPPLY,
    ambient: float = USUAL_AMBIENT,
) -> str:
    """Return the unit of a column: that in its name, or one that makes its size plausible.

    Parameters
    ----------
    channel : str
        Symbol.
    name : str
        Name of the column.
    values : (n,) array
        Its values.
    stroke : float
        Length of the stroke [m].
    supply, ambient : float, optional
        Pressures of the axis, absolute [Pa].

    Examples
    --------
    >>> guess_unit("p_P", "pA", np.array([2.5, 6.1]), 0.5)
    'bar'
    >>> guess_unit("x", "pos", np.array([12.0, 480.0]), 0.5)
    'mm'
    """
    si = UNITS[channel]
    known = SI_FACTORS.get(si, {si: 1.0})
    stated = _without_unit(name)[1]
    if stated in known:
        return stated
    if channel == "t":
        return _unit_of_time(values)
    if si == "Pa":
        highest = float(np.max(values))
        units = pressure_units(highest, supply, ambient)
        return units[0] if len(units) == 1 else _unit_of_pressure(highest)
    if si == "m":
        return "mm" if float(np.max(np.abs(values))) > 2 * stroke else "m"
    return si


def doubtful_lengths(values: FloatArray, unit: str, stroke: float) -> tuple[tuple[str, float], ...]:
    """Return the guessed unit of a position, larger ones that fit the stroke too, and the travels.

    Parameters
    ----------
    values : (n,) array
        The column.
    unit : str
        Guessed unit.
    stroke : float
        Length of the stroke [m].

    Examples
    --------
    >>> doubtful_lengths(np.array([18.0, 28.0]), "mm", 0.4)
    (('mm', 0.01), ('cm', 0.1))
    >>> doubtful_lengths(np.array([18.0, 280.0]), "mm", 0.4)
    ()
    """
    travel, scales = float(np.ptp(values)), SI_FACTORS["m"]
    larger = [
        other
        for other in sorted(scales, key=lambda name: scales[name])
        if scales[other] > scales[unit] and within_stroke(scales[other] * values, stroke)
    ]
    units = [unit, *larger] if larger else []
    return tuple((name, float(f"{scales[name] * travel:.3g}")) for name in units)


def within_stroke(x: FloatArray, stroke: float) -> bool:
    """Return whether a position [m] may count from mid-stroke, or from one end of the stroke."""
    return bool(x.max() <= (1.02 if counts_from_end(x, stroke) else 0.52) * stroke) and bool(
        x.min() >= -0.52 * stroke
    )


def counts_from_end(x: FloatArray, stroke: float) -> bool:
    """Return whether a position [m] counts from one end of the stroke, to 2 % of it."""
    return bool(x.min() > -0.02 * stroke and x.max() > 0.52 * stroke)


def pressure_units(highest: float, supply: float, ambient: float) -> tuple[str, ...]:
    """Return the units in which the highest pressure of an axis has this size, if any.

    It may be gauge, and then as low as the share of the supply that a moving axis exceeds.

    Parameters
    ----------
    highest : float
        Largest value of the column.
    supply, ambient : float
        Pressures of the axis, absolute [Pa].

    Examples
    --------
    >>> pressure_units(6.1, 7e5, 1e5), pressure_units(90.0, 7e5, 1e5)
    (('bar',), ('kPa', 'psi'))
    """
    least, most = CHARGED * (supply - ambient), COMPRESSION * supply
    units = ("Pa", *PRESSURES)
    return tuple(unit for unit in units if least <= SI_FACTORS["Pa"][unit] * highest <= most)


def states_unit(channel: str, name: str) -> bool:
    """Return whether the name of a column says in which unit the channel is."""
    return _without_unit(name)[1] in SI_FACTORS.get(UNITS[channel], {})


def looks_gauge(name: str) -> bool:
    """Return whether a name says that a pressure is relative to ambient."""
    return any(word in name.lower() for word in GAUGE_NAMES)


def _without_unit(name: str) -> tuple[str, str]:
    """Return a name without the unit at its end, and that unit or an empty text.

    Of a field of a MAT struct, as ``log.pA``, the last part is the name.
    """
    if len(name) > LONGEST:
        return name, ""
    field = re.fullmatch(r"(?:[A-Za-z_]\w*\.)+(.+)", name)
    name = field[1] if field else name
    whole = re.sub(r"[^a-z0-9]", "", name.lower())
    forms = (form for channel, form in NAMES.items() if channel != "t")
    if "_" in name and any(re.fullmatch(form, whole) for form in forms):
        return name, ""  # u_N is a command, and no u in newtons
    match = re.fullmatch(r"(.*?)[\s_\-]*[\[(/_\s]\s*([A-Za-zµ]+\d?)\s*[\])]?", name)
    if match and match[1]:
        unit = match[2].lower().removesuffix("g") if looks_gauge(match[2]) else match[2].lower()
        if unit in UNIT_NAMES:
            return match[1], UNIT_NAMES[unit]
    plain = name.strip().lower()
    return (name, plain) if plain in ("ms", "us") else (name, "")


def _unit_of_time(values: FloatArray) -> str:
    step = float(np.median(np.diff(values)))
    # Loggers of servo axes run between 100 Hz and 20 kHz: 50 µs to 10 ms a row.
    return next((unit for unit, s in (("s", 1.0), ("ms", 1e-3)) if step * s <= 0.02), "us")


def _unit_of_pressure(highest: float) -> str:
    """Return the unit in which the highest pressure of an axis, 2 to 12 bar, has this size."""
    if highest < 1.5:
        return "MPa"
    if highest < 30.0:
        return "bar"
    return "kPa" if highest < 5e3 else "Pa"
