"""Is the bench sound? Balances that must close, steps that must not matter, rest and stops."""

from dataclasses import dataclass, replace
from math import log2, pi

import numpy as np

from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.axis import VirtualAxis, random_axis
from pneumo_casadi.virtual_bench.catalogue import effects_for
from pneumo_casadi.virtual_bench.experiment import Excitation, Experiment
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.kernels.layout import LINE_N, LINE_P
from pneumo_casadi.virtual_bench.simulation import Run, simulate_axis

FS = 1000.0
#: Steps whose errors are compared with a run of steps eight times finer than the last [s].
STEPS = (4e-4, 2e-4, 1e-4)
#: What is open or moving at once where the balances are drawn up: all that carries gas or heat.
CARRYING = ("heat_transfer", "hose", "piston_seal_leakage", "leakage_P", "leakage_N")


@dataclass(frozen=True, slots=True)
class Sanity:
    """Findings on one axis.

    Parameters
    ----------
    mass_error : float
        Largest gap in the balance of gas in chambers and lines, by the mean content [1].
    energy_error : float
        Largest gap in the balance of internal and kinetic energy, by the largest change that
        passed the boundary [1]; heat, friction and end stops included.
    step_errors : tuple of float
        Largest error of the position with the steps `STEPS`, by the motion [1].
    order : float
        Order of convergence between the first and the last of them.
    held_drift : float
        How far a piston moved that friction holds under changing pressures [m]: exactly 0.
    stop_excess : float
        How far a piston driven against its stops went beyond them [m]: exactly 0.
    """

    mass_error: float
    energy_error: float
    step_errors: tuple[float, ...]
    order: float
    held_drift: float
    stop_excess: float


def sanity(axis: VirtualAxis | None = None, seed: int = 0, duration: float = 4.0) -> Sanity:
    """Examine the bench on one axis.

    Parameters
    ----------
    axis : VirtualAxis, optional
        By default a random one.
    seed : int, optional
        Of axis and references.
    duration : float, optional
        Length of each run [s].
    """
    axis = (axis or random_axis(seed)).with_ideal_sensors()
    drive = Experiment.of("chirp_and_squares").excitation(axis, FS, duration, seed)
    carrying = effects_for(axis, dict.fromkeys(CARRYING, "medium"))
    everything = simulate_axis(axis, drive, carrying, FS)
    errors = step_errors(axis, drive)
    stuck = replace(axis, F_c_plus=1e4, F_c_minus=1e4)
    against = Excitation(np.sign(drive.x_ref) * axis.stroke, drive.common)
    loose = replace(axis, F_c_plus=1.0, F_c_minus=1.0)
    x_held = simulate_axis(stuck, drive, (), FS).states[:, layout.X]
    x_stop = simulate_axis(loose, against, (), FS).states[:, layout.X]
    return Sanity(
        mass_error(axis, everything, carrying[1].parameters["length"]),
        energy_error(axis, everything),
        tuple(errors),
        log2(errors[0] / errors[-1]) / (len(STEPS) - 1),
        float(np.ptp(x_held)),
        float(np.abs(x_stop).max() - axis.stroke / 2),
    )


def mass_error(
    axis: VirtualAxis, simulated: Run, hose: float = 0.0, diameter: float = 6e-3
) -> float:
    """Return the gap in the balance of mass, of the mean content; hoses of these sizes [m]."""
    states = simulated.states
    cell = pi * diameter**2 / 4 * hose / layout.CELLS
    lines = states[:, [*range(LINE_P, LINE_P + 3), *range(LINE_N, LINE_N + 3)]].sum(axis=1)
    content = states[:, [layout.MASS_P, layout.MASS_N]].sum(axis=1)
    content += lines * cell / (axis.r * axis.T)
    return _gap(content - states[:, layout.IN_MASS]) / float(content.mean())


def energy_error(axis: VirtualAxis, simulated: Run) -> float:
    """Return the gap in the balance of energy, of the largest change that passed the boundary.

    Only with the energy balance of the chambers, effect ``heat_transfer``.
    """
    y = simulated.states
    inside = y[:, [layout.GAS_P, layout.GAS_N]].sum(axis=1) + axis.M / 2 * y[:, layout.V] ** 2
    ambient = (axis.S_P - axis.S_N) * axis.p_ext * y[:, layout.X]
    lost = y[:, layout.LOST_WORK] + y[:, layout.LOST_IMPACT]
    passed = y[:, layout.IN_ENERGY]
    return _gap(inside + ambient + lost - passed) / float(np.ptp(passed))


def step_errors(axis: VirtualAxis, drive: Excitation) -> list[float]:
    """Return the largest errors of the position with `STEPS`, by the motion."""

    def position(step: float) -> FloatArray:
        x = simulate_axis(axis, drive, (), FS, step=step).states[:, layout.X]
        return np.asarray(x)

    reference = position(STEPS[-1] / 8)
    motion = float(np.ptp(reference))
    return [float(np.abs(position(step) - reference).max()) / motion for step in STEPS]


def _gap(conserved: FloatArray) -> float:
    return float(np.abs(conserved - conserved[0]).max())
