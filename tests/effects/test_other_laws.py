"""Forms fitted to records of the virtual bench, whose laws are others: the sizes come out right."""

import pytest

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.effects import EFFECTS

#: Of each form: what the bench is asked for, and parameters with the tolerance that another law
#: leaves them.
CASES = {
    # The bench's film grows with the speed to two thirds, so that v_st is no v_s.
    "stribeck_film": (
        {"delta_F": 15.0, "v_s": 0.03, "tau": 0.15},
        {"delta_F": (15.0, 3.0), "tau": (0.15, 0.03)},
    ),
    # A score with edges, 6 cm long and 1 cm from the middle of a stroke of 0.4 m.
    "piston_seal_leakage_scored": (
        {"q": 5e-4, "centre": -0.01, "half": 0.03},
        {"s": (-0.025, 0.02), "w": (0.075, 0.02)},
    ),
    # Contacts of the bench bounce and never pull, which makes a play seem narrower by a third.
    "backlash_before_load": (
        {"gap": 3e-3, "m_2": 9.0},
        {"gap": (2.0e-3, 5e-4), "m_2": (9.0, 2.5)},
    ),
    "position_on_load_with_play": ({"gap": 2e-3}, {"gap": (2e-3, 4e-4), "s": (0.3, 0.15)}),
    # The bench's edges have critical ratios of their own, and exponents near one half.
    "flow_map_shape_fittings": ({"b": 0.15}, {"beta": (0.15, 0.05)}),
}
#: Forms that the bench calls otherwise.
ON_THE_BENCH = {
    "backlash_before_load": "backlash_two_masses",
    "position_on_load_with_play": "backlash_two_masses_measured",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_sizes_come_out_right_of_records_of_another_law(name, made_case):
    quantities, expected = CASES[name]
    study, _ = prepare_study(made_case(12, **{ON_THE_BENCH.get(name, name): quantities}))
    nominal = fit_model(study, ())
    fitted = fit_model(study, (EFFECTS[name](),), nominal.values)
    assert nominal.cost - fitted.cost > (100 if name == "backlash_before_load" else 200)
    for short, (value, tolerance) in expected.items():
        assert fitted.values[f"{name}.{short}"] == pytest.approx(value, abs=tolerance), short
