"""Static flow of the servodistributor: the measured map and the models fitted to it."""

from pneumo_casadi.flow.model import FlowModel, flow_function
from pneumo_casadi.flow.polynomial_fit import fit_polynomials
from pneumo_casadi.flow.polynomials import FlowPolynomials
from pneumo_casadi.flow.table import FlowMap, read_flow_map

__all__ = [
    "FlowMap",
    "FlowModel",
    "FlowPolynomials",
    "fit_polynomials",
    "flow_function",
    "read_flow_map",
]
