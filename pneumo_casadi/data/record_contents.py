"""What a record holds: noise, motion, ranges; and what its motion can and cannot tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import AnyBench
from pneumo_casadi.data.checks.metered_flow import MeteredFlow
from pneumo_casadi.data.checks.smoothed import BlockMeans, block_means
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.recording.samples import noise_of
from pneumo_casadi.parameters import FloatArray

AT_REST = 0.005
"""Speed below which the axis counts as at rest [m/s]: friction has no direction there."""
SMALL_TRAVEL = 0.05
"""Share of the stroke that no experiment is made for: a unit smaller than that of the column may
have been stated, as mm for cm."""
BANDWIDTH_SHARE = 0.99
"""Share of the power of the velocity below the bandwidth of the motion."""


@dataclass(frozen=True, slots=True)
class RecordContents:
    """Figures of one record.

    Parameters
    ----------
    name : str
        Of the record.
    held_out : bool
        Whether it is for validation.
    rows : int
        Number of rows.
    duration : float
        [s].
    sampling_frequency : float
        [Hz].
    bandwidth : float
        Frequency below which lies 99 % of the power of the velocity [Hz]; 0 where it is noise.
    noise : mapping of str to float
        Standard deviation of the noise of one sample by output, from fourth differences [SI].
    ranges : mapping of str to (float, float)
        Least and greatest value of each channel [SI].
    rest : float
        Share of the time at rest.
    forward : float
        Share of the moving time in which x grows.
    slow, fast : float
        Speeds that 10 % and 90 % of the moving time stay below [m/s].
    acceleration : float
        Largest acceleration below 20 Hz, less that of the sensor's noise [m/s²].
    reversals : int
        Changes of direction.
    common_mode : float or None
        Range of the mean of both pressures [Pa]; None without two chambers.
    """

    name: str
    held_out: bool
    rows: int
    duration: float
    sampling_frequency: float
    bandwidth: float
    noise: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]
    rest: float
    forward: float
    slow: float
    fast: float
    acceleration: float
    reversals: int
    common_mode: float | None

    @property
    def travel(self) -> float:
        """Distance between the extreme positions [m]."""
        low, high = self.ranges["x"]
        return high - low


def record_contents(recording: Recording, bench: AnyBench, held_out: bool) -> RecordContents:
    """Return the figures of a record."""
    smooth = block_means(recording)
    v = np.gradient(smooth(recording["x"]), smooth.dt)
    v_noise = np.gradient(smooth(_as_noisy(recording["x"])), smooth.dt)
    peak, peak_of_noise = (np.abs(np.gradient(y, smooth.dt)).max() for y in (v, v_noise))
    moving = v[np.abs(v) > AT_REST]
    speeds = np.abs(moving) if moving.size else np.zeros(1)
    both = all(name in recording for name in ("p_P", "p_N"))
    mean = smooth((recording["p_P"] + recording["p_N"]) / 2) if both else np.zeros(1)
    return RecordContents(
        name=recording.name,
        held_out=held_out,
        rows=recording.N,
        duration=recording.duration,
        sampling_frequency=recording.sampling_frequency,
        bandwidth=_bandwidth(v, v_noise, smooth),
        noise={name: noise_of(recording[name]) for name in bench.kind.outputs},
        ranges={n: (float(recording[n].min()), float(recording[n].max())) for n in recording.names},
        rest=1 - moving.size / v.size,
        forward=float(np.mean(moving > 0)) if moving.size else 0.0,
        slow=float(np.quantile(speeds, 0.1)),
        fast=float(np.quantile(speeds, 0.9)),
        acceleration=max(float(peak - peak_of_noise), 0.0),
        reversals=int(np.count_nonzero(np.diff(np.sign(moving)))),
        common_mode=float(np.ptp(mean)) if both else None,
    )


def _as_noisy(values: FloatArray) -> FloatArray:
    """Return white noise of the size of that on a channel, always the same."""
    rng = np.random.default_rng(0)
    return noise_of(values) * np.asarray(rng.standard_normal(values.size))


def _bandwidth(v: FloatArray, v_noise: FloatArray, smooth: BlockMeans) -> float:
    """Return the bandwidth of the velocity, the power of the sensor's noise taken off [Hz]."""
    window = np.hanning(v.size)
    power, noise = (np.abs(np.fft.rfft((y - y.mean()) * window)) ** 2 for y in (v, v_noise))
    below = np.maximum.accumulate(np.cumsum(power - noise))
    if below[-1] <= 0:
        return 0.0
    k = int(np.searchsorted(below, BANDWIDTH_SHARE * below[-1]))
    return float(np.fft.rfftfreq(v.size, smooth.dt)[k])


@dataclass(frozen=True, slots=True)
class Statement:
    """Whether the records can tell something.

    Parameters
    ----------
    about : str
        Parameters or effects that it concerns.
    enough : bool
        Whether the records suffice.
    text : str
        Its figure.
    remedy : str
        What to record next where they do not.
    """

    about: str
    enough: bool
    text: str
    remedy: str


def statements(
    contents: Sequence[RecordContents], bench: AnyBench, flows: Mapping[str, MeteredFlow]
) -> tuple[Statement, ...]:
    """Return what the records to identify on can and cannot tell."""
    fitted = [content for content in contents if not content.held_out]
    if not fitted:
        return ()
    return (
        *_of_length(fitted, contents),
        *_of_motion(fitted, bench),
        *(_of_pressures(fitted, bench) if isinstance(bench, Bench) else ()),
        *(_of_map(fitted, flows) if flows else ()),
    )


def _of_length(
    fitted: Sequence[RecordContents], contents: Sequence[RecordContents]
) -> Iterator[Statement]:
    duration = sum(content.duration for content in fitted)
    # Ten seconds hold about ten periods of 1 Hz; the example needs them for 1 % in the volumes.
    yield Statement(
        "all parameters",
        duration >= 10.0,
        f"{duration:.3g} s to identify on",
        "record 20 s or more",
    )
    held_out = [content for content in contents if content.held_out]
    yield Statement(
        "accuracy of predictions",
        bool(held_out),
        f"{len(held_out)} held-out records",
        "record another motion and keep it from the fit as validate.csv",
    )
    ratios = [c.sampling_frequency / c.bandwidth for c in fitted if c.bandwidth > 0]
    ratio = min(ratios, default=0.0)
    yield Statement(
        "rates of pressure and speed",
        ratio >= 100,  # eq. 14
        f"sampled at {ratio:.3g} times the bandwidth of the motion",
        "sample at 100 times the bandwidth of the motion or faster (eq. 14)",
    )


def _of_motion(fitted: Sequence[RecordContents], bench: AnyBench) -> Iterator[Statement]:
    low = min(content.ranges["x"][0] for content in fitted)
    high = max(content.ranges["x"][1] for content in fitted)
    if bench.stroke is not None:
        share = (high - low) / bench.stroke
        # Below a quarter of the stroke the volume and its change with x are hardly apart.
        yield Statement(
            "volumes, effects over the position",
            share >= 0.25,
            f"x from {1e3 * low:.3g} to {1e3 * high:.3g} mm, {100 * share:.2g} % of the stroke"
            + ("; is x in its right unit?" if share < SMALL_TRAVEL else ""),
            "move over the whole stroke",
        )
    forward = sum(c.forward * c.duration for c in fitted) / sum(c.duration for c in fitted)
    yield Statement(
        "F_c_plus, F_c_minus",
        0.2 <= forward <= 0.8,  # a fifth of the moving time: both constants to the same size
        f"x grows in {100 * forward:.2g} % of the moving time",
        "move as long in the one direction as in the other",
    )
    slow, fast = min(c.slow for c in fitted), max(c.fast for c in fitted)
    # Over a factor of four of speed f_v ẋ and F_c differ in shape, below it hardly.
    yield Statement(
        "f_v against F_c",
        fast >= 4 * slow > 0,
        f"speeds from {1e3 * slow:.3g} to {1e3 * fast:.3g} mm/s",
        "move slowly and fast, in one record or in two",
    )
    acceleration = max(content.acceleration for content in fitted)
    # 1 m/s² moves 10 kg by 10 N, as much as the friction of a small cylinder.
    yield Statement(
        "M",
        acceleration >= 1.0,
        f"accelerations up to {acceleration:.2g} m/s²",
        "add steps of the reference, or faster reversals",
    )
    rest = sum(c.rest * c.duration for c in fitted) / sum(c.duration for c in fitted)
    reversals = sum(content.reversals for content in fitted)
    yield Statement(
        "friction",
        rest <= 0.6 and reversals >= 5,  # five reversals: each direction starts twice
        f"at rest for {100 * rest:.2g} % of the time, {reversals} reversals",
        "reverse more often and rest less",
    )


def _of_pressures(fitted: Sequence[RecordContents], bench: Bench) -> Iterator[Statement]:
    span = bench.p_supply - bench.p_ext
    share = max((content.common_mode or 0.0) / span for content in fitted)
    # A twentieth of the supply's gauge pressure: 0.3 bar, a hundred times the noise of a sensor.
    yield Statement(
        "leaks, supply, friction over pressure",
        share >= 0.05,
        f"the mean of both pressures moves by {100 * share:.2g} % of the supply's gauge pressure",
        "press both chambers up and down together, or run at two supply pressures",
    )


def _of_map(
    fitted: Sequence[RecordContents], flows: Mapping[str, MeteredFlow]
) -> Iterator[Statement]:
    for letter, unit, scale in (("p", "bar", 1e-5), ("u", "V", 1.0)):
        outside, texts = False, []
        for chamber, flow in flows.items():
            low = min(content.ranges[f"{letter}_{chamber}"][0] for content in fitted)
            high = max(content.ranges[f"{letter}_{chamber}"][1] for content in fitted)
            metered = flow.p if letter == "p" else flow.u
            outside |= bool(low < metered.min() or high > metered.max())
            texts.append(
                f"{letter}_{chamber} from {scale * low:.3g} to {scale * high:.3g} {unit} (metered "
                f"{scale * metered.min():.3g} to {scale * metered.max():.3g})"
            )
        yield Statement(
            "flow map",
            not outside,
            ", ".join(texts),
            "meter the valve over the range of the records, ambient to supply pressure",
        )
