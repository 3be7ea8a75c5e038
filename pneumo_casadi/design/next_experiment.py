"""The next experiment of an identified axis: for precision, or to tell two effects apart."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.data import Arrangement, Bench, Recording
from pneumo_casadi.design.criterion import Criterion
from pneumo_casadi.design.experiment import proportional_controller
from pneumo_casadi.design.options import DesignOptions, default_limits, recorded_reference
from pneumo_casadi.design.precision import design_for_precision, free_held_by_bounds
from pneumo_casadi.design.result import Design
from pneumo_casadi.design.separation import design_to_separate
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError, FitError
from pneumo_casadi.estimation.output_error import OutputErrorResult, fit_output_error
from pneumo_casadi.identification.options import output_error_options
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.starting_axis import catalogue_effect
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.valve import FlowMap

#: The axis without effects, among those to be told apart.
NONE = "none"
#: References tried for ten seconds of experiment; fewer for longer ones, so that time is kept.
PRECISION_TRIES, SEPARATION_TRIES, FEWEST = 240, 60, 40


@dataclass(frozen=True, slots=True)
class ExperimentRequest:
    """What the next experiment is for, and what it may use.

    Parameters
    ----------
    separate : tuple of (str, str), optional
        Two effects of the catalogue to tell apart; ``"none"`` is the axis without effects. By
        default the experiment is designed for small standard errors.
    criterion : Criterion
        Function of the covariance to minimise: determinant (D), trace (A) or largest eigenvalue
        (E), each of the relative errors.
    duration : float, optional
        Length [s]; by default that of the first record.
    common : float
        Largest common-mode command [V]: a voltage added to both u_P and u_N, which changes the
        pressure level but hardly the force. With 0 there is none.
    velocity : float, optional
        Fastest motion [m/s]; by default 1.5 times that of the records.
    command : float, optional
        Largest command [V]; by default as far as the flow map was measured.
    tries : int, optional
        Number of references tried; by default 240 for precision and 60 to separate, fewer for
        experiments longer than 10 s.
    seed : int
        Seed of the random search; the same seed gives the same design.

    Raises
    ------
    CaseError
        If an effect is not in the catalogue, or is to be separated from itself, or if duration or
        tries are not positive.

    Examples
    --------
    >>> request = ExperimentRequest(separate=("stribeck", "none"), duration=4.0)
    >>> request.criterion.value, request.common
    ('D', 0.0)
    """

    separate: tuple[str, str] | None = None
    criterion: Criterion = Criterion.D
    duration: float | None = None
    common: float = 0.0
    velocity: float | None = None
    command: float | None = None
    tries: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for name in self.separate or ():
            if name != NONE and name not in EFFECTS:
                raise CaseError(f"no effect {name!r}; there are {', '.join(EFFECTS)} and {NONE}")
        for name in ("duration", "tries"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                raise CaseError(f"{name}: {value:g} leaves nothing to design; give a positive one")
        if self.separate is not None and self.separate[0] == self.separate[1]:
            raise CaseError(f"{self.separate[0]} cannot be told from itself; name two effects")


def design_experiment(
    identification: Identification,
    request: ExperimentRequest | None = None,
    progress: Progress | None = None,
) -> Design:
    """Design the next experiment of an identified servo axis.

    References (sines, steps, chirps, ...) are tried on the identified model within limits that
    follow from bench and records. The best one either makes the standard errors of an
    output-error fit small, or distinguishes two effects.

    Parameters
    ----------
    identification : Identification
        Of a servo axis with a flow map, see `identify`.
    request : ExperimentRequest, optional
        What differs from the default: small standard errors (D), duration of the first record.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Design
        Reference x_ref [m] at the bench's sampling frequency, its predicted gain, and notes.

    Raises
    ------
    CaseError
        If the axis is no servo axis with a flow map, an effect is unknown, or a common mode is
        asked of one 5/3 valve.
    ModelError
        If its controller is not a proportional one.
    FitError
        If no reference keeps the limits and determines what is asked for.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``, one second from five references:

    >>> design = pc.design_experiment(result, pc.ExperimentRequest(duration=1.0, tries=5))
    >>> design.reference.x_ref.shape, design.gain > 1
    ((5000,), True)
    """
    request = request or ExperimentRequest()
    case, fit = identification.case, identification.output_error
    flow_map, records = identification.flow_map, identification.records
    if not isinstance(case.bench, Bench) or not isinstance(flow_map, FlowMap):
        raise CaseError(
            f"{case.folder}: experiments are designed for servo axes with two equal valves and "
            "one measured flow map only"
        )
    proportional_controller(case.bench)  # any other is refused before the search
    if request.common and case.bench.arrangement is Arrangement.ONE_5_3:
        raise CaseError(
            f"{case.folder}: one 5/3 valve gives chamber N the opposite of chamber P's command: it "
            "allows no common mode; leave out `common`"
        )
    options = _options(case.bench, records, flow_map, request)
    recorded = [recorded_reference(record) for record in records]
    report = progress or no_progress
    notes: list[str] = []
    bound = free_held_by_bounds(fit.axis)
    if request.separate is None:
        notes += [f"{name}: held by a bound, no aim of the design." for name in bound]
        design = design_for_precision(
            fit.axis, recorded, flow_map, fit.sigma, options, request.criterion, progress=report
        )
    else:
        axes = {name: _axis_with(name, identification, notes) for name in request.separate}
        stage = progress_range(report, 0.15, 1.0)
        design = design_to_separate(axes, fit.axis, recorded, flow_map, fit.sigma, options, stage)
    if design.gain < 1:
        notes.append(
            "No reference tried does better than what was recorded: allow more speed, pressure, "
            "time or a common mode, or try more references."
        )
    return replace(design, notes=tuple(notes))


def _options(
    bench: Bench, records: Sequence[Recording], flow_map: FlowMap, request: ExperimentRequest
) -> DesignOptions:
    limits = default_limits(bench, records, float(np.abs(flow_map.u).max()), request.common)
    if request.velocity is not None:
        limits = replace(limits, velocity=request.velocity)
    if request.command is not None:
        limits = replace(limits, command=request.command)
    duration = records[0].duration if request.duration is None else request.duration
    most = PRECISION_TRIES if request.separate is None else SEPARATION_TRIES
    usual = max(FEWEST, round(most * min(1.0, 10.0 / duration)))
    tries = usual if request.tries is None else request.tries
    return DesignOptions(limits, duration, evaluations=tries, seed=request.seed)


def _axis_with(name: str, identification: Identification, notes: list[str]) -> Axis:
    """Return the axis with an effect as a refit of the records finds it."""
    fit = identification.output_error
    if name == NONE:
        return fit.axis
    effect = catalogue_effect(name, identification.flow)
    start = fit.axis.with_effects(effect).at_starting_values(name)
    options = output_error_options(identification.case, identification.options)
    try:
        refit = fit_output_error(start, identification.records, identification.flow_map, options)
    except FitError:
        notes.append(f"{name}: the records do not fit; designed at its starting values.")
        return start
    if _informed(refit, name):
        return refit.axis
    notes.append(f"{name}: the records show none of it; designed at its starting values.")
    return start


def _informed(fit: OutputErrorResult, name: str) -> bool:
    """Tell whether one of an effect's sizes lies three standard deviations from its null value.

    A size that was held was not found in the records.
    """
    sizes = (item for item in fit.parameters if item.name.startswith(f"{name}."))
    return any(
        item.start is not None
        and item.null is not None
        and item.free
        and abs(item.value - item.null) > 3 * fit.std(item.name)
        for item in sizes
    )
