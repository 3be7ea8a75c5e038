"""What may be chosen in a design, and what an experiment is compared with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.data import Bench, Recording
from pneumo_casadi.design.experiment import ExperimentSimulator, Limits, SimulatedExperiment
from pneumo_casadi.design.reference import COMMON, KINDS, Part, Reference, make_reference
from pneumo_casadi.design.search import Candidate, SearchResult
from pneumo_casadi.design.space import Space
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray

#: The search steps at most so finely [s], and smooths friction at least so widely [m/s]; the
#: reference found is judged at the bench's own rate and the axis' own width.
COARSE_STEP, COARSE_WIDTH = 1e-3, 1e-3
#: Length of the beginning of a record from which its initial state is estimated [s].
BEGINNING = 5e-3
#: The search keeps so much of every limit in hand.
SEARCH_MARGIN = 0.03


@dataclass(frozen=True, slots=True)
class DesignOptions:
    """What may be chosen in a design.

    Parameters
    ----------
    limits : Limits
        What the experiment must not exceed.
    duration : float
        Its length [s].
    kinds : tuple of str
        Kinds of motion to choose from; by default all. The common mode follows from the limits.
    evaluations : int
        About how many references are tried.
    seed : int
        Of the search.

    Raises
    ------
    ModelError
        If the duration is not positive.
    """

    limits: Limits
    duration: float
    kinds: tuple[str, ...] = tuple(name for name in KINDS if name != COMMON)
    evaluations: int = 240
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.duration > 0:
            raise ModelError(f"a duration of {self.duration:g} s leaves no time to move")

    @property
    def space(self) -> Space:
        """References to choose from."""
        return Space(self.kinds, self.limits.common > 0, self.duration)

    def make_reference(self, parts: tuple[Part, ...], dt: float) -> Reference:
        """Draw parts within the limits at a sampling period [s]."""
        N = round(self.duration / dt)
        return make_reference(
            parts, dt, N, (1 - SEARCH_MARGIN) * self.limits.position, self.limits.common
        )

    @property
    def search_limits(self) -> Limits:
        """The limits less what the search keeps in hand."""
        share = 1 - SEARCH_MARGIN
        limits = self.limits
        margin = SEARCH_MARGIN * (limits.p_max - limits.p_min) / 2
        return replace(
            limits,
            position=share * limits.position,
            velocity=share * limits.velocity,
            command=share * limits.command,
            p_min=limits.p_min + margin,
            p_max=limits.p_max - margin,
        )


@dataclass(frozen=True, slots=True)
class SimulationRate:
    """How finely experiments are simulated.

    Parameters
    ----------
    dt : float
        Sampling period [s].
    sigma : (ny,) array
        Noise of one sample of each output, such that it says as much in a second as the
        bench's samples do.
    width : float
        Least width of the smoothed friction [m/s].
    """

    dt: float
    sigma: FloatArray
    width: float

    def smoothed(self, axis: Axis) -> Axis:
        """Return the axis with friction at least that wide."""
        return axis.with_parameters({"v_s": max(self.width, axis.parameters["v_s"].value)})


def simulation_rates(axis: Axis, sigma: FloatArray) -> tuple[SimulationRate, SimulationRate]:
    """Return the bench's own clock, and the coarse one of the search."""
    dt = 1.0 / axis.bench.sampling_frequency
    coarse = dt * max(1, round(COARSE_STEP / dt))
    return SimulationRate(dt, sigma, 0.0), SimulationRate(
        coarse, sigma * np.sqrt(dt / coarse), COARSE_WIDTH
    )


def recorded_reference(record: Recording) -> Reference:
    """Return what the axis was given in a record: x_ref, and the mean of both commands.

    Raises
    ------
    ModelError
        If the record holds no reference.
    """
    if "x_ref" not in record:
        raise ModelError(f"record {record.name}: no reference x_ref to compare a design with")
    common = (record["u_P"] + record["u_N"]) / 2
    n = max(1, round(BEGINNING / record.dt))
    x, p_P, p_N = (float(record[name][:n].mean()) for name in ("x", "p_P", "p_N"))
    return Reference(record.dt, record["x_ref"], np.round(common, 4), (x, p_P, p_N))


def resample_reference(reference: Reference, dt: float) -> Reference:
    """Return a reference at a longer sampling period [s]."""
    n = max(1, round(dt / reference.dt))
    return replace(
        reference,
        dt=n * reference.dt,
        x_ref=reference.x_ref[::n],
        common=reference.common[::n],
    )


def default_limits(
    bench: Bench, records: Sequence[Recording], u_metered: float, common: float = 0.0
) -> Limits:
    """Return limits that follow from a bench: what is safe without asking anybody.

    Parameters
    ----------
    bench : Bench
        Its stroke, pressures and controller.
    records : sequence of Recording
        The axis may go one and a half times as fast as it has gone in them.
    u_metered : float
        Largest command at which the flow map was metered [V]: beyond it nothing is known.
    common : float, optional
        Largest command to both valves [V].

    Returns
    -------
    Limits
        Four fifths of the stroke, pressures between ambient and supply.
    """
    fastest = 0.0
    for record in records:
        # Over 20 ms: noise of the position sensor is no speed.
        n = max(1, round(0.02 / record.dt))
        speed = np.abs(record["x"][n:] - record["x"][:-n]) / (n * record.dt)
        fastest = max(fastest, float(speed.max()))
    u_max = min(getattr(bench.controller, "u_max", None) or u_metered, u_metered)
    return Limits(0.4 * bench.stroke, 1.5 * fastest, bench.p_ext, bench.p_supply, u_max, common)


def feasible_finalists(
    search: SearchResult, options: DesignOptions, axes: Mapping[str, Axis], clock: SimulationRate
) -> list[tuple[Candidate, Mapping[str, SimulatedExperiment]]]:
    """Return the finalists that keep the limits on every axis at the bench's own rate.

    Raises
    ------
    FitError
        If none does.
    """
    simulators = {
        name: ExperimentSimulator(clock.smoothed(axis), clock.dt) for name, axis in axes.items()
    }
    kept: list[tuple[Candidate, Mapping[str, SimulatedExperiment]]] = []
    for candidate in search.finalists:
        reference = options.make_reference(options.space.parts(candidate.z), clock.dt)
        runs = {name: simulator(reference) for name, simulator in simulators.items()}
        if all(run.excess(options.limits) == 0.0 for run in runs.values()):
            kept.append((candidate, runs))
    if not kept and search.finalists:
        raise FitError(
            "design: the best references keep the limits in the search and exceed them at the "
            "sampling rate of the bench. Allow more speed, pressure or command, or try more"
        )
    if not kept and search.least_excess == 0:
        raise FitError(
            "design: no reference that keeps the limits tells what is asked for. Hold parameters "
            "that no motion shows, allow more speed, pressure or command, or try more references"
        )
    if not kept:
        raise FitError(
            "design: no reference that was tried keeps the limits; the best exceeds them by "
            f"{100 * search.least_excess:.2g} %. Allow more speed, pressure or command, or try "
            "more references"
        )
    return kept
