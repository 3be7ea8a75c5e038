"""How an output-error problem is set up and solved, and by which stages."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.stepping import ACCURATE

#: Windows through which a fit is recovered are at most this long [s].
RECOVERY_WINDOW = 0.5


class Method(Enum):
    """Solver of the output-error problem; both find the same optimum."""

    GAUSS_NEWTON = "condensed Gauss-Newton"
    IPOPT = "IPOPT with a Gauss-Newton Hessian"


@dataclass(frozen=True, slots=True)
class OutputErrorOptions:
    """How an output-error problem is set up and solved.

    Parameters
    ----------
    method : Method
        Solver.
    block : float
        Length of a block [s]. Measured and simulated outputs are averaged over the same samples
        of each block, and the means are compared. Choose it short compared with the time
        constants of the fastest motion of interest.
    window : float, optional
        Longest stretch with one initial state [s]; None for the whole record.
    interval : float
        Longest distance between two shooting nodes [s]. Short intervals converge from worse
        starting values, long intervals need less memory; the optimum is the same.
    closed_loop : bool
        Whether the simulation computes the inputs with the bench's controller from the recorded
        reference, instead of using the recorded inputs. The simulated position then does not
        drift, and sensor noise that the controller feeds into the inputs causes no bias. The
        information in the recorded inputs is not used.
    widths : tuple of float
        Widths v_s of the smoothed sign of the velocity, tanh(v/v_s), for consecutive stages
        [m/s]. The last width determines the bias: with a smoothed sign the axis creeps instead of
        sticking, which biases the viscous friction.
    reweight : bool
        Estimate the standard deviation of each output from its residuals in the last stage. If
        the model does not fit, this lowers the weight of the trajectories relative to that of the
        measured flow map.
    max_iterations : int
        Largest number of iterations in each stage.
    recover : bool
        If the requested stages fail, fit short windows with a wider smoothed sign first, and start
        the requested fit again from their result.
    longest_step : float
        Longest Runge-Kutta step times the fastest rate of the axis, at standstill; see
        `substeps_for`.

    Raises
    ------
    ModelError
        If a length or a width is not positive.

    Examples
    --------
    Windows of half a second, and one width of the smoothed friction:

    >>> options = OutputErrorOptions(window=0.5, widths=(3e-4,))
    >>> options.method.value, options.closed_loop
    ('condensed Gauss-Newton', False)
    """

    method: Method = Method.GAUSS_NEWTON
    block: float = 2e-3
    window: float | None = None
    interval: float = 0.1
    closed_loop: bool = False
    widths: tuple[float, ...] = (1e-4,)
    reweight: bool = True
    max_iterations: int = 150
    recover: bool = True
    longest_step: float = ACCURATE

    def __post_init__(self) -> None:
        window = np.inf if self.window is None else self.window
        lengths = {"block": self.block, "window": window, "interval": self.interval}
        if not (self.widths and all(v > 0 for v in (*lengths.values(), *self.widths))):
            listed = ", ".join(f"{name} {value:g} s" for name, value in lengths.items())
            raise ModelError(f"{listed} and friction widths {self.widths} m/s must be positive")


def narrowed_to(width: float | None) -> tuple[float, ...]:
    """Return the widths of stages that end at a width [m/s], by default at the usual one.

    Examples
    --------
    >>> narrowed_to(5e-6), narrowed_to(1e-3), narrowed_to(None)
    ((0.0001, 5e-06), (0.001,), (0.0001,))
    """
    usual = OutputErrorOptions().widths
    if width is None:
        return usual
    return (*usual, width) if width < usual[-1] else (width,)


@dataclass(frozen=True, slots=True)
class StagePlan:
    """One stage: its options and whether its solution is the answer."""

    name: str
    options: OutputErrorOptions
    refine: bool
    last: bool


def plan_stages(options: OutputErrorOptions) -> tuple[StagePlan, ...]:
    """Return the stages in order: as asked for first, and a gentler way for when that fails.

    The gentler way, where it is wanted, goes through short windows, in which no trajectory can
    drift away, from wide friction to narrow, and from there to the horizon asked for.
    """
    horizon = "whole record" if options.window is None else f"windows of {options.window:g} s"

    def rungs(window: float | None, widths: Sequence[float], where: str) -> list[StagePlan]:
        return [
            StagePlan(
                f"{where}, friction width {width * 1e3:g} mm/s",
                replace(options, window=window, widths=(width,)),
                refine=options.reweight and window == options.window,
                last=window == options.window and width == options.widths[-1],
            )
            for width in widths
        ]

    direct = rungs(options.window, options.widths, horizon)
    if not options.recover:
        return tuple(direct)
    short = min(RECOVERY_WINDOW, options.window or np.inf) / 2
    gentle = rungs(short, (10 * options.widths[-1], options.widths[-1]), f"windows of {short:g} s")
    return (*direct, *gentle, *rungs(options.window, options.widths[-1:], f"{horizon}, again"))
