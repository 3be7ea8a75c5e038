"""Static flow of the servodistributor: the measured map and the models fitted to it."""

from pneumo_casadi.flow.iso6358 import FlowISO6358, fit_iso6358
from pneumo_casadi.flow.model import FlowModel, edge_slopes, flow_function
from pneumo_casadi.flow.orifice import Orifice, fit_orifice, orifice_expression, orifice_flow
from pneumo_casadi.flow.polynomial_fit import fit_polynomials
from pneumo_casadi.flow.polynomials import FlowPolynomials
from pneumo_casadi.flow.selection import DegreeSelection, select_degrees
from pneumo_casadi.flow.spline import FlowSpline, fit_spline
from pneumo_casadi.flow.table import FlowMap, read_flow_map
from pneumo_casadi.flow.views import Projections, ResidualMap, projections, residual_map

__all__ = [
    "DegreeSelection",
    "FlowISO6358",
    "FlowMap",
    "FlowModel",
    "FlowPolynomials",
    "FlowSpline",
    "Orifice",
    "Projections",
    "ResidualMap",
    "edge_slopes",
    "fit_iso6358",
    "fit_orifice",
    "fit_polynomials",
    "fit_spline",
    "flow_function",
    "orifice_expression",
    "orifice_flow",
    "projections",
    "read_flow_map",
    "residual_map",
    "select_degrees",
]
