"""The laws that closed the loop around a recorded axis: proportional, nested, one's own, none."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data.bench.pid_controllers import CascadeController, PidController
from pneumo_casadi.data.bench.quantities import check_gains, check_times
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True, slots=True)
class ProportionalController:
    """Proportional feedback of the position on two valves in opposition.

    u_P = u_0 + clip(gain (x_ref − x), ±u_max), u_N = u_0 − clip(...) (section 5 of the paper, with
    u_0 = 0). One five-way valve: u_N = −u_P.

    Parameters
    ----------
    gain : float
        Feedback gain [V/m].
    u_max : float
        Largest command, before the null voltage is added [V].
    u_0 : float, optional
        Null voltage that is added to the command of each valve [V].
    sample_time : float, optional
        Sampling period of the law [s], a whole multiple of the record's step; the commands hold
        in between. By default the record's step.

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
    u_0: float = 0.0
    sample_time: float | None = None
    inputs: ClassVar[tuple[str, ...]] = ("u_P", "u_N")
    closes_loop: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_gains(self, {"gain": "V/m", "u_max": "V"}, {"u_0": "V"})
        _check_limit(self.u_max)
        check_times(self, "sample_time")

    @property
    def limits(self) -> tuple[float, float]:
        """Limits of the command, before the null voltage is added [V]."""
        return -self.u_max, self.u_max

    def command(self, x_ref: ArrayLike, x: ArrayLike, v: ArrayLike = 0.0) -> FloatArray:
        """Return the commands, shape (..., 2), for references and positions [m] of shape (...).

        The velocity `v` [m/s] is not used; it is there so that all controllers are called alike.
        """
        error = np.asarray(x_ref, dtype=float) - np.asarray(x, dtype=float)
        u = np.clip(self.gain * error, -self.u_max, self.u_max)
        return np.stack([self.u_0 + u, self.u_0 - u], axis=-1)


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
    sample_time: ClassVar[None] = None

    def __post_init__(self) -> None:
        check_gains(self, {"k_p": "1/s", "k_v": "V s/m", "gain": "N/V", "u_max": "V"})
        _check_limit(self.u_max)

    def command(self, x_ref: ArrayLike, x: ArrayLike, v: ArrayLike) -> FloatArray:
        """Return the force [N], shape (..., 1), for positions [m] and velocities [m/s]."""
        error = np.asarray(x_ref, dtype=float) - np.asarray(x, dtype=float)
        u = self.k_v * (self.k_p * error - np.asarray(v, dtype=float))
        return self.gain * np.stack([np.clip(u, -self.u_max, self.u_max)], axis=-1)


class CustomController:
    """A law of one's own, as a Python function of CasADi symbols or as a CasADi function.

    At every sample it is called as ``(memory, x_ref, x) -> (u, memory)``. It does not go into
    files: `write_case` and results name no controller in its place.

    Parameters
    ----------
    law : callable or casadi.Function
        The law; `memory` and `u` are columns of as many values as the arguments below say, `x_ref`
        and `x` are scalars [m], `u` has the unit of the inputs.
    memory : sequence of float, optional
        What the law remembers, as it is where a record begins and nothing better is known. The
        values at the beginning of a record are those with which the law gives its commands.
    inputs : sequence of str, optional
        What it sets.
    sample_time : float, optional
        As in `ProportionalController`.

    Raises
    ------
    CaseError
        If the law cannot be called so, or returns other shapes.

    Examples
    --------
    A proportional law with a filter of first order:

    >>> def law(memory, x_ref, x):
    ...     filtered = 0.9 * memory + 0.1 * (x_ref - x)
    ...     return [20 * filtered, -20 * filtered], filtered
    >>> controller = CustomController(law, memory=[0.0])
    >>> u, memory = controller.law(0.0, 0.1, 0.0)
    >>> round(float(memory), 3)
    0.01
    """

    closes_loop: ClassVar[bool] = True

    def __init__(
        self,
        law: "Callable[[ca.SX, ca.SX, ca.SX], tuple[Any, Any]]",
        memory: ArrayLike = (),
        inputs: tuple[str, ...] = ("u_P", "u_N"),
        sample_time: float | None = None,
    ) -> None:
        self.memory: tuple[float, ...] = tuple(np.asarray(memory, dtype=float).ravel())
        self.inputs = tuple(inputs)
        self.sample_time = sample_time
        check_times(self, "sample_time")
        self.law = _as_function(law, len(self.memory), len(self.inputs))


def _as_function(law: Callable[..., Any], n_memory: int, n_inputs: int) -> "ca.Function":
    import casadi as ca  # readers and the virtual bench do without it

    memory, x_ref, x = ca.SX.sym("memory", n_memory), ca.SX.sym("x_ref"), ca.SX.sym("x")
    try:
        u, kept = law(memory, x_ref, x)
        u, kept = (
            ca.vertcat(*value) if isinstance(value, list | tuple) else ca.SX(value)
            for value in (u, kept)
        )
    except Exception as error:  # what a user's function may raise is not known
        raise CaseError(
            f"`controller.law`: {type(error).__name__}: {error}; it is called with CasADi symbols "
            "as (memory, x_ref, x) and returns (u, memory)"
        ) from error
    if u.numel() != n_inputs or kept.numel() != n_memory:
        raise CaseError(
            f"`controller.law`: it returns {u.numel()} commands and {kept.numel()} values of "
            f"memory, expected {n_inputs} and {n_memory}; state `inputs` and `memory` as it has "
            "them"
        )
    return ca.Function("law", [memory, x_ref, x], [ca.densify(u), ca.densify(kept)])


@dataclass(frozen=True, slots=True)
class NoController:
    """No law is known: manual commands, or another program's.

    The axis is fitted and simulated in open loop only, and records need no ``x_ref``.

    Parameters
    ----------
    u_max : float, optional
        Largest command [V]; recorded ones must lie within it.

    Raises
    ------
    CaseError
        If `u_max` is not positive.

    Examples
    --------
    >>> NoController(u_max=5.0).inputs
    ()
    """

    u_max: float | None = None
    inputs: ClassVar[tuple[str, ...]] = ()
    closes_loop: ClassVar[bool] = False
    sample_time: ClassVar[None] = None

    def __post_init__(self) -> None:
        if self.u_max is not None:
            check_gains(self, {}, {"u_max": "V"})
            if self.u_max == 0.0:
                raise CaseError("`controller.u_max`: 0 V moves no valve; give the largest command")
            _check_limit(self.u_max)


#: Any control law that closes the loop of a simulation.
Controller = (
    ProportionalController
    | NestedController
    | PidController
    | CascadeController
    | CustomController
    | NoController
)


def _check_limit(u_max: float) -> None:
    if u_max < 0:
        raise CaseError(
            f"`controller.u_max`: expected a positive limit in V, got {u_max:g}; give its magnitude"
        )
