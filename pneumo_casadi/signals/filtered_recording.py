"""A recording after the first filter: states, derivatives and the inputs that go with them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np

from pneumo_casadi.data import InputHold, Recording
from pneumo_casadi.data.bench.axis_kind import INPUTS, MEASURED_INPUTS, OUTPUTS
from pneumo_casadi.data.recording.clock import same_clock
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.signals.bandwidth import power_bandwidth, white_noise_std
from pneumo_casadi.signals.filter_plan import FilterPlan, plan_filters
from pneumo_casadi.signals.resampling import on_uniform_clock, require_one_frequency
from pneumo_casadi.signals.zero_phase import Difference, central_difference, zero_phase_lowpass

#: Share of the largest motion of all records below which a record counts as at rest.
AT_REST = 0.1


class InputPairing(Enum):
    """Which input belongs to a derivative taken by central differences at t[k].

    An input held at zero order jumps at t[k], and with it the derivative. The central
    difference spans one step before and one after the jump, so its partner is the mean of the
    balance over u[k-1] and over u[k]. Pairing it with u[k] alone shifts the input by half a
    sample against the outputs, which biases every coefficient of a derivative.
    """

    MEAN_OF_HOLDS = "mean over u[k-1] and u[k]"
    """Right for an input held from its sample to the next."""
    SAMPLE = "u[k]"
    """Right for an input measured at t[k] that runs on continuously."""


@dataclass(frozen=True, slots=True, eq=False)
class FilteredRecording:
    """Filtered states and their derivatives, with the unfiltered inputs around each sample.

    Parameters
    ----------
    t : (N,) array
        Time of the samples kept [s].
    states : mapping of str to (N,) array
        ``x`` [m], ``v`` [m/s] and, where recorded, ``p_P``, ``p_N`` [Pa], filtered.
    derivatives : mapping of str to (N,) array
        Under the same names their time derivatives: ``v``, ẍ, ṗ_P, ṗ_N.
    inputs : tuple of mapping of str to (N,) array
        The inputs to average a balance over: before and after each sample for
        `InputPairing.MEAN_OF_HOLDS`, one set for `InputPairing.SAMPLE`. They stay unfiltered:
        the flow q_m(u, p) bends at u = 0, so the flow of a filtered u is not the filtered flow.
    plan : FilterPlan
        What was done.
    pairing : InputPairing
        Which inputs belong to a sample.
    dropped : tuple of int
        Samples dropped at the front and at the back.
    velocity_noise : float
        Standard deviation of v that the sensors leave after filtering [m/s].
    name, source : str
        Of the recording.
    """

    t: FloatArray
    states: Mapping[str, FloatArray]
    derivatives: Mapping[str, FloatArray]
    inputs: tuple[Mapping[str, FloatArray], ...]
    plan: FilterPlan
    pairing: InputPairing
    dropped: tuple[int, int]
    velocity_noise: float
    name: str
    source: str

    @property
    def N(self) -> int:
        """Number of samples kept."""
        return int(self.t.size)

    def stack_states(self, names: Iterable[str]) -> FloatArray:
        """Return the named states as rows, shape (nx, N)."""
        return np.array([self._find(self.states, name) for name in names])

    def stack_derivatives(self, names: Iterable[str]) -> FloatArray:
        """Return the derivatives of the named states as rows, shape (nx, N)."""
        return np.array([self._find(self.derivatives, name) for name in names])

    def stack_inputs(self, names: Iterable[str]) -> tuple[FloatArray, ...]:
        """Return the named inputs as rows, one array of shape (nu, N) per set to average over."""
        chosen = tuple(names)
        return tuple(np.array([self._find(held, n) for n in chosen]) for held in self.inputs)

    def _find(self, where: Mapping[str, FloatArray], name: str) -> FloatArray:
        if name not in where:
            raise CaseError(f"{self.source}: no channel {name}; there are {', '.join(where)}")
        return where[name]


def plan_filters_for(recordings: Iterable[Recording], bound: float = 0.01) -> FilterPlan:
    """Plan the filters for recordings that share a clock, from the fastest of them.

    Parameters
    ----------
    recordings : iterable of Recording
        With the position ``x``.
    bound : float, optional
        See `plan_filters`.

    Returns
    -------
    FilterPlan

    Raises
    ------
    CaseError
        If records differ in their sampling frequency, or one is sampled too slowly to be
        differentiated twice within its bandwidth.
    """
    recorded = tuple(recordings)
    require_one_frequency(recorded)
    records = tuple(on_uniform_clock(recording, recorded[0].dt) for recording in recorded)
    # A record at rest shows the bandwidth of its noise, not of the axis.
    largest = max(float(np.std(rec["x"])) for rec in records)
    moving = [rec for rec in records if np.std(rec["x"]) >= AT_REST * largest]
    f_dyn, fastest = max((power_bandwidth(rec["x"], 1 / rec.dt), rec.source) for rec in moving)
    f_s = 1 / records[0].dt
    try:
        return plan_filters(f_s, f_dyn, bound=bound)
    except ModelError as error:
        raise CaseError(
            f"{fastest}: `x` moves at up to {f_dyn:.3g} Hz above its white noise, too "
            f"fast for accelerations at {f_s:.4g} Hz. Either the record is sampled too slowly, or "
            "noise that is not white counts as motion: leave the record out, or state the "
            "bandwidth, fit_wls(axis, records, names=..., plan=plan_filters(f_s, f_dyn))"
        ) from error


def filter_recording(
    recording: Recording,
    plan: FilterPlan,
    pairing: InputPairing | None = None,
    difference: Difference = central_difference,
) -> FilteredRecording:
    """Filter the measurements without phase shift, differentiate them, and drop the edges.

    A record whose clock is taken as recorded is resampled first, see `on_uniform_clock`.

    Parameters
    ----------
    recording : Recording
        With ``x`` [m]; ``p_P`` and ``p_N`` [Pa] are filtered alike where they exist. A measured
        velocity ``v`` [m/s] and acceleration ``a`` [m/s²] are averaged with those from the other
        sensors, weighted by their noise.
    plan : FilterPlan
        The cut-offs.
    pairing : InputPairing, optional
        By default what the recording's input hold asks for.
    difference : callable, optional
        ``difference(values, dt)`` differentiates; by default `central_difference`, as the paper.

    Returns
    -------
    FilteredRecording

    Raises
    ------
    CaseError
        If the plan was made for another sampling frequency, or nothing is left of the record.
    """
    recording = on_uniform_clock(recording, 1 / plan.sampling_frequency)
    fs = 1 / recording.dt
    if not same_clock(recording.dt, 1 / plan.sampling_frequency):
        raise CaseError(
            f"{recording.source}: sampled at {fs:g} Hz, but the filters are planned for "
            f"{plan.sampling_frequency:g} Hz; plan them for this record"
        )
    front, back = plan.drop
    if recording.N - front - back < 2:
        raise CaseError(
            f"{recording.source}: {recording.N} samples are too few; the edges of the filter take "
            f"{front} and {back}: give a longer record or a higher cut-off"
        )
    if pairing is None:
        held = recording.hold is InputHold.ZERO
        pairing = InputPairing.MEAN_OF_HOLDS if held else InputPairing.SAMPLE
    kept = slice(front, recording.N - back)
    states, derivatives = _states(recording, plan, difference)
    return FilteredRecording(
        t=_read_only(recording.t[kept]),
        states=_kept(states, kept),
        derivatives=_kept(derivatives, kept),
        inputs=tuple(_kept(held, kept) for held in _inputs(recording, pairing)),
        plan=plan,
        pairing=pairing,
        dropped=(front, back),
        velocity_noise=velocity_noise(recording, plan, difference),
        name=recording.name,
        source=recording.source,
    )


def velocity_noise(recording: Recording, plan: FilterPlan, difference: Difference) -> float:
    """Return the standard deviation of a filtered velocity's noise, taken for white [m/s]."""
    noise = _noise(recording, plan, difference, "x", 1)
    if "v" not in recording:
        return noise
    other = _noise(recording, plan, difference, "v", 0)
    return float(1 / np.hypot(1 / max(noise, 1e-300), 1 / max(other, 1e-300)))


def _states(
    recording: Recording, plan: FilterPlan, difference: Difference
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    states: dict[str, FloatArray] = {}
    derivatives: dict[str, FloatArray] = {}
    measured = {
        name: zero_phase_lowpass(recording[name], plan.cutoff, plan.sampling_frequency, plan.order)
        for name in OUTPUTS
        if name in recording.channels
    }
    for name in (n for n in measured if n not in ("v", "a")):
        states[name] = measured[name]
        derivatives[name] = difference(states[name], recording.dt)
    v = [(derivatives["x"], _noise(recording, plan, difference, "x", 1))]
    if "v" in measured:
        v.append((measured["v"], _noise(recording, plan, difference, "v", 0)))
    states["v"] = derivatives["x"] = _weighted_mean(v)
    a = [(difference(states["v"], recording.dt), _noise(recording, plan, difference, "x", 2))]
    if "v" in measured:
        slope = difference(measured["v"], recording.dt)
        a.append((slope, _noise(recording, plan, difference, "v", 1)))
    if "a" in measured:
        a.append((measured["a"], _noise(recording, plan, difference, "a", 0)))
    derivatives["v"] = _weighted_mean(a)
    return states, derivatives


def _noise(
    recording: Recording, plan: FilterPlan, difference: Difference, sensor: str, derivative: int
) -> float:
    """Return the deviation that a sensor's noise leaves on a derivative of its filtered signal."""
    return white_noise_std(recording[sensor]) * plan.noise_gains(difference)[derivative]


def _weighted_mean(values: Sequence[tuple[FloatArray, float]]) -> FloatArray:
    """Return the mean of several values of a quantity, each weighted by its noise."""
    if len(values) == 1:
        return values[0][0]
    weights = [1 / max(noise, 1e-300) ** 2 for _, noise in values]
    total = sum(weights)
    return np.asarray(sum(w / total * value for w, (value, _) in zip(weights, values, strict=True)))


def _inputs(recording: Recording, pairing: InputPairing) -> list[dict[str, FloatArray]]:
    after = {n: recording[n] for n in INPUTS if n in recording.channels}
    if pairing is InputPairing.SAMPLE:
        return [after]
    # Nothing is known of a command before the first sample: it is taken to have stood already.
    before = {
        name: u if name in MEASURED_INPUTS else np.concatenate((u[:1], u[:-1]))
        for name, u in after.items()
    }
    return [before, after]


def _kept(channels: Mapping[str, FloatArray], rows: slice) -> Mapping[str, FloatArray]:
    return MappingProxyType({name: _read_only(values[rows]) for name, values in channels.items()})


def _read_only(values: FloatArray) -> FloatArray:
    copy = np.array(values, dtype=float)
    copy.flags.writeable = False
    return copy
