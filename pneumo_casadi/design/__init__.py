"""Design of the next experiment: references for small errors, or to tell effects apart."""

from pneumo_casadi.design.criterion import Criterion
from pneumo_casadi.design.experiment import Limits
from pneumo_casadi.design.next_experiment import NONE, ExperimentRequest, design_experiment
from pneumo_casadi.design.options import DesignOptions, default_limits, recorded_reference
from pneumo_casadi.design.precision import design_for_precision
from pneumo_casadi.design.reference import COMMON, KINDS, Part, Reference
from pneumo_casadi.design.result import Design, Distance, Precision
from pneumo_casadi.design.separation import design_to_separate

__all__ = [
    "COMMON",
    "KINDS",
    "NONE",
    "Criterion",
    "Design",
    "DesignOptions",
    "Distance",
    "ExperimentRequest",
    "Limits",
    "Part",
    "Precision",
    "Reference",
    "default_limits",
    "design_experiment",
    "design_for_precision",
    "design_to_separate",
    "recorded_reference",
]
