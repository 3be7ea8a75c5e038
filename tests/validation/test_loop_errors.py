"""The closed loop is judged without a free run, which may have nowhere to go."""

import numpy as np
import pytest

from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.estimation.output_error import initial_states
from pneumo_casadi.validation import validate
from pneumo_casadi.validation.errors import loop_errors, window_errors


def test_loop_and_windows_alone_err_as_in_a_whole_validation(quick):
    axis, records = quick.axis, quick.case.validate
    assert window_errors(axis, records, 0.5) == quick.validation.windows[0.5]
    assert loop_errors(axis, records) == quick.validation.closed_loop


@pytest.mark.slow
def test_a_leak_ends_the_free_run_and_not_the_closed_loop(quick):
    leaky = quick.axis.with_effects(EFFECTS["leakage_P"]())
    leaky = leaky.with_parameters({"leakage_P.C": 5e-9})
    with pytest.raises(PneumoError, match=r"finite|no simulation"):
        validate(leaky, quick.case.validate, ())
    assert np.isfinite(loop_errors(leaky, quick.case.validate)["x"].rms)


@pytest.mark.slow
def test_windows_that_stick_end_where_they_would_with_all_others_at_work(quick, monkeypatch):
    record = quick.case.validate[0]
    given = []
    shoot = initial_states.shoot_and_linearise

    def counted(problem, theta, x_0, sigma):
        given.append(x_0.shape[1])
        return shoot(problem, theta, x_0, sigma)

    monkeypatch.setattr(initial_states, "shoot_and_linearise", counted)
    fewer = initial_states.estimate_initial_states(quick.axis, record, 0.2)
    assert min(given) < max(given)
    given.clear()
    monkeypatch.setattr(initial_states, "SHRUNK", 0.0)
    together = initial_states.estimate_initial_states(quick.axis, record, 0.2)
    assert min(given) == max(given)
    for (first, x_0), (same, expected) in zip(fewer, together, strict=True):
        assert first == same
        np.testing.assert_allclose(x_0, expected, rtol=1e-9, atol=1e-12)
