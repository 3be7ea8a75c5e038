"""Terms that a diagnosis discovers: a formula over one driver in one balance, as an effect."""

from pneumo_casadi.effects.term.catalogue_file import read_catalogue
from pneumo_casadi.effects.term.formula import FORMULAS, Formula
from pneumo_casadi.effects.term.term import Term, term_effect
from pneumo_casadi.effects.term.term_file import read_term, write_term, write_term_source

__all__ = [
    "FORMULAS",
    "Formula",
    "Term",
    "read_catalogue",
    "read_term",
    "term_effect",
    "write_term",
    "write_term_source",
]
