"""Models to export, of every kind of axis and map, and inputs to compare trajectories with."""

import numpy as np
import pytest

from pneumo_casadi.effects import (
    Hose,
    PositionDelay,
    Presliding,
    PressureSensorBias,
    Stribeck,
    ValveDynamics,
)
from pneumo_casadi.export import IdentifiedModel

#: Nominal, with many effects and their states, with a map that CasADi holds as MX, by force.
KINDS = ("nominal", "effects", "spline", "force")
#: What is compared with the package: the nominal axis is that of the spline with another map.
COMPARED = ("effects", "spline", "force")
AMPLITUDE = {1: 40.0, 2: 0.6}


@pytest.fixture(scope="session")
def models(made) -> dict[str, IdentifiedModel]:
    effects = (
        ValveDynamics(),
        Presliding(),
        Hose(),
        PositionDelay(),
        PressureSensorBias(),
        Stribeck(),
    )
    axes = {
        "nominal": made.true_axis(),
        "effects": made.true_axis(*effects).at_starting_values(),
        "spline": made.spline_axis(),
        "force": made.true_force_axis(),
    }
    assert axes.keys() == set(KINDS)
    return {name: IdentifiedModel(axis, 1e-3, name) for name, axis in axes.items()}


@pytest.fixture(scope="session", params=COMPARED)
def model(request, models) -> IdentifiedModel:
    return models[request.param]


@pytest.fixture(scope="session")
def inputs():
    """Commands of a second, (1000, nu), that start off zero and keep the piston inside."""

    def make(model: IdentifiedModel) -> np.ndarray:
        nu = len(model.axis.inputs)
        wave = AMPLITUDE[nu] * np.sin(2 * np.pi * 2.3 * 1e-3 * np.arange(1000) + 0.5)
        return wave[:, None] * np.array([1.0, -0.9])[:nu]

    return make


@pytest.fixture(scope="session")
def deviation():
    """Largest difference of two signals over the range of the second."""

    def of(result, expected) -> float:
        return float(np.abs(np.asarray(result) - expected).max() / np.ptp(expected))

    return of
