"""Simulations of held-out records, and how far they are from what was measured."""

from pneumo_casadi.validation.errors import Error
from pneumo_casadi.validation.validate import Validation, validate

__all__ = ["Error", "Validation", "validate"]
