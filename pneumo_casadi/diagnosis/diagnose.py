"""The diagnosis in one call: from a case to a verdict with reasons."""

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pneumo_casadi.data import Case, Grade, read_case
from pneumo_casadi.data.record_ranges import record_ranges
from pneumo_casadi.diagnosis.checks.absorbed import contradicted_balance
from pneumo_casadi.diagnosis.conclude import conclude
from pneumo_casadi.diagnosis.decide.decision import Decision
from pneumo_casadi.diagnosis.decide.ranking import (
    effects_found,
    most_missed_first,
    parameter_values,
    rank_candidates,
    unnamed_effects,
)
from pneumo_casadi.diagnosis.discover.term_in_model import Model, told_as_fitted
from pneumo_casadi.diagnosis.locate.evidence import collect_evidence
from pneumo_casadi.diagnosis.locate.locate import locate
from pneumo_casadi.diagnosis.locate.unknown_inputs import estimate_unknown_inputs
from pneumo_casadi.diagnosis.metrics.findings import (
    Value,
    Where,
    joined_names,
)
from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.residual_size import balance_closure
from pneumo_casadi.diagnosis.metrics.simulated_curves import simulated_curves
from pneumo_casadi.diagnosis.metrics.simulated_gap import gap_with_term, simulated_gap
from pneumo_casadi.diagnosis.metrics.verdict import Verdict
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.noise_bias import without_noise_bias
from pneumo_casadi.diagnosis.prepare.prepare_study import (
    applicable,
    check_catalogue,
    prepare_study,
)
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.diagnosis.prepare.study_jobs import StudyJobs
from pneumo_casadi.diagnosis.result.diagnosis_result import Diagnosis
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue
from pneumo_casadi.diagnosis.select.forms import causes_of
from pneumo_casadi.diagnosis.select.forward_selection import select_effects
from pneumo_casadi.diagnosis.select.selection import Selection
from pneumo_casadi.diagnosis.wording.conclusions import separating_experiment, unknown_hint
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification.flow_form import resolve_flow_form
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.provenance import provenance
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import FlowForm


@dataclass(frozen=True, slots=True)
class DiagnosisOptions:
    """What may be chosen in a diagnosis.

    Parameters
    ----------
    keep : path, optional
        Folder that keeps finished fits: interrupted work is taken up again there. Refinements by
        output error, a few seconds each, are made anew.
    flow_form : FlowForm or str, optional
        Form of the flow map; by default the one that `choose_flow_form` finds.
    degrees : tuple of int, optional
        Degrees of the flow polynomials (eq. 12), as in `IdentifyOptions`.
    criteria : Criteria, optional
        The numbers that decide the verdict.

    Raises
    ------
    ModelError
        If the form is unknown, or degrees are no three whole numbers.
    """

    keep: Path | None = None
    flow_form: FlowForm | None = None
    degrees: tuple[int, int, int] | None = None
    criteria: Criteria = CRITERIA

    def __post_init__(self) -> None:
        flow = IdentifyOptions(self.flow_form, self.degrees)
        object.__setattr__(self, "flow_form", flow.flow_form)
        object.__setattr__(self, "degrees", flow.degrees)


@one_thread
def diagnose(
    case: Case | str | Path,
    catalogue: Catalogue | None = None,
    options: DiagnosisOptions | None = None,
    progress: Progress | None = None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Find where model and measurement disagree, which effect causes it, and how much it closes.

    Parameters
    ----------
    case : Case or path
        A case, or the folder that holds one. Without a validation record the last part of each
        record is held out.
    catalogue : mapping of str to effect class, optional
        Possible causes by name; by default all effects of `EFFECTS` that suit the axis. An effect
        of your own is added as its class.
    options : DiagnosisOptions, optional
        What differs from the default.
    progress : callable, optional
        Called as ``progress(text, share)`` with the share of the work done.
    executor : Executor, optional
        Where the refits run (a process pool, Dask ...); by default in this process.

    Returns
    -------
    Diagnosis

    Raises
    ------
    CaseError
        If the case cannot be read, a record is too short or shows no motion, or records to fit
        differ in sampling frequency.
    ModelError
        If `catalogue` holds no effects by name, or `options` are no `DiagnosisOptions`.

    Notes
    -----
    The nominal model and each candidate are fitted to the balances along the smoothed measured
    motion. Nothing is integrated, so that the fit does not diverge; see `fit_equation_error`. Gaps
    are evaluated on held-out records, which no fit uses.

    Examples
    --------
    Two seconds of the example, recorded without any effect, and one effect instead of all:

    >>> from dataclasses import replace
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> fitted, held_out = case.identify[0].window(10, 12), case.validate[0].window(8, 10)
    >>> few = {"stribeck": pc.EFFECTS["stribeck"]}
    >>> diagnosis = pc.diagnose(replace(case, identify=(fitted,), validate=(held_out,)), few)
    >>> diagnosis.verdict.value, diagnosis.gap.before < 1  # per cent of the signals
    ('none', True)
    """
    began = time.perf_counter()
    options = DiagnosisOptions() if options is None else options
    if not isinstance(options, DiagnosisOptions):
        raise ModelError(f"options: {options!r}; give DiagnosisOptions(...)")
    offered = EFFECTS if catalogue is None else catalogue
    check_catalogue(offered)
    report = progress or no_progress
    case = case if isinstance(case, Case) else read_case(case)
    report("reading", 0.0)
    flow_options, flow_selection = resolve_flow_form(
        case, IdentifyOptions(flow_form=options.flow_form, degrees=options.degrees)
    )
    study, notes = prepare_study(case, flow_options, options.criteria)
    chosen = applicable(study, offered)
    selection = select_effects(
        study, chosen, executor, progress_range(report, 0.02, 0.8), options.keep
    )
    report("parameters, and terms outside the catalogue", 0.82)
    conclusion = conclude(study, selection, chosen, executor)
    effects, checks = conclusion.effects, conclusion.checks
    decision, discovery = conclusion.decision, conclusion.discovery
    besides = tuple(chosen[name]() for name in selection.besides)
    known: Catalogue = {**EFFECTS, **chosen}
    discovered, with_term = (None, None) if discovery is None else (discovery.term, discovery.model)
    final = selection.final if decision.has_gap else selection.nominal
    shown = effects if final is selection.final else ()
    models = {selection.nominal: (), final: shown, **dict([with_term] if with_term else [])}
    selection.simulations.begin_loops(models, StudyJobs(study, executor))
    inputs = estimate_unknown_inputs(study, selection.nominal)
    named = decision.names_effects
    hidden, beside = ((), decision.absorbed) if named else (decision.absorbed, ())
    where = locate(
        study,
        selection.nominal,
        most_missed_first(selection, effects) if named else (),
        selection.final if named else None,
        gap=decision.has_gap,
        inputs=inputs,
        catalogue=known,
        besides=besides if named else (),
        contradicted=contradicted_balance(checks) if hidden else Location.NONE,
        explained=() if discovered is None else discovered.locations,
    )
    report("simulating the held-out record", 0.88)
    gap, more = simulated_gap(
        selection.simulations, selection.nominal, final, shown, selection.levels
    )
    gap = gap_with_term(selection.simulations, gap, with_term, selection.levels)
    curves = simulated_curves(
        selection.simulations, selection.nominal, final if shown else None, shown, with_term
    )
    report("what sensor noise does to the estimates", 0.97)
    unbiased = _without_bias(study, selection, final, shown, executor)
    if discovered is not None and with_term is not None:
        with_term = (without_noise_bias(study, *with_term, executor), with_term[1])
        discovered = told_as_fitted(discovered, with_term[0])
    report("done", 1.0)
    judgement = decision.judgement
    in_model = effects_found(study, unbiased, judgement, chosen) if named else ()
    unnamed = unnamed_effects(in_model, selection, chosen)
    sure = set(selection.named) - set(judgement.undecided)
    alternatives = tuple(dict.fromkeys(causes_of(names, known) for names in decision.alternatives))
    return Diagnosis(
        case=case.name,
        verdict=decision.verdict,
        effects=tuple(e for e in in_model if e.form in sure),
        undecided=tuple(e for e in in_model if e.form in judgement.undecided),
        besides=unnamed["besides"],
        corrections=unnamed["corrections"],
        unsupported=unnamed["unsupported"],
        absorbed=beside,
        ranking=rank_candidates(study, unbiased, judgement, hidden, chosen),
        where=where,
        gap=gap,
        ambiguous=alternatives if decision.is_open else (),
        experiment=separating_experiment(alternatives, chosen),
        hint=_hint(where, selection, decision, explained=discovered is not None),
        checks=checks,
        notes=(*notes, *conclusion.notes, *more, *_failures(selection)),
        nominal=parameter_values(study.axis, unbiased.nominal),
        fitted=parameter_values(
            study.axis.with_effects(*shown), unbiased.final if shown else unbiased.nominal
        ),
        with_term=_values_with_term(study, with_term),
        seconds=time.perf_counter() - began,
        evidence=collect_evidence(
            study, inputs, selection.nominal, final if shown else None, curves
        ),
        flow_selection=flow_selection,
        discovered=discovered,
        findings=tuple(each for each in case.findings if each.grade is Grade.SEVERE),
        provenance=_provenance(case, offered, options),
    )


def _without_bias(
    study: Study,
    selection: Selection,
    final: FittedModel,
    effects: Sequence[Effect],
    executor: Executor | None,
) -> Selection:
    """Return the selection with what the verdict names less its bias by sensor noise.

    Where output error has refined the model, its estimates and robust deviations are told.
    """
    if final is not selection.nominal and selection.chosen in selection.output_error_fits:
        return selection
    unbiased = without_noise_bias(study, final, effects, executor)
    return selection.with_final(unbiased) if effects else replace(selection, nominal=unbiased)


def _provenance(case: Case, offered: Catalogue, options: DiagnosisOptions) -> dict[str, Any]:
    """Return what is needed to repeat a diagnosis."""
    fitted = "fitted" if case.validate else "fitted, its last part held out"
    chosen = {
        "without": [name for name in EFFECTS if name not in offered],
        "added": [name for name in offered if name not in EFFECTS],
        "flow_form": None if options.flow_form is None else options.flow_form.value,
        "degrees": None if options.degrees is None else list(options.degrees),
    }
    records = record_ranges({fitted: case.identify, "held out": case.validate})
    return provenance(case.files, chosen, records=records)


def _values_with_term(study: Study, with_term: Model | None) -> dict[str, Value]:
    if with_term is None:
        return {}
    fitted, effects = with_term
    return parameter_values(study.axis.with_effects(*effects), fitted)


def _hint(where: Where, selection: Selection, decision: Decision, explained: bool) -> str:
    if decision.verdict is not Verdict.UNKNOWN:
        return ""
    closure = None
    if selection.path and not explained:  # a discovered term says more than what comes nearest
        closure = balance_closure(selection.nominal, selection.final, selection.levels)
    return unknown_hint(where, selection.named, closure, decision.judgement.unexplained)


def _failures(selection: Selection) -> tuple[str, ...]:
    return tuple(f"{joined_names(fit.effects)}: {fit.reason}" for fit in selection.failures)
