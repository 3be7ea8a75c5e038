"""The final model of a diagnosis, refined by output error: an identification like any other."""

from collections.abc import Iterator
from dataclasses import replace

from pneumo_casadi.data import Case
from pneumo_casadi.diagnosis.checks.parameter_checks import check_output_error
from pneumo_casadi.diagnosis.metrics.findings import joined_names
from pneumo_casadi.diagnosis.metrics.simulated_fit import WINDOW
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.prepare_study import split_records
from pneumo_casadi.diagnosis.result.diagnosis_result import Diagnosis
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.identify import identify
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.starting_axis import axis_of_options, started_from
from pneumo_casadi.identification.warnings import in_order, met
from pneumo_casadi.runtime.interruption import is_ending
from pneumo_casadi.runtime.progress import Progress

#: How whole records are fitted. Of an iteration budget a third may be full steps; what had not
#: settled by then did not in 150 iterations and minutes either.
WHOLE = OutputErrorOptions(recover=False, max_iterations=40)
#: How a model without the cause is fitted.
WITHOUT_CAUSE = OutputErrorOptions(window=WINDOW, recover=False, max_iterations=30)
#: Warnings of what a verdict says against parameters.
LACKS = (
    "The model lacks a cause that the diagnosis found no name for: its parameters absorb a part."
)
TAKEN_UP = "The fit has taken up in %s what the model lacks; do not use them."
WITHOUT_WEAK = (
    "The model is without %s, which the diagnosis had besides: output error over whole records "
    "did not settle with that."
)


def options_of_diagnosis(case: Case, diagnosis: Diagnosis, weak: bool = True) -> IdentifyOptions:
    """Return the options of `identify` that start from the final model of a diagnosis.

    The model is the final one of the diagnosis: nominal where no effect is named.
    Parameters of effects that the diagnosis held stay held, and so do the coefficients of curves:
    output error does not know the priors that hold them where the records say little.

    Parameters
    ----------
    case : Case
        The case that was diagnosed.
    diagnosis : Diagnosis
        Its diagnosis, with effects of the catalogue.
    weak : bool, optional
        Whether effects that are not named, weak ones and corrections of the map, are in the model.

    Examples
    --------
    With ``diagnosis = pc.diagnose(pc.example_case())``:

    >>> options = pc.diagnosis.options_of_diagnosis(pc.example_case(), diagnosis)
    >>> options.effects, round(options.start_values["M"], 1)
    ((), 16.9)
    """
    selection = diagnosis.flow_selection
    acting = diagnosis.final_effects if weak else (*diagnosis.effects, *diagnosis.undecided)
    options = IdentifyOptions(
        flow_form=None if selection is None else selection.chosen,
        degrees=None if selection is None else selection.degrees,
        effects=tuple(effect.form for effect in acting),
        each_record=False,
    )
    _, flow = read_flow(case, options)
    axis = axis_of_options(case, flow, options)
    known = diagnosis.fitted if diagnosis.effects else diagnosis.nominal
    curves = {effect.name for effect in axis.effects if list(effect.prior_rows())}
    held = [
        item.name
        for item in axis.parameters
        if "." in item.name
        and (not (item.free or known[item.name].std) or item.name.split(".")[0] in curves)
    ]
    return started_from(options, axis, {n: item.value for n, item in known.items()}, held)


def with_refined_checks(diagnosis: Diagnosis, refined: Identification | None) -> Diagnosis:
    """Return a diagnosis with the checks of its final model as refined by output error.

    The form of the flow map was checked without any record, and is what it was.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    refined : Identification or None
        From `refine_diagnosis`; None where there is none.
    """
    if refined is None:
        return diagnosis
    misfit = next((check.value for check in diagnosis.checks if check.name == "map form"), None)
    return replace(diagnosis, refined_checks=check_output_error(refined.output_error, misfit))


def taken_up(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the parameters to use that have taken up what the model lacks.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis, with the checks of its final model.
    """
    if diagnosis.verdict is not Verdict.ABSORBED and not diagnosis.absorbed:
        return ()
    return tuple(check.name for check in diagnosis.final_checks if not check.agrees)


def refine_diagnosis(
    case: Case, diagnosis: Diagnosis, progress: Progress | None = None
) -> Identification:
    """Refine the final model of a diagnosis by output error.

    Over whole records; where that does not converge, without the weak effects besides, and then
    without them over windows of half a second. With an unknown cause only windows are tried, and
    not for long: a model without it seldom settles. Held-out records are those of the diagnosis.
    What the diagnosis says against the parameters is a warning of the result, and so are weak
    effects left out: one whose cause is unknown is not to be used.

    Parameters
    ----------
    case : Case
        The case that was diagnosed.
    diagnosis : Diagnosis
        Its diagnosis, with effects of the catalogue.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Identification
        `write_report` and `export_model` take it, as that of `identify`.

    Raises
    ------
    FitError
        If output error converges in none of these ways.
    ModelError
        If an effect of the diagnosis is not of the catalogue.
    """
    train, held_out, _ = split_records(case)
    split = replace(case, identify=tuple(train), validate=tuple(held_out))
    failure: FitError | ModelError | None = None
    for options in _ways(case, diagnosis):
        try:
            refined = identify(split, options, progress)
        except (FitError, ModelError) as error:  # or a free run that leaves the finite numbers
            failure = error
            if is_ending():  # inside a compiled function Ctrl-C comes out as such an error
                break
        else:
            return _with_verdict(refined, diagnosis)
    assert failure is not None
    raise failure


def _ways(case: Case, diagnosis: Diagnosis) -> Iterator[IdentifyOptions]:
    """Yield how the final model is to be fitted, the best way first."""
    final = options_of_diagnosis(case, diagnosis)
    if diagnosis.verdict is Verdict.UNKNOWN:
        yield replace(final, output_error=WITHOUT_CAUSE)
        return
    yield replace(final, output_error=WHOLE)
    if diagnosis.unnamed_effects:
        final = options_of_diagnosis(case, diagnosis, weak=False)
        yield replace(final, output_error=WHOLE)
    yield replace(final, output_error=OutputErrorOptions(window=WINDOW))


def _with_verdict(refined: Identification, diagnosis: Diagnosis) -> Identification:
    """Return an identification that warns of what the verdict says against its parameters."""
    warnings = []
    if diagnosis.verdict is Verdict.UNKNOWN:
        warnings.append(met("cause unknown", "physics", LACKS))
    elif wrong := taken_up(with_refined_checks(diagnosis, refined)):
        warnings.append(met("taken up", "physics", TAKEN_UP % ", ".join(wrong)))
    present = {effect.name for effect in refined.axis.effects}
    if weak := [effect.name for effect in diagnosis.unnamed_effects if effect.form not in present]:
        warnings.append(met("weak left out", "physics", WITHOUT_WEAK % joined_names(weak)))
    if not warnings:
        return refined
    return replace(refined, warnings=in_order((*warnings, *refined.warnings)))
