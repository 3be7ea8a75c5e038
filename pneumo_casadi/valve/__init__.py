"""Static flow of the servodistributor: the measured map and the models fitted to it."""

from pneumo_casadi.valve.choice.degree_selection import DegreeSelection, select_degrees
from pneumo_casadi.valve.choice.form_selection import (
    PAPER_DEGREES,
    FlowForm,
    FormError,
    FormSelection,
    Reason,
    choose_flow_form,
)
from pneumo_casadi.valve.data_sheet import iso6358_from_data_sheet
from pneumo_casadi.valve.flow_map import FlowMap, read_flow_map
from pneumo_casadi.valve.flow_model import (
    FlowModel,
    SonicConductances,
    edge_slopes,
    flow_function,
    sonic_conductances,
)
from pneumo_casadi.valve.flow_pair import (
    AnyFlowMap,
    AnyFlowModel,
    FlowMapPair,
    FlowPair,
    each_valve,
)
from pneumo_casadi.valve.iso6358 import FlowISO6358
from pneumo_casadi.valve.iso6358_fit import fit_iso6358, fit_iso6358_curve
from pneumo_casadi.valve.orifice import Orifice, fit_orifice, orifice_expression, orifice_flow
from pneumo_casadi.valve.polynomial_fit import fit_polynomials
from pneumo_casadi.valve.polynomials import FlowPolynomials
from pneumo_casadi.valve.projections import (
    Projections,
    ResidualMap,
    map_residuals,
    project_flow_map,
)
from pneumo_casadi.valve.spline import FlowSpline, fit_spline

__all__ = [
    "PAPER_DEGREES",
    "AnyFlowMap",
    "AnyFlowModel",
    "DegreeSelection",
    "FlowForm",
    "FlowISO6358",
    "FlowMap",
    "FlowMapPair",
    "FlowModel",
    "FlowPair",
    "FlowPolynomials",
    "FlowSpline",
    "FormError",
    "FormSelection",
    "Orifice",
    "Projections",
    "Reason",
    "ResidualMap",
    "SonicConductances",
    "choose_flow_form",
    "each_valve",
    "edge_slopes",
    "fit_iso6358",
    "fit_iso6358_curve",
    "fit_orifice",
    "fit_polynomials",
    "fit_spline",
    "flow_function",
    "iso6358_from_data_sheet",
    "map_residuals",
    "orifice_expression",
    "orifice_flow",
    "project_flow_map",
    "read_flow_map",
    "select_degrees",
    "sonic_conductances",
]
