"""Values, shares and intervals as text."""

import math

from pneumo_casadi.diagnosis import Closure, Value
from pneumo_casadi.report.tables.table import SUPERSCRIPTS, exponent_of, interval_text, scaled_unit

#: SI unit -> unit of display and factor.
DISPLAY_UNITS = {
    "m": ("mm", 1e3),
    "m/s": ("mm/s", 1e3),
    "m2": ("cm²", 1e4),
    "m3": ("cm³", 1e6),
    "m³": ("cm³", 1e6),
    "s": ("ms", 1e3),
    "Pa": ("kPa", 1e-3),
    "kg/s": ("g/s", 1e3),
    "m³/(s Pa)": ("l/(s bar)", 1e8),
    "m³/(s Pa V)": ("l/(s bar V)", 1e8),
    "1/V": ("%/V", 1e2),
    "N s2/m2": ("N s²/m²", 1.0),
    "1": ("", 1.0),
}


def quantity(value: Value, held: str = " (not fitted)") -> str:
    """Return a value ± 2σ in a unit of convenient size.

    Parameters
    ----------
    value : Value
        In SI units.
    held : str, optional
        What is added to a value that has no standard deviation.

    Examples
    --------
    >>> quantity(Value(0.0213, 0.0004, "m/s"))
    '21.30 ± 0.80 mm/s'
    >>> quantity(Value(3.49e-9, 0.0, "kg/Pa"))
    '3.490 µg/Pa (not fitted)'
    >>> quantity(Value(6.69e-4, 4.365e-4, "V"))
    '669 ± 873 µV'
    >>> quantity(Value(0.0, 4.7, "N s/m", at_bound=True))
    '0 N s/m (at its bound)'
    """
    if value.at_bound:
        return f"{short_quantity(value)} (at its bound)"
    unit, factor = DISPLAY_UNITS.get(value.unit, (value.unit, 1.0))
    # The larger of value and half width is read: with a common power of ten neither is lost.
    largest = max(abs(value.value), 2 * value.std if math.isfinite(value.std) else 0.0)
    exponent = exponent_of(largest * factor)
    if exponent == -3 and not unit:
        exponent = 0  # a number without a unit has no prefix: 0.0087, not 8.7·10⁻³
    if exponent:
        own = exponent_of(largest)
        prefixed = scaled_unit(value.unit, own)
        if not prefixed.startswith("10"):
            unit, factor, exponent = prefixed, 10.0**-own, 0
    size, half = value.value * factor, 2 * value.std * factor
    text = interval_text(size, math.inf if math.isnan(half) else half or None, exponent)
    if exponent:
        power = f"·10{str(exponent).translate(SUPERSCRIPTS)}"
        text = f"({text}){power}" if half else f"{text}{power}"
    return f"{text} {unit}".rstrip() + ("" if half else held)


def short_quantity(value: Value) -> str:
    """Return a value with three digits, without its interval.

    Examples
    --------
    >>> short_quantity(Value(9.63013e-3, 3e-7, "m"))
    '9.63 mm'
    """
    unit, factor = DISPLAY_UNITS.get(value.unit, (value.unit, 1.0))
    return f"{value.value * factor:.3g} {unit}".rstrip()


def percent(value: float) -> str:
    """Return per cent with two significant digits, or whole numbers from 10 on.

    Examples
    --------
    >>> percent(0.0011), percent(3.14), percent(31.4), percent(314.0), percent(1e-7)
    ('0.0011 %', '3.1 %', '31 %', '314 %', '0 %')
    """
    return f"{value:.0f} %" if abs(value) >= 9.95 else f"{_small(value)} %"


def _small(value: float) -> str:
    return "0" if abs(value) < 5e-5 else f"{value:#.2g}"


def chance(probability: float) -> str:
    """Return a probability in whole per cent, never as 0 or 100 %.

    Examples
    --------
    >>> chance(0.974), chance(1e-9), chance(0.9999)
    ('97 %', '< 1 %', '> 99 %')
    """
    if probability < 0.01:
        return "< 1 %"
    return "> 99 %" if probability > 0.99 else f"{100 * probability:.0f} %"


def between(closure: Closure) -> str:
    """Return the interval of a closure in whole per cent.

    Examples
    --------
    >>> between(Closure(0.9, 0.874, 0.926))
    '87 to 93 %'
    >>> between(Closure(0.996, 0.995, 0.997))
    '99.5 to 99.7 %'
    """
    ends = whole(closure.lower), whole(closure.upper)
    if closure.lower > 0.9 and (ends[0] == ends[1] or "." in "".join(ends)):
        return f"{100 * closure.lower:.1f} to {100 * closure.upper:.1f} %"
    return f"{whole(closure.lower).removesuffix(' %')} to {whole(closure.upper)}"


def whole(share: float) -> str:
    """Return a share in whole per cent.

    Examples
    --------
    >>> whole(-0.001), whole(0.996)
    ('0 %', '99.6 %')
    """
    if 0.995 <= share < 0.9995:  # not all of it
        return f"{100 * share:.1f} %"
    return f"{round(100 * share)} %"
