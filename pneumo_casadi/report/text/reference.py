"""The paper whose equations, tables and figures reports quote."""

import re

_TITLE = '"Identification of physical parameters of a pneumatic servosystem", IFAC 2005'
#: Below a page, in which quotations end in "of [1]".
REFERENCE = f"[1] {_TITLE}; its equations, table and figures are those that this report refers to."
_QUOTED = re.compile(
    r"\b(eq\. \d+\b|Figs?\. \d(?: and \d)?|Table 1)(?: of the paper)?(?! of \[1\])"
)


def numbered(text: str) -> str:
    """Return a text whose quotations of the paper refer to [1].

    Examples
    --------
    >>> numbered("polynomials (eq. 12 of the paper)")
    'polynomials (eq. 12 of [1])'
    """
    return _QUOTED.sub(r"\1 of [1]", text)


def reference_line(text: str) -> str:
    """Return what the paper is, for the end of a plain text; empty where it is not quoted.

    Examples
    --------
    >>> reference_line("polynomials (eq. 12 of the paper)")
    'Equations, table and figures are those of "Identification of physical parameters of a \
pneumatic servosystem", IFAC 2005.'
    >>> reference_line("ISO 6358")
    ''
    """
    if _QUOTED.search(text) is None:
        return ""
    return f"Equations, table and figures are those of {_TITLE}."
