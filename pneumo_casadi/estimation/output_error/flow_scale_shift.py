"""How far the records move the scale of the flows that they use from what the map alone says.

Records tell the shape of the flow, the map its scale. Where the form of the map holds, the map
fitted alone and the joint fit agree on the flows that the records use. Where it does not, the
records bend the form to their flows, which are small, and the large metered flows give the scale
to another part of it. The difference of both estimates, beyond what the noise of the map makes,
shows the size of this bias (the contrast of Hausman's specification test [1]_).

References
----------
.. [1] J. A. Hausman, "Specification tests in econometrics", Econometrica 46 (1978), 1251-1271.
"""

from collections.abc import Sequence

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from pneumo_casadi.data import Recording
from pneumo_casadi.estimation.flow_anchor import Anchor
from pneumo_casadi.estimation.output_error.shooting.problem import Problem
from pneumo_casadi.estimation.static_flow import static_flow
from pneumo_casadi.model.along_record import evaluated_without_compiling
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.parameters import FloatArray, Parameters
from pneumo_casadi.valve import FlowPair
from pneumo_casadi.valve.flow_pair import valve_of

#: Samples of a record that tell which flows it uses.
SAMPLES = 4000
#: Directions of the coefficients weaker than this share of the strongest are not told by the map.
RANK_TOLERANCE = 1e-12
#: Step of difference quotients, in units of the scale of a coefficient.
DIFFERENCE = 1e-5
#: Parameters of a chamber that its flow is proportional to (eq. 1).
CHAMBERS = {"P": ("X_s1", "X_s2", "X_s3"), "N": ("X_s4", "X_s5", "X_s6")}


def flow_scale_shift(
    problem: Problem, theta: FloatArray, records: Sequence[Recording]
) -> FloatArray:
    """Return the shift of the estimates along the scale of the flows.

    Parameters
    ----------
    problem : Problem
        With the flow map as its anchor.
    theta : (n,) array
        Its solution.
    records : sequence of Recording
        Their commands and pressures weigh the flows.

    Returns
    -------
    (n_free,) array
        In scaled free parameters: X_s and the flow coefficients of each valve times the relative
        difference of the flows beyond that of noise; zero without a metered map, and where an X_s
        of the valve is held, which then gives the scale.
    """
    shift = np.zeros(len(problem.free))
    anchor, axis = problem.anchor, problem.axis
    if anchor is None or anchor.scatter is None:
        return shift
    fitted = problem.parameters.with_values(theta)
    alone = _fit_map_alone(anchor, fitted)
    free = dict(zip(problem.free, range(shift.size), strict=True))
    for chambers in ("P", "N") if isinstance(axis.flow, FlowPair) else ("PN",):
        own = [name for chamber in chambers for name in CHAMBERS[chamber]]
        if not free.keys() >= set(own):
            continue
        flows, expected = (_flows(axis, records, values, chambers) for values in (fitted, alone))
        difference = float(flows @ expected / (expected @ expected)) - 1
        difference = _beyond(difference, _scale_variance(anchor, axis, records, alone, chambers))
        for name in own:
            shift[free[name]] = difference * fitted[name].value / problem.free_scales[free[name]]
        coefficients = [name for name in _coefficients(axis, chambers[0])[1] if name in free]
        at = [free[name] for name in coefficients]
        slopes, modelled = _scale_problem(anchor, fitted, coefficients)
        direction = np.linalg.lstsq(slopes * problem.free_scales[at], modelled, rcond=None)[0]
        shift[at] = difference * direction
    return shift


def _beyond(difference: float, variance: float) -> float:
    """Return the part of a difference that noise of this variance does not make."""
    return float(np.copysign(np.sqrt(max(difference**2 - variance, 0.0)), difference))


def _scale_variance(
    anchor: Anchor,
    axis: Axis,
    records: Sequence[Recording],
    alone: Parameters,
    chambers: str,
) -> float:
    """Return the variance of the relative flows of the records by the noise of the map alone.

    The joint fit, which knows the map and the records, has next to none beside it.
    """
    assert anchor.scatter is not None
    names = [name for name in anchor.names if name in alone.free_names]
    at = [anchor.names.index(name) for name in names]
    J = np.asarray(anchor.scatter(alone.select(anchor.names).values)[1], dtype=float)[:, at]
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    C = np.linalg.pinv((J / size).T @ (J / size), rcond=RANK_TOLERANCE, hermitian=True)
    known = np.linalg.norm(J, axis=0) > 0
    expected = _flows(axis, records, alone, chambers, SAMPLES)
    gradient = np.zeros(len(names))
    for i, item in enumerate(alone.select(names)):
        if not known[i]:  # no metered point depends on it
            continue
        step = (
            DIFFERENCE
            * item.scale
            * (1 if item.value + DIFFERENCE * item.scale < item.upper else -1)
        )
        changed = alone.with_values({item.name: item.value + step})
        change = _flows(axis, records, changed, chambers, SAMPLES) - expected
        gradient[i] = change @ expected / (expected @ expected) / step
    gradient = gradient / size
    variance = float(gradient @ C @ gradient)
    return variance if np.isfinite(variance) else 0.0


def _fit_map_alone(anchor: Anchor, fitted: Parameters) -> Parameters:
    """Return the parameters with the free coefficients that fit the metered points best."""
    assert anchor.scatter is not None
    scatter = anchor.scatter
    free = [name for name in anchor.names if name in fitted.free_names]
    own = fitted.select(free)
    at = [anchor.names.index(name) for name in free]
    c = fitted.select(anchor.names).values

    def evaluate(z: FloatArray, output: int) -> FloatArray:
        c[at] = z * own.scales
        return np.asarray(scatter(c)[output], dtype=float)

    def residuals(z: FloatArray) -> FloatArray:
        return evaluate(z, 0).ravel()

    def jacobian(z: FloatArray) -> FloatArray:
        return np.asarray(evaluate(z, 1)[:, at] * own.scales)

    start = np.clip(anchor.fitted[at], own.lower, own.upper) / own.scales
    bounds = (own.lower / own.scales, own.upper / own.scales)
    solution = least_squares(residuals, start, jac=jacobian, bounds=bounds)
    return fitted.with_values(dict(zip(free, solution.x * own.scales, strict=True)))


def _flows(
    axis: Axis,
    records: Sequence[Recording],
    parameters: Parameters,
    chambers: str,
    samples: int | None = None,
) -> FloatArray:
    """Return the static flows at the commands and pressures of the records [kg/s].

    With `samples`, at about so many of each record at least, evenly spaced.
    """
    flows = []
    for chamber in chambers:
        function, names = _coefficients(axis, chamber)
        static, c = evaluated_without_compiling(function), parameters.select(names).values
        for record in records:
            every = 1 if samples is None else max(1, record.N // samples)
            u, p = (record[f"{name}_{chamber}"][None, ::every] for name in ("u", "p"))
            flows.append(static.evaluate(u.shape[1], u, p, c)[0].ravel())
    return np.concatenate(flows)


def _coefficients(axis: Axis, chamber: str) -> tuple[ca.Function, tuple[str, ...]]:
    """Return the static flow of a chamber's valve, and its coefficients as the axis names them."""
    model, rows = valve_of(axis.flow, chamber)
    function, names = static_flow(model, axis.effects)
    return function, (*axis.flow.parameters.names[rows], *names[len(model.parameters) :])


def _scale_problem(
    anchor: Anchor, fitted: Parameters, names: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the metered points to coefficients, and the flows there, over σ.

    The combination of the former that gives the latter is the direction of a common factor.
    """
    assert anchor.scatter is not None
    c = fitted.select(anchor.names).values
    residual, slopes = (np.asarray(part, dtype=float) for part in anchor.scatter(c))
    nothing = np.asarray(anchor.scatter(np.zeros_like(c))[0], dtype=float)
    return slopes[:, [anchor.names.index(name) for name in names]], (residual - nothing).ravel()
