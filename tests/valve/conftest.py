"""Flow maps for the tests: a made-up valve of known truth, the table1 valve, Enfield curves."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from pneumo_casadi.valve import FlowMap, orifice_flow, read_flow_map

P_SUPPLY, P_EXT = 7e5, 1e5
PSI = 6894.757
# The curves carry no flow unit. Read as SCFM the valve has C = 2 litre/(s bar), as its quarter-inch
# ports suggest; read as SLPM it would be a hole of 0.9 mm. b, m and per cent do not depend on it.
SCFM = 0.0283168466 / 60 * 1.2


@pytest.fixture(scope="session")
def spool_valve() -> Callable[..., FlowMap]:
    """Factory of maps of a spool valve: two ISO 6358 edges with leakage, metered with noise."""

    def build(
        noise: float = 0.0, n_u: int = 21, n_p: int = 25, seed: int = 0, scatter: float = 0.0
    ) -> FlowMap:
        u, p = (
            a.ravel()
            for a in np.meshgrid(np.linspace(-3, 3, n_u), np.linspace(P_EXT, P_SUPPLY, n_p))
        )
        if scatter:  # of the measured outlet pressure [Pa]
            p = p + scatter * np.random.default_rng([seed, 1]).standard_normal(u.size)
            p = np.clip(p, P_EXT, P_SUPPLY)
        inlet = orifice_flow(1.0, 0.3, 0.5, P_SUPPLY, p) * (3e-9 * np.maximum(u, 0) + 2e-10)
        outlet = orifice_flow(1.0, 0.3, 0.5, p, P_EXT) * (4e-9 * np.maximum(-u, 0) + 2e-10)
        q_m = inlet - outlet + noise * np.random.default_rng(seed).standard_normal(u.size)
        return FlowMap(u, p, q_m, P_SUPPLY, P_EXT, source="spool valve")

    return build


@pytest.fixture(scope="session")
def table1(data_folder: Path) -> FlowMap:
    path = data_folder / "table1" / "flow_map.csv"
    return read_flow_map(path, p_supply=P_SUPPLY, p_ext=P_EXT)


@dataclass(frozen=True)
class Curves:
    """Flow [kg/s] of a fully open valve against supply and outlet pressure [Pa]."""

    p_supply: NDArray[np.float64]
    p: NDArray[np.float64]
    q_m: NDArray[np.float64]

    def at(self, psia: float) -> "Curves":
        keep = np.isclose(self.p_supply, psia * PSI)
        return Curves(self.p_supply[keep], self.p[keep], self.q_m[keep])


@pytest.fixture(scope="session")
def enfield(data_folder: Path) -> Curves:
    """Ten curves of the Enfield LS-V25s. Outlet pressures are psia: flow ends at the supply's."""
    path = data_folder / "valve_enfield" / "enfield_LSV25sFlowvsOutletPressure.csv"
    supplies = pd.read_csv(path, header=None, skiprows=1, nrows=1).iloc[0, ::2]
    values = pd.read_csv(path, header=None, skiprows=2).to_numpy(dtype=float)
    parts = []
    for k, name in enumerate(supplies):
        curve = values[:, 2 * k : 2 * k + 2]
        curve = curve[np.isfinite(curve).all(axis=1)]
        supply = float(str(name).strip().removesuffix("psia"))
        parts.append(np.column_stack([np.full(len(curve), supply), curve]))
    p_supply, p, q = np.vstack(parts).T
    return Curves(p_supply * PSI, p * PSI, q * SCFM)


@pytest.fixture(scope="session")
def notched_valve() -> Callable[..., FlowMap]:
    """Factory of maps whose edges open with a notch, then fully: no hyperbola, no curve of ours."""

    def opening(u: NDArray[np.float64]) -> NDArray[np.float64]:
        y = 0.08 * np.logaddexp(0.0, u / 0.08)
        return y * (1 - 0.4 * np.exp(-y / 1.1)) + 0.002

    def build(noise: float = 0.0, n_u: int = 41, n_p: int = 13, seed: int = 0) -> FlowMap:
        u, p = (
            a.ravel()
            for a in np.meshgrid(np.linspace(-5, 5, n_u), np.linspace(P_EXT, P_SUPPLY, n_p))
        )
        inlet = orifice_flow(2e-9, 0.3, 0.5, P_SUPPLY, p) * opening(u)
        outlet = orifice_flow(2.5e-9, 0.3, 0.5, p, P_EXT) * opening(-u)
        q_m = inlet - outlet + noise * np.random.default_rng(seed).standard_normal(u.size)
        return FlowMap(u, p, q_m, P_SUPPLY, P_EXT, source="notched valve")

    return build
