"""Sampled controllers with an integrator: PID, and a velocity loop within a position loop."""

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

from pneumo_casadi.data.bench.quantities import check_gains, check_times
from pneumo_casadi.errors import CaseError


class AntiWindup(StrEnum):
    """What the integrator does while the command is at its limit."""

    NONE = "none"
    """It goes on."""
    CLAMPING = "clamping"
    """It stands still while its input would drive the command further beyond the limit."""
    BACK_CALCULATION = "back-calculation"
    """What the limit cuts off is fed back to it with the tracking time."""


@dataclass(frozen=True, slots=True)
class PidController:
    """PID control of the position on two valves in opposition.

    At every sample of period T, with e = x_ref − x:

    - d_k = (τ d_{k−1} + e_k − e_{k−1}) / (τ + T), the filtered derivative,
    - w_k = k_p e_k + (I_{k−1} + k_i T e_k) + k_d d_k, u_k = clip(w_k, u_min, u_max),
    - I_k = I_{k−1} + k_i T e_k. With clamping the sum is left out where w_k is beyond a limit and
      k_i e_k points outwards; with back-calculation (T / T_t) (u_k − w_k) is added,
    - u_P = u_0 + u_k, u_N = u_0 − u_k; one five-way valve: u_N = −u_P.

    Parameters
    ----------
    k_p : float
        Proportional gain [V/m].
    u_max : float
        Upper limit of u, before the null voltage is added [V].
    k_i : float, optional
        Integral gain [V/(m s)].
    k_d : float, optional
        Derivative gain [V s/m].
    derivative_filter : float, optional
        Time constant τ of the derivative's filter [s]; 0 for none.
    u_min : float, optional
        Lower limit of u [V]; by default −u_max.
    u_0 : float, optional
        Null voltage that is added to the command of each valve [V].
    anti_windup : AntiWindup, optional
        What the integrator does at the limits.
    tracking_time : float, optional
        T_t of back-calculation [s].
    sample_time : float, optional
        Sampling period of the law [s], a whole multiple of the record's step; the commands hold
        in between. By default the record's step.

    Raises
    ------
    CaseError
        If a value is not possible, or back-calculation has no tracking time.

    Examples
    --------
    >>> PidController(k_p=20.0, u_max=5.0, k_i=10.0, anti_windup="clamping").limits
    (-5.0, 5.0)
    """

    k_p: float
    u_max: float
    k_i: float = 0.0
    k_d: float = 0.0
    derivative_filter: float = 0.0
    u_min: float | None = None
    u_0: float = 0.0
    anti_windup: AntiWindup = AntiWindup.NONE
    tracking_time: float | None = None
    sample_time: float | None = None
    inputs: ClassVar[tuple[str, ...]] = ("u_P", "u_N")
    closes_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_limits(self)
        gains = {"k_i": "V/(m s)", "k_d": "V s/m", "u_0": "V"}
        check_gains(self, {"k_p": "V/m"}, gains)
        check_times(self, "sample_time", "tracking_time")
        check_times(self, "derivative_filter", least=0.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of u (u_min, u_max), before the null voltage is added [V]."""
        return (-self.u_max if self.u_min is None else self.u_min), self.u_max


@dataclass(frozen=True, slots=True)
class CascadeController:
    """A position loop around a PI velocity loop, on two valves in opposition.

    At every sample of period T:

    - v_k = (τ v_{k−1} + x_k − x_{k−1}) / (τ + T), the filtered difference of the position,
    - e_k = clip(k_p (x_ref − x), ±v_max) − v_k,
    - w_k = k_v e_k + (I_{k−1} + k_i T e_k), u_k = clip(w_k, u_min, u_max),
    - I_k, u_P and u_N as in `PidController`.

    Parameters
    ----------
    k_p : float
        Gain of the position loop [1/s].
    k_v : float
        Proportional gain of the velocity loop [V s/m].
    u_max : float
        Upper limit of u, before the null voltage is added [V].
    k_i : float, optional
        Integral gain of the velocity loop [V/m].
    velocity_filter : float, optional
        Time constant τ of the velocity's filter [s]; 0 for none.
    v_max : float, optional
        Limit of the velocity that the position loop demands [m/s]; by default none.
    u_min, u_0, anti_windup, tracking_time, sample_time : optional
        As in `PidController`.

    Raises
    ------
    CaseError
        As in `PidController`.

    Examples
    --------
    >>> CascadeController(k_p=8.0, k_v=2.0, u_max=5.0, k_i=4.0).inputs
    ('u_P', 'u_N')
    """

    k_p: float
    k_v: float
    u_max: float
    k_i: float = 0.0
    velocity_filter: float = 0.0
    v_max: float | None = None
    u_min: float | None = None
    u_0: float = 0.0
    anti_windup: AntiWindup = AntiWindup.NONE
    tracking_time: float | None = None
    sample_time: float | None = None
    inputs: ClassVar[tuple[str, ...]] = ("u_P", "u_N")
    closes_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_limits(self)
        check_gains(self, {"k_p": "1/s", "k_v": "V s/m"}, {"k_i": "V/m", "u_0": "V"})
        if self.v_max is not None:
            check_gains(self, {"v_max": "m/s"})
            if self.v_max < 0:
                raise CaseError(
                    f"`controller.v_max`: expected a positive limit in m/s, got {self.v_max:g}; "
                    "give its magnitude"
                )
        check_times(self, "sample_time", "tracking_time")
        check_times(self, "velocity_filter", least=0.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of u (u_min, u_max), before the null voltage is added [V]."""
        return (-self.u_max if self.u_min is None else self.u_min), self.u_max


def _check_limits(controller: PidController | CascadeController) -> None:
    """Check limits and anti-windup."""
    check_gains(controller, {"u_max": "V"})
    if controller.u_min is not None:
        check_gains(controller, {}, {"u_min": "V"})
    lower, upper = controller.limits
    if not lower < upper:
        raise CaseError(
            f"`controller.u_min`: {lower:g} V is not below u_max = {upper:g} V; give both limits "
            "of u with their signs"
        )
    try:
        object.__setattr__(controller, "anti_windup", AntiWindup(controller.anti_windup))
    except ValueError:
        raise CaseError(
            f"`controller.anti_windup`: got {controller.anti_windup!r}; write "
            f"{' or '.join(repr(str(kind)) for kind in AntiWindup)}"
        ) from None
    back = controller.anti_windup is AntiWindup.BACK_CALCULATION
    if back != (controller.tracking_time is not None):
        raise CaseError(
            "`controller.tracking_time`: back-calculation needs it, other kinds of anti-windup do "
            "not use it; give the time constant T_t with which the integrator follows the limit"
        )
