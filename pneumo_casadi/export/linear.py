"""Linearisation at an operating point: ẋ = A x + B u, y = C x + D u in small deviations."""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy.io

from pneumo_casadi.data import Arrangement
from pneumo_casadi.errors import MissingExtraError, ModelError
from pneumo_casadi.export.model import (
    IdentifiedModel,
    balanced_state,
    description,
    identifier,
    require_rates,
)
from pneumo_casadi.export.operating_range import require_in_range, require_possible
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.json_files import json_text
from pneumo_casadi.runtime.output_folder import write_files

#: Within this time a rate of one state scale a second counts; a rest is found to 1e-9 of it [s].
_TIME = 0.1
_TOLERANCE = 1e-9
#: From wide friction to the axis' own, where the velocity is looked for.
_WIDTHS = (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4)


@dataclass(frozen=True, slots=True, eq=False)
class OperatingPoint:
    """Where an axis is linearised.

    Parameters
    ----------
    x : (nx,) array
        States, SI units.
    u : (nu,) array
        Inputs [V or N].
    """

    x: FloatArray
    u: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LinearAxis:
    """An axis in small deviations from an operating point.

    Parameters
    ----------
    A, B, C, D : arrays (nx, nx), (nx, nu), (ny, nx), (ny, nu)
        Matrices in SI units.
    point : OperatingPoint
        What the deviations are counted from.
    states, inputs, outputs : tuple of str
        Names, as identifiers.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    point: OperatingPoint
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def state_space(self) -> Any:
        """Return it as ``control.StateSpace`` with its names.

        Raises
        ------
        MissingExtraError
            If the package `control` is not installed.
        """
        try:
            import control
        except ImportError:
            raise MissingExtraError(
                "state_space needs python-control: pip install 'pneumo-casadi[export]'"
            ) from None
        names = {
            "states": list(self.states),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
        }
        return control.StateSpace(self.A, self.B, self.C, self.D, **names)


def operating_point(axis: Axis, given: Mapping[str, float] | None = None) -> OperatingPoint:
    """Find states and inputs at which an axis rests, or moves steadily.

    Parameters
    ----------
    axis : Axis
        With its parameters.
    given : mapping of str to float, optional
        States and inputs that are held, by name, SI units. The others are such that all states
        but the position keep their values: pressures, velocity, the states of effects. Not
        given, x is 0; v is 0 unless a command is given (of pressures that drive an axis, both);
        u_N is -u_P unless one of them is given, of one 5/3 valve always; a recorded supply or
        load is as at rest.
        If all of ``p_P, p_N, x, v`` and the inputs are given, the point is used unchanged, at
        rest or not; the states of effects are at rest there.

    Raises
    ------
    ModelError
        If a name is unknown, what is given contradicts itself, a state jumps at samples, or the
        point lies beyond the stroke, the commands or the pressures that the axis can have.

    Examples
    --------
    >>> from pneumo_casadi.data import ForceBench, NestedController
    >>> from pneumo_casadi.model.servosystem import ForceAxis
    >>> axis = ForceAxis(ForceBench(1e3, 0.5, NestedController(30.0, 60.0, 1.0, 60.0)))
    >>> point = operating_point(axis, {"v": 0.1})
    >>> point.x.tolist(), point.u.round(6).tolist()  # f_v v + F_c = 2 + 15 N
    ([0.0, 0.1], [17.0])
    """
    require_rates(axis, "an operating point")
    held = {name: float(value) for name, value in (given or {}).items()}
    known = (*axis.states, *axis.inputs)
    unknown = sorted(set(held) - set(known))
    if unknown:
        raise ModelError(f"no state or input {', '.join(unknown)}; there are {', '.join(known)}")
    if not all(np.isfinite(value) for value in held.values()):
        raise ModelError(f"operating point {held}: give finite numbers, SI units")
    require_in_range(axis, held)
    both = {"u_P", "u_N"} <= held.keys()
    if both and _has_one_valve(axis) and held["u_P"] != -held["u_N"]:
        raise ModelError("one 5/3 valve gives chamber N the command -u_P: leave out u_N")
    if set(axis.motion_states) <= held.keys() and set(axis.inputs) <= held.keys():
        u = np.array([held[name] for name in axis.inputs])
        motion = [held[name] for name in axis.motion_states]
        x = np.asarray(axis.rest(motion, u, axis.parameters.values), dtype=float).ravel()
        at = {name: i for i, name in enumerate(axis.states)}
        for name in held.keys() & at.keys():
            x[at[name]] = held[name]
        require_possible(axis, x, u)
        return OperatingPoint(x, u)
    held.setdefault("x", 0.0)
    commands = held.keys() & set(axis.kind.commands)
    # One command of a valve moves the axis; one of two pressures asks for the other at rest.
    if not commands or (axis.kind.measured_inputs and len(commands) < len(axis.kind.commands)):
        held.setdefault("v", 0.0)
    point = _search(axis, held)
    require_possible(axis, point.x, point.u)
    return point


def linearise(axis: Axis, point: OperatingPoint | None = None) -> LinearAxis:
    """Linearise an axis.

    Parameters
    ----------
    axis : Axis
        With its parameters.
    point : OperatingPoint, optional
        Where; by default at rest in mid-stroke.

    Raises
    ------
    ModelError
        If there is no rest, the axis cannot be at the point, a derivative is not finite there, or a
        state jumps at samples.

    Notes
    -----
    At standstill the smoothed friction is a damper of (F_c⁺ + F_c⁻) / (2 v_s) N s/m: the axis
    sticks. For a moving axis give its velocity. At u = 0 the flow has a kink; the derivative
    there is that of neither side.
    """
    require_rates(axis, "a linear state space")
    at = point or operating_point(axis)
    require_possible(axis, at.x, at.u)
    theta = axis.parameters.values
    matrices = [np.asarray(m, dtype=float) for m in _jacobians(axis)(at.x, at.u, theta)]
    if not all(np.isfinite(m).all() for m in matrices):
        raise ModelError("the axis' derivatives are not finite there; move the operating point")
    names = [tuple(map(identifier, n)) for n in (axis.states, axis.inputs, axis.outputs)]
    A, B, C, D = matrices
    return LinearAxis(A, B, C, D, at, *names)


def write_state_space(
    model: IdentifiedModel, folder: str | Path, given: Mapping[str, float] | None = None
) -> tuple[Path, ...]:
    """Write ``axis_ss.json`` and ``axis_ss.mat``: A, B, C, D, operating point, names, units.

    Parameters
    ----------
    model : IdentifiedModel
        What to linearise.
    folder : path
        Where the files go; those of an earlier export are replaced.
    given : mapping of str to float, optional
        See `operating_point`.

    Returns
    -------
    tuple of Path
        Both files.
    """
    linear = linearise(model.axis, operating_point(model.axis, given))
    matrices = {name: getattr(linear, name).tolist() for name in "ABCD"}
    point = {"x": linear.point.x.tolist(), "u": linear.point.u.tolist()}
    content = {**description(model), **matrices, "operating_point": point}
    buffer: Any = io.BytesIO()
    arrays = {name: getattr(linear, name) for name in "ABCD"}
    arrays |= {"x0": linear.point.x[:, None], "u0": linear.point.u[:, None]}
    for kind in ("states", "inputs", "outputs"):
        arrays[kind] = np.array(getattr(linear, kind), dtype=object)
    scipy.io.savemat(buffer, arrays, oned_as="column")
    text = json_text(content)
    return write_files({"axis_ss.json": text, "axis_ss.mat": buffer.getvalue()}, folder)


def _jacobians(axis: Axis) -> ca.Function:
    """Return (x, u, θ) → A, B, C, D."""
    sym = axis.symbol.sym
    x, u = sym("x", len(axis.states)), sym("u", len(axis.inputs))
    theta = sym("theta", len(axis.parameters))
    rows = [axis.rhs(x, u, theta), axis.output(x, u, theta)]
    jacobians = [ca.densify(ca.jacobian(row, by)) for row in rows for by in (x, u)]
    return ca.Function("jacobians", [x, u, theta], jacobians)


def _has_one_valve(axis: Axis) -> bool:
    return getattr(axis.bench, "arrangement", None) is Arrangement.ONE_5_3


def _search(axis: Axis, held: Mapping[str, float]) -> OperatingPoint:
    """Solve for all that is not held by damped Gauss-Newton steps of least length."""
    names = (*axis.states, *axis.inputs)
    z = np.concatenate([balanced_state(axis), axis.inputs_at_rest])
    scales = np.concatenate([axis.state_scales, np.ones(len(axis.inputs))])
    for name, value in held.items():
        z[names.index(name)] = value
    known = {*held, *set(axis.inputs) - set(axis.kind.commands)}  # a supply, a force on the rod
    free = [i for i, name in enumerate(names) if name not in known]
    widths: list[float] = []
    if "v" not in held:
        own = axis.parameters["v_s"].value
        widths = [width for width in _WIDTHS if width > own]
    residual = _Residual(axis, _has_one_valve(axis) or not {"u_P", "u_N"} & set(held))
    for width in (*widths, None):
        theta = axis.parameters.as_dict() | ({} if width is None else {"v_s": width})
        z = _descend(residual, z, np.array(list(theta.values())), free, scales)
    r, _ = residual(z, axis.parameters.values)
    if not np.abs(r).max(initial=0.0) < _TOLERANCE:
        worst = int(np.abs(r).argmax())
        raise ModelError(
            f"no operating point with {', '.join(f'{k} = {v:g}' for k, v in held.items())} (SI "
            f"units): {residual.names[worst]} stays at {r[worst]:.3g} of its scale; give other "
            "values, or fewer of them"
        )
    nx = len(axis.states)
    return OperatingPoint(z[:nx], z[nx:])


class _Residual:
    """Scaled rates of all states but the position; where asked for, also u_P + u_N."""

    def __init__(self, axis: Axis, opposed: bool) -> None:
        self._f, self._jacobians = axis.rhs, _jacobians(axis)
        self._nx = len(axis.states)
        self._rows = [i for i, name in enumerate(axis.states) if name != "x"]
        self._scales = axis.state_scales[self._rows] / _TIME
        commands = {"u_P", "u_N"}
        self._opposed = opposed and commands <= set(axis.inputs)
        self._commands = np.array([float(name in commands) for name in axis.inputs])
        self.names = [f"the rate of {axis.states[i]}" for i in self._rows]
        if self._opposed:
            self.names.append("u_P + u_N")

    def __call__(self, z: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, u = z[: self._nx], z[self._nx :]
        r = np.asarray(self._f(x, u, theta), dtype=float).ravel()[self._rows] / self._scales
        A, B, *_ = (np.asarray(m, dtype=float) for m in self._jacobians(x, u, theta))
        J = np.hstack([A, B])[self._rows] / self._scales[:, None]
        if self._opposed:
            r = np.append(r, self._commands @ u)
            J = np.vstack([J, np.concatenate([np.zeros(self._nx), self._commands])])
        return r, J


def _descend(
    residual: _Residual, z: FloatArray, theta: FloatArray, free: list[int], scales: FloatArray
) -> FloatArray:
    r, J = residual(z, theta)
    for _ in range(100):
        if not free or np.abs(r).max(initial=0.0) < 1e-3 * _TOLERANCE:
            break
        step, *_ = np.linalg.lstsq(J[:, free] * scales[free], -r, rcond=1e-12)
        share = 1.0
        while share > 1e-6:
            ahead = z.copy()
            ahead[free] += share * scales[free] * step
            r_ahead, J_ahead = residual(ahead, theta)
            if np.isfinite(J_ahead).all() and r_ahead @ r_ahead < r @ r:
                break
            share /= 2
        else:
            break
        z, r, J = ahead, r_ahead, J_ahead
    return z
