"""The covariance agrees with brute force: finite differences of a whole record, Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest

from pneumo_casadi.data import Recording, ValveData, Valves
from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
from pneumo_casadi.estimation.output_error.solvers.multiple_shooting import solve_gauss_newton
from pneumo_casadi.estimation.output_error.stages import _with_scale_uncertainty, write_problem


def brute_force(made, result, u, names, fixed_sigma):
    """(JᵀJ)⁻¹ of all samples, initial state among the unknowns, simulated step by step."""
    axis = result.axis
    (segment,) = result.segments
    count = segment.n * segment.K
    x_0 = result.initial_states[0]
    scales = np.concatenate([axis.state_scales, axis.parameters.select(names).scales])

    def outputs(z):
        values = dict(zip(names, z[x_0.size :] * scales[x_0.size :], strict=True))
        moved = axis.with_parameters(axis.parameters.with_values(values))
        path = made.steps(moved, u, z[: x_0.size] * axis.state_scales, substeps=1)[:, :count]
        rows = [axis.states.index(n) for n in axis.outputs]
        mean = path[rows].reshape(len(rows), segment.K, segment.n).mean(axis=2)
        return (mean / fixed_sigma[:, None] * np.sqrt(segment.n)).ravel()

    z = np.concatenate([x_0, [axis.parameters[n].value for n in names]]) / scales
    J = []
    for i in range(z.size):
        h = np.zeros(z.size)
        h[i] = 1e-5
        J.append((outputs(z + h) - outputs(z - h)) / 2e-5)
    J = np.array(J).T
    C = np.linalg.inv(J.T @ J)[x_0.size :, x_0.size :]
    return C * np.outer(scales[x_0.size :], scales[x_0.size :])


@pytest.mark.slow
def test_the_covariance_is_that_of_a_finite_difference_jacobian_of_the_record(made, servo):
    axis, u, x = servo
    u, x = u[:801], x[:, :801]
    names = ("X_s1", "X_s5", "M", "f_v", "F_c_plus", "F_c_minus", "psi_plus_1")
    axis = made.free_only(axis, *names)
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],), block=4e-3)
    result = fit_output_error(axis, [made.recorded(axis, u, x, 0)], None, options)
    wanted = brute_force(made, result, u, result.uncertainty.names, result.sigma)
    size = np.sqrt(np.diag(wanted))
    np.testing.assert_allclose(result.uncertainty.std, size, rtol=2e-3)
    found = result.uncertainty.correlation
    np.testing.assert_allclose(found, wanted / np.outer(size, size), atol=2e-3)


@pytest.mark.slow
def test_the_map_adds_its_own_information(made, servo, start):
    axis, u, x = servo
    record = made.recorded(axis, u[:800], x[:, :800], 0)
    table, begin = start(0)
    names = begin.flow.parameters.names
    begin = made.free_only(begin, *names)
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    alone = np.linalg.inv(begin.flow.covariance)
    both = np.linalg.inv(fit_output_error(begin, [record], table, options).uncertainty.covariance)
    data = np.linalg.inv(fit_output_error(begin, [record], None, options).uncertainty.covariance)
    size = np.sqrt(np.outer(np.diag(both), np.diag(both)))
    np.testing.assert_allclose(both / size, (alone + data) / size, atol=0.03)


@pytest.mark.slow
def test_monte_carlo_scatters_as_the_covariance_says(made, force):
    axis, u, x = force
    u, x = u[:300], x[:, :300]
    axis = made.free_only(axis, "M", "f_v", "F_c_plus")
    # With the noise as stated: the functions of a fit, which take the longest, are written once.
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],), reweight=False)
    records = [made.recorded(axis, u, x, seed) for seed in range(60)]
    reported = fit_output_error(axis, records[:1], None, options).uncertainty
    names, reported = reported.names, reported.covariance
    problem = write_problem(axis, records[:1], None, options)
    (segment,) = problem.segments
    sigma, estimates = np.array([axis.bench.noise.x]), []
    for record in records:
        blocks = record["x"][: segment.K * segment.n].reshape(1, segment.K, segment.n)
        disturbed = replace(problem, segments=(replace(segment, y=blocks.mean(axis=2)),))
        found = solve_gauss_newton(disturbed, problem.start(), sigma, reweight=False)
        assert found.status == "converged"
        estimates.append(found.point.theta[problem.parameters.free_mask])
    estimates = np.array(estimates)
    np.testing.assert_allclose(
        estimates.std(axis=0, ddof=1) / np.sqrt(np.diag(reported)), 1.0, atol=0.25
    )
    truth = [made.FORCE_TRUE[n] for n in names]
    bias = (estimates.mean(axis=0) - truth) / np.sqrt(np.diag(reported)) * np.sqrt(len(records))
    assert np.all(np.abs(bias) < 4)
    found = np.corrcoef(estimates.T)
    wanted = reported / np.sqrt(np.outer(np.diag(reported), np.diag(reported)))
    np.testing.assert_allclose(found, wanted, atol=0.2)


@pytest.mark.slow
def test_robust_intervals_equal_the_plain_ones_on_white_noise_and_widen_on_coloured(made, force):
    axis, u, x = force
    options = OutputErrorOptions(widths=(made.TRUE["v_s"],))
    white = fit_output_error(axis, [made.recorded(axis, u, x, 0)], None, options)
    rng = np.random.default_rng(0)
    e = rng.standard_normal(len(u) + 60)
    slow = np.convolve(e, np.exp(-np.arange(60) / 15.0), "valid")[: len(u)]
    channels = {"x": x[0] + 2e-6 * slow / slow.std(), "F": u[:, 0]}
    record = Recording(
        np.arange(len(u)) / made.FS, channels, "coloured", "made", made.InputHold.ZERO
    )
    coloured = fit_output_error(axis, [record], None, options)
    share = white.uncertainty.std_scatter / white.uncertainty.std
    assert np.all((share > 0.5) & (share < 1.7))
    assert np.all(coloured.uncertainty.std_scatter > 1.5 * coloured.uncertainty.std)
    d = np.array(
        [coloured.parameters[n].value - made.FORCE_TRUE[n] for n in coloured.uncertainty.names]
    )
    assert np.all(np.abs(d) < 5 * coloured.uncertainty.std_scatter)


def test_robust_intervals_contain_the_shift_that_twice_the_friction_width_makes(made, force):
    axis, u, x = force
    record = made.recorded(axis, u, x, 0)
    width = made.TRUE["v_s"]
    narrow, wide = (
        fit_output_error(axis, [record], None, OutputErrorOptions(widths=(w,), reweight=False))
        for w in (width, 2 * width)
    )
    known = narrow.uncertainty
    bias = np.sqrt(known.std_robust**2 - known.std_scatter**2)
    shift = np.array(
        [abs(wide.parameters[n].value - narrow.parameters[n].value) for n in known.names]
    )
    assert np.any(shift > 2 * known.std_scatter)  # otherwise nothing is compared
    assert np.all(np.abs(bias - shift) < 0.25 * shift + 0.2 * known.std_scatter)


def test_derived_quantities_carry_the_covariance_through_their_own_gradients(made, fitted):
    """Values by eq. 9-11, standard deviations by finite differences of the same formulas."""
    names, bench = fitted.uncertainty.names, made.BENCH
    rT = bench.r * bench.T
    formulas = {
        "k_P": lambda p: p["X_s3"] / p["X_s2"],
        "k_N": lambda p: p["X_s6"] / p["X_s5"],
        "V_P(0)": lambda p: p["X_s1"] * p["X_s3"] / p["X_s2"] * rT,
        "V_N(0)": lambda p: p["X_s4"] * p["X_s6"] / p["X_s5"] * rT,
        "S_P": lambda p: p["X_s3"] * rT,
        "S_N": lambda p: p["X_s6"] * rT,
        "V_DP": lambda p: (p["X_s1"] / p["X_s2"] - bench.stroke / 2) * p["X_s3"] * rT,
        "V_DN": lambda p: (p["X_s4"] / p["X_s5"] - bench.stroke / 2) * p["X_s6"] * rT,
        "l_DP": lambda p: p["X_s1"] / p["X_s2"] - bench.stroke / 2,
        "l_DN": lambda p: p["X_s4"] / p["X_s5"] - bench.stroke / 2,
        "F_c": lambda p: (p["F_c_plus"] + p["F_c_minus"]) / 2,
        "F_offset": lambda p: (p["F_c_plus"] - p["F_c_minus"]) / 2,
    }
    assert set(formulas) == set(fitted.derived)
    values = fitted.parameters.as_dict()
    for name, formula in formulas.items():
        assert fitted.derived[name].value == pytest.approx(formula(values), rel=1e-12)
        gradient = []
        for n in names:
            h = 1e-5 * abs(values[n])
            gradient.append(
                (formula(values | {n: values[n] + h}) - formula(values | {n: values[n] - h}))
                / (2 * h)
            )
        estimate, found, g = fitted.uncertainty, fitted.derived[name], np.array(gradient)
        for std, C in (
            (found.std, estimate.covariance),
            (found.std_robust, estimate.covariance_robust),
        ):
            assert std == pytest.approx(np.sqrt(g @ C @ g), rel=1e-5), name


def test_a_map_that_is_held_is_as_uncertain_as_its_meter(quick):
    valve = ValveData(accuracy=0.02)
    bench = replace(quick.case.bench, valves=Valves(valve, valve))
    fitted = replace(quick.output_error, axis=replace(quick.axis, bench=bench))
    assert _with_scale_uncertainty(fitted) is fitted  # its anchor knows the meter
    known = fitted.uncertainty
    own = [name for name in known.names if name not in fitted.axis.flow_parameters]
    at = np.ix_(*2 * [[known.names.index(name) for name in own]])
    parts = ("covariance", "covariance_robust", "covariance_scatter")
    cut = {part: getattr(known, part)[at] for part in parts if getattr(known, part) is not None}
    held = replace(fitted, uncertainty=replace(known, names=tuple(own), **cut))
    wider = _with_scale_uncertainty(held)
    for robust in (False, True):
        added = {n: np.sqrt(wider.std(n, robust) ** 2 - held.std(n, robust) ** 2) for n in own}
        assert added["M"] == 0.0
        assert added["X_s3"] == pytest.approx(0.02 * held.parameters["X_s3"].value, rel=1e-3)
    assert wider.std("S_P") > 0.02 * wider.derived["S_P"].value  # what follows from it as well
