"""Uncertainty of an output-error fit: profile likelihood, bootstrap, identifiability."""

from pneumo_casadi.estimation.uncertainty.bootstrap import Bootstrap, IntervalKind, block_bootstrap
from pneumo_casadi.estimation.uncertainty.collinearity import (
    CollinearGroup,
    collinear_groups,
    correlated_clusters,
)
from pneumo_casadi.estimation.uncertainty.identifiability import (
    Direction,
    Identifiability,
    analyse_identifiability,
)
from pneumo_casadi.estimation.uncertainty.optimum import Optimum
from pneumo_casadi.estimation.uncertainty.profile import (
    Profile,
    profile_likelihood,
    profile_likelihoods,
)
from pneumo_casadi.estimation.uncertainty.profile_path import ProfileEnd
from pneumo_casadi.estimation.uncertainty.replicates import Replicate

__all__ = [
    "Bootstrap",
    "CollinearGroup",
    "Direction",
    "Identifiability",
    "IntervalKind",
    "Optimum",
    "Profile",
    "ProfileEnd",
    "Replicate",
    "analyse_identifiability",
    "block_bootstrap",
    "collinear_groups",
    "correlated_clusters",
    "profile_likelihood",
    "profile_likelihoods",
]
