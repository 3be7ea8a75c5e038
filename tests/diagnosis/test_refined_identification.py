"""The final model of a diagnosis as a result that other commands take."""

import json
from dataclasses import replace

import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.data import write_case
from pneumo_casadi.diagnosis import Check, EffectFound, Verdict, options_of_diagnosis
from pneumo_casadi.diagnosis import refined_identification as module
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.export import read_model
from pneumo_casadi.identification.compared_model import compared_model
from pneumo_casadi.identification.read_result import read_axis
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.report.pages.diagnosis import write_diagnosis


@pytest.mark.slow
def test_the_options_start_from_the_nominal_fit_where_no_effect_is_named(quick_diagnosis, quick):
    assert quick_diagnosis.verdict is Verdict.NONE
    options = options_of_diagnosis(quick.case, quick_diagnosis)
    assert options.effects == () and options.fixed == {}
    assert options.flow_form is quick_diagnosis.flow_selection.chosen
    assert options.start_values["M"] == quick_diagnosis.nominal["M"].value
    assert "v_s" not in options.start_values


@pytest.mark.parametrize("error", [FitError, ModelError])
def test_windows_are_taken_where_whole_records_do_not_converge(
    quick_diagnosis, quick, monkeypatch, error
):
    tried = []

    def identify(case, options, progress):
        tried.append(options.output_error)
        if options.output_error.window is None:
            raise error("no step helps, or the simulation leaves the finite numbers")
        return quick

    monkeypatch.setattr(module, "identify", identify)
    assert module.refine_diagnosis(quick.case, quick_diagnosis) is quick
    assert [options.window for options in tried] == [None, 0.5]


@pytest.mark.parametrize("settles", ["hose", "whole", "windows"])
def test_weak_effects_besides_are_left_out_where_output_error_does_not_settle_with_them(
    quick_diagnosis, quick, monkeypatch, settles
):
    """A hose that was not there kept a sensor's lag from converging, for minutes."""
    ways = {"hose": (("hose",), None), "whole": ((), None), "windows": ((), 0.5)}
    tried = []

    def identify(case, options, progress):
        tried.append((options.effects, options.output_error.window))
        if tried[-1] != ways[settles]:
            raise FitError("iterations exhausted")
        axis = quick.axis.with_effects(*(EFFECTS[name]() for name in options.effects))
        return replace(quick, output_error=replace(quick.output_error, axis=axis))

    monkeypatch.setattr(module, "check_output_error", lambda *_: ())
    monkeypatch.setattr(module, "identify", identify)
    hose = EffectFound("hose", 0.8, {}, 0.0, "hose")
    M = quick_diagnosis.nominal["M"]
    own = {f"hose.{item.name}": replace(M, value=item.value) for item in EFFECTS["hose"].parameters}
    given = replace(quick_diagnosis, besides=(hose,), nominal=quick_diagnosis.nominal | own)
    refined = module.refine_diagnosis(quick.case, given)
    assert tried == list(ways.values())[: list(ways).index(settles) + 1]
    added = [each.text for each in refined.warnings if each not in quick.warnings]
    assert len(added) == (settles != "hose") and all("without hose" in text for text in added)


def test_without_the_cause_windows_alone_are_tried_and_not_for_long(
    quick_diagnosis, quick, monkeypatch
):
    """It took three minutes in vain, ten times the diagnosis."""
    tried = []

    def identify(case, options, progress):
        tried.append(options.output_error)
        raise FitError("iterations exhausted")

    monkeypatch.setattr(module, "identify", identify)
    unknown = replace(quick_diagnosis, verdict=Verdict.UNKNOWN)
    with pytest.raises(FitError, match="exhausted"):
        module.refine_diagnosis(quick.case, unknown)
    (options,) = tried
    assert (options.window, options.recover) == (0.5, False)
    assert options.max_iterations <= 30


@pytest.mark.slow
def test_the_final_model_goes_from_diagnosis_to_validation_simulation_and_export(
    rubbing_case, rubbing, small, without_pictures, tmp_path
):
    given = rubbing_case
    fitted, held_out = given.identify[0].window(0.0, 1.5), given.validate[0].window(0.0, 1.2)
    case = write_case(tmp_path / "case", given.bench, [fitted], [held_out], given.flow_map_path)
    assert [effect.name for effect in rubbing.effects] == ["stribeck"]
    assert isinstance(rubbing.effects[0], EffectFound)
    refined = module.refine_diagnosis(case, rubbing)
    assert refined.output_error.status == "converged"
    folder = write_diagnosis(rubbing, tmp_path / "report", small, refined=refined)
    content = json.loads((folder / "result.json").read_text("utf-8"))
    assert content["output_error"]["parameters"]["stribeck.delta_F"]["std"] > 0
    assert content["usable"] in ("yes", "with care")
    axis = read_axis(folder, case)
    assert axis.parameters.as_dict() == refined.axis.parameters.as_dict()
    assert read_model(folder).axis.parameters.as_dict() == axis.parameters.as_dict()
    records = str(case.folder)
    assert cli.run(["validate", records, "-p", str(folder), "--strict"]) == 0
    assert cli.run(["simulate", records, "-p", str(folder), "-o", str(tmp_path / "run")]) == 0
    assert cli.run(["export", str(folder), "-f", "json", "-o", str(tmp_path / "model")]) == 0
    compared = compared_model(folder)  # what `compare` begins with; it simulates as `validate` does
    assert compared.axis.parameters.as_dict() == axis.parameters.as_dict()
    assert (compared.held_out, compared.records[0].N) == (True, held_out.N)
    assert compared.estimates["stribeck.delta_F"].std > 0


@pytest.mark.parametrize(
    ("verdict", "agrees", "usable", "words"),
    [
        (Verdict.UNKNOWN, True, "no", "lacks a cause"),
        (Verdict.ABSORBED, False, "with care", "taken up in M"),
        (Verdict.NONE, True, "yes", "converged"),
    ],
)
def test_what_the_verdict_says_against_parameters_is_in_their_file(
    quick_diagnosis, quick, monkeypatch, verdict, agrees, usable, words
):
    check = Check("M", 13.0, 0.1, 16.0, 0.8, "kg", agrees, "M = 13 kg")
    monkeypatch.setattr(module, "identify", lambda *_: quick)
    monkeypatch.setattr(module, "check_output_error", lambda *_: (check,))
    given = replace(quick_diagnosis, verdict=verdict)
    content = result_dict(module.refine_diagnosis(quick.case, given))
    assert content["usable"] == usable and words in content["reason"]
