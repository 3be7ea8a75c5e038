"""How sure an output-error fit is of what it found: profiles, bootstrap, identifiability."""

from pneumo_casadi.uncertainty.bootstrap import Bootstrap, IntervalKind, block_bootstrap
from pneumo_casadi.uncertainty.collinearity import (
    CollinearGroup,
    collinear_groups,
    correlated_clusters,
)
from pneumo_casadi.uncertainty.identifiability import Direction, Identifiability, identifiability
from pneumo_casadi.uncertainty.optimum import Optimum
from pneumo_casadi.uncertainty.profile import (
    Profile,
    profile_likelihood,
    profile_likelihoods,
)
from pneumo_casadi.uncertainty.replicates import Replicate
from pneumo_casadi.uncertainty.walk import End

__all__ = [
    "Bootstrap",
    "CollinearGroup",
    "Direction",
    "End",
    "Identifiability",
    "IntervalKind",
    "Optimum",
    "Profile",
    "Replicate",
    "block_bootstrap",
    "collinear_groups",
    "correlated_clusters",
    "identifiability",
    "profile_likelihood",
    "profile_likelihoods",
]
