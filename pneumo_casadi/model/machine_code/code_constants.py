"""Numbers of generated C code kept apart from its instructions.

Models of two axes differ in their constants (supply pressure, stroke, dead volumes) and hardly in
their instructions. With the constants in a table of their own the instructions are compiled once
for all axes of one form, which takes seconds; a table is compiled and linked in a tenth of one.
"""

import re

#: Name of the table, and how the instructions declare it. Hidden, it is read without detour.
_TABLE = "pneumo_constants"
_DECLARATION = f'extern __attribute__((visibility("hidden"))) const double {_TABLE}[];\n'
#: A number as CasADi writes it where it is no whole one, or a large whole one.
_NUMBER = re.compile(r"(?<![\w.])(?:\d\.\d{16}e[+-]\d{2,3}|\d{3,}\.)(?![\w.])")
_COMMENT = re.compile(r"/\*.*?\*/")
#: Begin and end of the tables that CasADi writes: there C allows literal numbers only.
_STATIC, _END = "static const", ";"


def separate_constants(code: str) -> tuple[str, str]:
    r"""Return C code whose constants stand in a table, and the code of that table.

    Whole numbers below 100 stay: they belong to the formulas. Comments, which repeat the numbers,
    are left out.

    Parameters
    ----------
    code : str
        As CasADi generates it.

    Returns
    -------
    instructions, table : str
        To be compiled each by itself, and linked.

    Examples
    --------
    >>> instructions, table = separate_constants(" a0=7.2500000000000000e-01;\n a0=(2.*a0);")
    >>> print(instructions.split(";", 1)[1].strip())
    a0=pneumo_constants[0];
     a0=(2.*a0);
    >>> print(table)
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
    table = ", ".join([*places, "0."])  # C has no empty tables
    instructions = _DECLARATION + "\n".join(lines) + "\n"
    return instructions, f"const double {_TABLE}[] = {{{table}}};"
