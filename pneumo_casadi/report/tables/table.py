"""A table of text cells, and how numbers, intervals, symbols and units are written in it."""

import math
import re
from dataclasses import dataclass

from pneumo_casadi.effects import EFFECTS

#: SI unit -> unit of display and factor.
DISPLAY = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3)}
#: Prefixes of units by power of ten.
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
#: Units whose first symbol takes a prefix; not those of a power, as m³.
_PREFIXED = re.compile(r"(kg|N|V|Pa|m|s|J|W|rad)(?![²³\d])")
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SYMBOLS = {
    "F_c_plus": "F_c⁺",
    "F_c_minus": "F_c⁻",
    "psi_plus": "ψ⁺",
    "psi_minus": "ψ⁻",
    "phi": "φ",
}
#: Names of the catalogue that the field calls otherwise; the others are read without underscores.
_WORDS = {
    "stribeck": "Stribeck friction",
    "presliding": "presliding friction",
    "leakage_P": "leakage of chamber P",
    "leakage_N": "leakage of chamber N",
}
_NAMED = re.compile(rf"\b({'|'.join(_WORDS)})\b")
#: The effect before the name of one of its parameters.
_OWNER = re.compile(rf"\b({'|'.join(sorted(EFFECTS, key=len, reverse=True))})\.(?=[A-Za-z])")


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text cells.

    Parameters
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings; the first column is left-aligned, the others right.
    rows : tuple of tuple of str
        Cells.
    notes : tuple of str
        Lines below.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    @property
    def widths(self) -> tuple[int, ...]:
        """Width of each column in characters."""
        cells = zip(self.columns, *self.rows, strict=True)
        return tuple(max(map(len, column)) for column in cells)

    def without(self, *names: str) -> "Table":
        """Return the table without the named columns."""
        keep = [i for i, name in enumerate(self.columns) if name not in names]
        rows = tuple(tuple(row[i] for i in keep) for row in self.rows)
        return Table(self.title, tuple(self.columns[i] for i in keep), rows, self.notes)


def exponent_of(value: float) -> int:
    """Return the power of ten, a multiple of three, that is taken out of a value.

    Values from 0.01 to 9999 are read as they are.

    Examples
    --------
    >>> exponent_of(3.49e-9), exponent_of(16.9), exponent_of(0.0)
    (-9, 0, 0)
    """
    if value == 0 or 1e-2 <= abs(value) < 1e4:
        return 0
    return 3 * math.floor(math.log10(abs(value)) / 3)


def value_text(value: float, exponent: int = 0, decimals: int = 3) -> str:
    """Return a value divided by a power of ten.

    Examples
    --------
    >>> value_text(3.4879e-9, -9)
    '3.488'
    """
    return f"{value / 10.0**exponent:.{decimals}f}"


def interval_text(value: float, half: float | None, exponent: int = 0) -> str:
    """Return ``value ± half`` with two significant digits in the half width.

    Parameters
    ----------
    value : float
        Estimate.
    half : float or None
        Half width of the interval; infinite where nothing is known of it, None for no mention.

    Examples
    --------
    >>> interval_text(3.4879e-9, 3.01e-12, -9)
    '3.4879 ± 0.0030'
    >>> interval_text(16.9, float("inf"))
    '16.900 (no interval)'
    """
    if half is None or not math.isfinite(half) or half == 0:
        tail = "" if half is None else " ± 0" if half == 0 else " (no interval)"
        return value_text(value, exponent) + tail
    scaled = half / 10.0**exponent
    decimals = min(max(1 - math.floor(math.log10(scaled)), 0), 6)
    return f"{value_text(value, exponent, decimals)} ± {scaled:.{decimals}f}"


def with_symbols(text: str) -> str:
    """Return a text with the names of parameters as symbols of the equations.

    Examples
    --------
    >>> with_symbols("F_c_plus"), with_symbols("psi_minus_2"), with_symbols("M")
    ('F_c⁺', 'ψ⁻_2', 'M')
    >>> with_symbols("hose_volume.V")
    'hose: V'
    """
    text = _OWNER.sub(lambda owner: f"{cause_name(owner[1])}: ", text)
    text = re.sub(r"\bdiscovered\.(?=[A-Za-z])", "discovered term: ", text)
    for plain, symbol in _SYMBOLS.items():
        text = re.sub(rf"\b{plain}(?=\b|_\d)", symbol, text)
    return text


def cause_name(name: str) -> str:
    """Return the one name under which reports show an effect, whichever form of it is meant.

    Examples
    --------
    >>> cause_name("hose_volume"), cause_name("valve_dead_zone"), cause_name("one_of_your_own")
    ('hose', 'valve dead zone', 'one of your own')
    """
    known = EFFECTS.get(name)
    return plain(name if known is None else known.cause)


def plain(name: str) -> str:
    """Return a name of the catalogue, or several, in the words of the field.

    Examples
    --------
    >>> plain("stribeck + valve_dead_zone")
    'Stribeck friction + valve dead zone'
    """
    return _NAMED.sub(lambda effect: _WORDS[effect[1]], name).replace("_", " ")


def scaled_unit(unit: str, exponent: int) -> str:
    """Return a unit for values from which a power of ten, a multiple of three, was taken out.

    With a prefix where the unit takes one, otherwise with the power itself.

    Examples
    --------
    >>> scaled_unit("kg/Pa", -9), scaled_unit("V", -6), scaled_unit("m3", -6), scaled_unit("kg", 0)
    ('µg/Pa', 'µV', '10⁻⁶ m3', 'kg')
    """
    if exponent == 0:
        return unit
    first = _PREFIXED.match(unit)
    if first is not None:
        symbol, power = ("g", exponent + 3) if first[0] == "kg" else (first[0], exponent)
        if power in PREFIXES:
            return PREFIXES[power] + symbol + unit[first.end() :]
    return f"10{str(exponent).translate(SUPERSCRIPTS)} {unit}".rstrip()
