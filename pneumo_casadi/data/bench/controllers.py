"""The laws that closed the loop around a recorded axis."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data.bench.quantities import as_number
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray


@dataclass(frozen=True, slots=True)
class ProportionalController:
    """Proportional feedback of the position on two valves in opposition.

    u_P = clip(gain (x_ref − x), ±u_max), u_N = −u_P (section 5 of the paper).

    Parameters
    ----------
    gain : float
        Feedback gain [V/m].
    u_max : float
        Largest command [V].

    Raises
    ------
    CaseError
        If the gain is zero or `u_max` is not positive.

    Examples
    --------
    >>> ProportionalController(gain=2.4, u_max=5.0).command(x_ref=0.5, x=0.25, v=0.0)
    array([ 0.6, -0.6])
    """

    gain: float
    u_max: float
    inputs: ClassVar[tuple[str, ...]] = ("u_P", "u_N")
    closes_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_gains(self, {"gain": "V/m"}, u_max="V")

    def command(self, x_ref: ArrayLike, x: ArrayLike, v: ArrayLike = 0.0) -> FloatArray:
        """Return the commands, shape (..., 2), for references and positions [m] of shape (...).

        The velocity `v` [m/s] is not used; it is there so that all controllers are called alike.
        """
        error = np.asarray(x_ref, dtype=float) - np.asarray(x, dtype=float)
        u = np.clip(self.gain * error, -self.u_max, self.u_max)
        return np.stack([u, -u], axis=-1)


@dataclass(frozen=True, slots=True)
class NestedController:
    """Proportional position loop around a proportional velocity loop, with a drive gain.

    F = gain · clip(k_v (k_p (x_ref − x) − v), ±u_max) (Janot, Gautier and Brunot 2019, eq. 6-7).

    Parameters
    ----------
    k_p : float
        Gain of the position loop [1/s].
    k_v : float
        Gain of the velocity loop [V s/m].
    gain : float
        Drive gain [N/V].
    u_max : float
        Largest controller output [V].

    Raises
    ------
    CaseError
        If a gain is zero or `u_max` is not positive.

    Examples
    --------
    >>> NestedController(k_p=100.0, k_v=200.0, gain=35.0, u_max=10.0).command(1e-4, 0.0, 0.0)
    array([70.])
    """

    k_p: float
    k_v: float
    gain: float
    u_max: float
    inputs: ClassVar[tuple[str, ...]] = ("F",)
    closes_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        _check_gains(self, {"k_p": "1/s", "k_v": "V s/m", "gain": "N/V"}, u_max="V")

    def command(self, x_ref: ArrayLike, x: ArrayLike, v: ArrayLike) -> FloatArray:
        """Return the force [N], shape (..., 1), for positions [m] and velocities [m/s]."""
        error = np.asarray(x_ref, dtype=float) - np.asarray(x, dtype=float)
        u = self.k_v * (self.k_p * error - np.asarray(v, dtype=float))
        return self.gain * np.stack([np.clip(u, -self.u_max, self.u_max)], axis=-1)


@dataclass(frozen=True, slots=True)
class NoController:
    """No law is known: manual commands, or another program's.

    The axis is fitted and simulated in open loop only, and records need no ``x_ref``.

    Examples
    --------
    >>> NoController().inputs
    ()
    """

    inputs: ClassVar[tuple[str, ...]] = ()
    closes_loop: ClassVar[bool] = False


Controller = ProportionalController | NestedController | NoController


def _check_gains(controller: Any, gains: dict[str, str], u_max: str) -> None:
    for name, unit in {**gains, "u_max": u_max}.items():
        value = as_number(f"controller.{name}", getattr(controller, name), unit)
        object.__setattr__(controller, name, value)
        if value == 0.0:
            raise CaseError(f"`controller.{name}`: 0 {unit} closes no loop; give the value used")
    if controller.u_max < 0:
        raise CaseError(
            f"`controller.u_max`: expected a positive limit in {u_max}, got {controller.u_max:g}; "
            "give its magnitude"
        )
