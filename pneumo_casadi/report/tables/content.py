"""What every report of an identification holds, whatever its form."""

from pneumo_casadi.identification.result import Identification
from pneumo_casadi.report.tables.flow_form import flow_form_tables
from pneumo_casadi.report.tables.identifiability import identifiability_tables
from pneumo_casadi.report.tables.parameters import parameter_table, record_table
from pneumo_casadi.report.tables.table import Table
from pneumo_casadi.report.tables.validation import validation_table


def all_tables(identification: Identification, paper: bool = False) -> tuple[Table, ...]:
    """Return all tables of an identification, identifiability last where it was asked for."""
    tables = [parameter_table(identification, paper)]
    if identification.each_record is not None:
        tables.append(record_table(identification))
    if identification.validation is not None:
        tables.append(validation_table(identification.validation))
    tables += flow_form_tables(identification.flow_selection)
    if identification.identifiability is not None:
        tables += identifiability_tables(identification.identifiability)
    return tuple(tables)
