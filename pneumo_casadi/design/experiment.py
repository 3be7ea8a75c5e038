"""An experiment on the model: what the axis would do, and whether it may."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pneumo_casadi.data import AnyBench, ProportionalController
from pneumo_casadi.design.reference import Reference
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import external_force, load_force, pressure_force
from pneumo_casadi.model.integration import accumulate, step_function
from pneumo_casadi.model.junctions import Pair
from pneumo_casadi.model.machine_code.compilation import compile_functions
from pneumo_casadi.model.sampled_axis import SampledAxis
from pneumo_casadi.model.stepping import stepping_for
from pneumo_casadi.parameters import FloatArray

#: Time in closed loop on the first reference before an experiment begins [s].
SETTLING = 0.5
#: Pressures and commands between which the state at rest is looked for.
GRID = 81
#: Excess over the limits that is assigned to a trajectory that diverged.
RAN_AWAY = 1e3


@dataclass(frozen=True, slots=True)
class Limits:
    """What an experiment must not exceed.

    Parameters
    ----------
    position : float
        Largest distance from mid-stroke [m].
    velocity : float
        Largest speed [m/s].
    p_min, p_max : float
        Chamber pressures, absolute [Pa].
    command : float
        Largest command to a valve [V].
    common : float
        Largest command added to both valves [V]; 0 where the bench does not allow it.

    Raises
    ------
    ModelError
        If a limit leaves no room.
    """

    position: float
    velocity: float
    p_min: float
    p_max: float
    command: float
    common: float = 0.0

    def __post_init__(self) -> None:
        sizes = {"position": self.position, "velocity": self.velocity, "command": self.command}
        for name, value in sizes.items():
            if not value > 0:
                raise ModelError(f"limit of {name}: {value:g} leaves no room; give a positive one")
        if not self.p_min < self.p_max:
            raise ModelError(
                f"limits of pressure: {self.p_min:g} to {self.p_max:g} Pa leaves no room"
            )
        if self.common < 0:
            raise ModelError(f"limit of the common mode: {self.common:g} V; give its magnitude")

    def as_dict(self) -> dict[str, float]:
        """Return the limits with their units, as plain data."""
        return {
            "position_m": self.position,
            "velocity_m_per_s": self.velocity,
            "p_min_Pa": self.p_min,
            "p_max_Pa": self.p_max,
            "command_V": self.command,
            "common_V": self.common,
        }


@dataclass(frozen=True, eq=False)
class SimulatedExperiment:
    """What the model did under a reference.

    Parameters
    ----------
    reference : Reference
        What it was given.
    x : (nx, N) array
        States.
    u : (nu, N) array
        Commands.
    y : (ny, N) array
        Outputs, without noise.
    wanted : float
        Largest command that the controller asked for, before it was clipped [V].
    """

    reference: Reference
    x: FloatArray
    u: FloatArray
    y: FloatArray
    wanted: float

    @property
    def extremes(self) -> Mapping[str, float]:
        """Largest position, speed, command and the extreme pressures [SI]."""
        p = self.x[:2]
        return {
            "position": float(np.abs(self.x[2]).max()),
            "velocity": float(np.abs(self.x[3]).max()),
            "p_min": float(p.min()),
            "p_max": float(p.max()),
            "command": self.wanted,
        }

    def excess(self, limits: Limits) -> float:
        """Return by how much limits are exceeded, as shares of them, added up; 0 if none is."""
        if not (np.isfinite(self.x).all() and np.isfinite(self.u).all()):
            return RAN_AWAY
        most = self.extremes
        span = limits.p_max - limits.p_min
        beyond = (
            most["position"] / limits.position - 1,
            most["velocity"] / limits.velocity - 1,
            most["command"] / limits.command - 1,
            (limits.p_min - most["p_min"]) / span,
            (most["p_max"] - limits.p_max) / span,
        )
        return min(RAN_AWAY, float(sum(max(0.0, share) for share in beyond)))


def proportional_controller(bench: AnyBench) -> ProportionalController:
    """Return the controller of a bench, whose gain and limit bound the experiments.

    Raises
    ------
    ModelError
        If it is not a plain proportional one.
    """
    controller = bench.controller
    if not isinstance(controller, ProportionalController):
        raise ModelError(
            "experiments are designed for a proportional controller, not for a "
            f"{type(controller).__name__}; state in bench.json the proportional one that will run "
            "the experiment (`controller`: type, gain_V_per_m, u_max_V)"
        )
    if controller.u_0 or controller.sample_time is not None:
        raise ModelError(
            "experiments are designed for a proportional controller without a null voltage, "
            "sampled with the record; leave out u_0_V and sample_time_s"
        )
    return controller


@dataclass(frozen=True, eq=False)
class ExperimentSimulator:
    """An axis in its loop, ready to try references on.

    Parameters
    ----------
    axis : Axis
        With the parameters to try with.
    dt : float
        Sampling period of the controller [s].

    Raises
    ------
    ModelError
        If the axis has no chambers.
    """

    axis: Axis
    dt: float

    def __post_init__(self) -> None:
        if not self.axis.kind.gas_chambers:
            raise ModelError(
                "experiments are designed for a servo axis; a force-driven one is not supported"
            )

    @property
    def controller(self) -> ProportionalController:
        """The law that closes the loop."""
        return proportional_controller(self.axis.bench)

    @cached_property
    def model(self) -> SampledAxis:
        """The axis and its controller from sample to sample."""
        return SampledAxis(self.axis, stepping_for(self.axis, self.dt), self.controller)

    @cached_property
    def step(self) -> ca.Function:
        """One sample, ``(x, w, θ) -> (x_next, x, u, y)``, compiled."""
        return compile_functions([self.sample])[0]

    @property
    def sample(self) -> ca.Function:
        """One sample as an expression; what it calls is compiled once."""
        axis, model = self.axis, self.model
        x, w = ca.MX.sym("x", model.nx), ca.MX.sym("w", model.nw)
        theta = ca.MX.sym("theta", len(axis.parameters))
        u = model.feedback(x, w, theta)
        u_max, n = self.controller.u_max, len(axis.kind.commands)
        u = ca.vertcat(ca.fmin(ca.fmax(u[:n], -u_max), u_max), ca.DM(axis.inputs_at_rest[n:]))
        following = step_function(axis, model.stepping)(x, ca.vertcat(u, u[n:, :]), theta)
        results = [following, x, u, axis.output(x, u, theta)]
        return ca.Function("experiment_step", [x, w, theta], results)

    def __call__(self, reference: Reference) -> SimulatedExperiment:
        """Simulate a reference from where it was begun, or after settling on its first values."""
        settling = 0 if reference.start is not None else round(SETTLING / self.dt)
        x, p_P, p_N = reference.start or (reference.x_ref[0], *self.rest_pressures)
        commands = [reference.x_ref, reference.common, reference.common]
        further = np.zeros((self.model.nw - len(commands), reference.x_ref.size))
        w = np.vstack([*commands, further])
        given = np.hstack([np.repeat(w[:, :1], settling, axis=1), w])
        theta = self.axis.parameters.values
        start = self.axis.rest([p_P, p_N, x, 0.0], self.axis.inputs_at_rest, theta)
        x_0 = np.asarray(start, dtype=float).reshape(-1, 1)
        with np.errstate(all="ignore"):
            _, states, u, y = accumulate(self.step, x_0, [given[None]], theta)
        states, u, y = (part[0][:, settling:] for part in (states, u, y))
        error = np.abs(self.controller.gain * (reference.x_ref - y[self.axis.outputs.index("x")]))
        wanted = float((error + np.abs(reference.common)).max())
        return SimulatedExperiment(reference, states, u, y, wanted)

    @cached_property
    def rest_pressures(self) -> tuple[float, float]:
        """Pressures [Pa] at which the axis stands still in its loop: no flow, forces balanced.

        Valves that are commanded apart by ±δ let through nothing at pressures that rise with the
        command; δ is that at which these balance the piston.
        """
        constants, theta = self.axis.constants, self.axis.parameters.values
        p = np.linspace(constants["p_ext"], constants["p_supply"], GRID)
        # Close to zero, where the pressure gain is large, commands lie close together.
        delta = self.controller.u_max * np.linspace(-1.0, 1.0, GRID) ** 3
        all_p, all_delta = (part.ravel() for part in np.meshgrid(p, delta, indexing="ij"))
        nominal = np.vstack([all_p, all_p, 0 * all_p, 0 * all_p])
        further = self.axis.inputs_at_rest[len(self.axis.kind.commands) :, None]
        u = np.vstack([all_delta, -all_delta, np.repeat(further, all_p.size, axis=1)])
        columns = theta[:, None]
        states = self.axis.rest.map(all_p.size)(nominal, u, columns)
        rates = np.asarray(self.axis.rhs.map(all_p.size)(states, u, columns), dtype=float)
        still = [_zero(p, rate.reshape(GRID, GRID)) for rate in rates[:2]]
        force = pressure_force(Pair(*still), constants) - external_force(constants)
        force = force + load_force({}, self.axis.parameters["M"].value, constants)
        at = float(np.interp(0.0, force, delta))
        return float(np.interp(at, delta, still[0])), float(np.interp(at, delta, still[1]))


def _zero(p: FloatArray, rates: FloatArray) -> FloatArray:
    """Return, column by column, the pressure at which a falling rate is zero, or the nearest."""
    pressures = [float(np.interp(0.0, -column, p)) for column in rates.T]
    return np.array(pressures)
