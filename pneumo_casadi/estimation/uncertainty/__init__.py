"""How sure an output-error fit is of what it found: profiles, bootstrap, identifiability."""

from pneumo_casadi.estimation.uncertainty.bootstrap import Bootstrap, IntervalKind, block_bootstrap
from pneumo_casadi.estimation.uncertainty.collinearity import (
    CollinearGroup,
    collinear_groups,
    correlated_clusters,
)
from pneumo_casadi.estimation.uncertainty.identifiability import (
    Direction,
    Identifiability,
    identifiability,
)
from pneumo_casadi.estimation.uncertainty.optimum import Optimum
from pneumo_casadi.estimation.uncertainty.profile import (
    Profile,
    profile_likelihood,
    profile_likelihoods,
)
from pneumo_casadi.estimation.uncertainty.profile_path import End
from pneumo_casadi.estimation.uncertainty.replicates import Replicate

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
