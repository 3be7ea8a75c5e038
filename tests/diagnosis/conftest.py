"""Whole diagnoses that several tests ask, each made once for all workers of a run."""

from types import SimpleNamespace

import pytest

from pneumo_casadi.diagnosis import DiagnosisOptions, diagnose, prepare_study
from pneumo_casadi.effects import EFFECTS

#: The cause, rivals for its balance and for the others: enough to be wrong with, and quick.
SMALL = {
    name: EFFECTS[name] for name in ("stribeck", "quadratic_drag", "leakage_P", "valve_dynamics")
}


@pytest.fixture(scope="session")
def small():
    return SMALL


@pytest.fixture(scope="session")
def sound_study(made_case):
    """The study of an axis with which nothing is wrong."""
    return prepare_study(made_case(12))[0]


@pytest.fixture(scope="session")
def rubbing_case(made_case):
    return made_case(12, 3.0, stribeck="medium")


@pytest.fixture(scope="session")
def resumed(once_a_run, rubbing_case, tmp_path_factory):
    """The diagnosis of hidden friction, interrupted before it looks for a second effect.

    With the number of fits on disk then, and the models that were fitted after it was resumed.
    """
    return once_a_run(
        "resumed_diagnosis",
        lambda: _interrupt_and_resume(rubbing_case, tmp_path_factory.mktemp("kept")),
    )


def _interrupt_and_resume(case, folder):
    from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model

    class Stop(Exception):
        pass

    def stop(text, share):
        if text.startswith("looking for"):
            raise Stop

    fitted = []

    def counted(study, effects, *rest):
        fitted.append(tuple(effect.name for effect in effects))
        return fit_model(study, effects, *rest)

    options = DiagnosisOptions(keep=folder)
    with pytest.raises(Stop):
        diagnose(case, SMALL, options, stop)
    kept = len(list(folder.glob("*.npz")))
    with pytest.MonkeyPatch.context() as patch:
        for module in ("forward_selection", "fit_ledger"):
            patch.setattr(f"pneumo_casadi.diagnosis.select.{module}.fit_model", counted)
        diagnosis = diagnose(case, SMALL, options)
    return SimpleNamespace(diagnosis=diagnosis, kept=kept, fitted=fitted)


@pytest.fixture(scope="session")
def rubbing(resumed):
    """The diagnosis of hidden friction."""
    return resumed.diagnosis


@pytest.fixture(scope="session")
def unlisted(once_a_run, made_case):
    """The diagnosis of a leak with a catalogue that has no leak."""
    few = {"valve_null_shift": EFFECTS["valve_null_shift"]}
    case = made_case(12, 2.0, leakage_N="medium")
    return once_a_run("unlisted_diagnosis", lambda: diagnose(case, few))
