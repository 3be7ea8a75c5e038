"""What every report of an identification holds, whatever its form."""

from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.identifiability import identifiability_tables
from pneumo_casadi.report.tables.results import Table, tables_of


def all_tables(identification: Identification, paper: bool = False) -> tuple[Table, ...]:
    """Return all tables of an identification, identifiability last where it was asked for."""
    extra = (
        ()
        if identification.identifiability is None
        else identifiability_tables(identification.identifiability)
    )
    return (
        *tables_of(identification, paper),
        *flow_form_tables(identification.flow_selection),
        *extra,
    )
