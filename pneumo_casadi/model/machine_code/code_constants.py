"""Numbers of generated C code kept apart from its instructions.

Models of two axes differ in their constants (supply pressure, stroke, dead volumes) and hardly in
their instructions. With the constants in a table of their own the instructions are compiled once
for all axes of one form. A table is written into a copy of their library, where its format is known
to allow that, or else compiled and linked, which takes twenty times as long.
"""

import re
import struct
from dataclasses import dataclass

#: Name of the table, and how the instructions declare it. Hidden, it is read without detour.
_TABLE = "pneumo_constants"
_DECLARATION = f'extern __attribute__((visibility("hidden"))) const double {_TABLE}[];\n'
#: A number as CasADi writes it where it is no whole one, or a large whole one.
_NUMBER = re.compile(r"(?<![\w.])(?:\d\.\d{16}e[+-]\d{2,3}|\d{3,}\.)(?![\w.])")
_COMMENT = re.compile(r"/\*.*?\*/")
#: Begin and end of the tables that CasADi writes: there C allows literal numbers only.
_STATIC, _END = "static const", ";"
#: Bits of the first number of a table that is still to be filled; each further one has one more.
_BLANK = int.from_bytes(b"pneumo\0\0", "big")
#: How a library begins whose bytes may be changed. Others may be signed, as those of macOS are.
_CHANGEABLE = b"\x7fELF"


@dataclass(frozen=True, slots=True)
class ConstantTable:
    """Constants of generated code, in the order in which its instructions number them.

    Parameters
    ----------
    numbers : tuple of str
        As they stood in the code.
    """

    numbers: tuple[str, ...]

    @property
    def code(self) -> str:
        """C code of the table."""
        return f"const double {_TABLE}[] = {{{', '.join([*self.numbers, '0.'])}}};"

    @property
    def blank_code(self) -> str:
        """C code of a table of as many marks, which `filled` finds."""
        marks = ", ".join(f"{mark:#x}ULL" for mark in self._marks)
        return f"const unsigned long long {_TABLE}[] = {{{marks}}};"

    def filled(self, blank: bytes) -> bytes | None:
        """Return a library made with `blank_code` with the constants in it.

        None where its bytes must not be changed, or do not hold the marks just once.
        """
        size = len(self._marks)
        marks = struct.pack(f"={size}Q", *self._marks)
        if not blank.startswith(_CHANGEABLE) or blank.count(marks) != 1:
            return None
        return blank.replace(marks, struct.pack(f"={size}d", *map(float, self.numbers), 0.0))

    @property
    def _marks(self) -> range:
        return range(_BLANK, _BLANK + len(self.numbers) + 1)  # C has no empty tables


def separate_constants(code: str) -> tuple[str, ConstantTable]:
    r"""Return C code whose constants stand in a table, and the code of that table.

    Whole numbers below 100 stay: they belong to the formulas. Comments, which repeat the numbers,
    are left out.

    Parameters
    ----------
    code : str
        As CasADi generates it.

    Returns
    -------
    str, ConstantTable
        Instructions, to be compiled by themselves, and their constants.

    Examples
    --------
    >>> instructions, table = separate_constants(" a0=7.2500000000000000e-01;\n a0=(2.*a0);")
    >>> print(instructions.split(";", 1)[1].strip())
    a0=pneumo_constants[0];
     a0=(2.*a0);
    >>> print(table.code)
    const double pneumo_constants[] = {7.2500000000000000e-01, 0.};
    """
    places: dict[str, int] = {}

    def entry(match: re.Match[str]) -> str:
        return f"{_TABLE}[{places.setdefault(match[0], len(places))}]"

    lines = []
    literal = False
    for line in _COMMENT.sub("", code).splitlines():
        literal = literal or line.lstrip().startswith(_STATIC)
        lines.append(line if literal else _NUMBER.sub(entry, line))
        literal = literal and _END not in line
    instructions = _DECLARATION + "\n".join(lines) + "\n"
    return instructions, ConstantTable(tuple(places))
