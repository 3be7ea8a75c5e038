"""The diagnosis in one call: from a case to a verdict with reasons."""

import logging
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pneumo_casadi.data import Case, Recording, read_case
from pneumo_casadi.diagnosis.checks.parameter_checks import check_fit
from pneumo_casadi.diagnosis.decide.credibility import near_noise, review_verdict
from pneumo_casadi.diagnosis.decide.result import Diagnosis, Verdict
from pneumo_casadi.diagnosis.decide.verdict import Judgement, judge
from pneumo_casadi.diagnosis.locate.evidence import collect_evidence
from pneumo_casadi.diagnosis.locate.locate import locate
from pneumo_casadi.diagnosis.locate.unknown_inputs import estimate_unknown_inputs
from pneumo_casadi.diagnosis.metrics.findings import (
    Candidate,
    EffectFound,
    Value,
    Where,
    joined_names,
)
from pneumo_casadi.diagnosis.metrics.residual_size import balance_closure
from pneumo_casadi.diagnosis.metrics.simulated_gap import simulated_gap
from pneumo_casadi.diagnosis.prepare.study import FittedModel, Study, start_study
from pneumo_casadi.diagnosis.prepare.usable_records import require_usable
from pneumo_casadi.diagnosis.select.fit_ledger import Catalogue, Names
from pneumo_casadi.diagnosis.select.forward_selection import Selection, select_effects
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import ModelError
from pneumo_casadi.identification.identify import (
    IdentifyOptions,
    make_axis,
    read_flow,
    resolve_flow_form,
)
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect, EffectFactory
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.valve import FlowForm

logger = logging.getLogger(__name__)

#: Probability that what hides in the parameters is among those that can: 14 of 16 on the bench.
HIDDEN = 0.8
#: Share of a record that is held out where a case has no validation record.
HELD_OUT = 0.4


@dataclass(frozen=True, slots=True)
class DiagnosisOptions:
    """What may be chosen in a diagnosis.

    Parameters
    ----------
    keep : path, optional
        Folder that keeps finished fits: interrupted work is taken up again there. Refinements by
        output error, a few seconds each, are made anew.
    flow_form : FlowForm, optional
        Form of the flow map; by default the one that `choose_flow_form` finds.
    degrees : tuple of int, optional
        Degrees of the flow polynomials (eq. 12), as in `IdentifyOptions`.
    """

    keep: Path | None = None
    flow_form: FlowForm | None = None
    degrees: tuple[int, int, int] | None = None


@one_thread
def diagnose(
    case: Case | str | Path,
    catalogue: Catalogue | None = None,
    options: DiagnosisOptions | None = None,
    progress: Progress | None = None,
    executor: Executor | None = None,
) -> Diagnosis:
    """Say where simulation and reality part, which effect causes it, and how far the gap closes.

    Parameters
    ----------
    case : Case or path
        A case, or the folder that holds one. Without a validation record the last part of each
        record is held out.
    catalogue : mapping of str to effect class, optional
        What may be the cause; by default all effects that suit the axis. Effects of your own
        need nothing but their class.
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
        If the case cannot be read, or a record is too short or shows no motion.

    Notes
    -----
    The nominal model and each candidate are fitted to the balances along the smoothed motion, a
    least-squares problem that cannot run away; see `fit_equation_error`. Verdicts rest on records
    that no fit has seen.

    Examples
    --------
    Three seconds of the example, and two effects instead of all. It has no withheld effect:

    >>> from dataclasses import replace
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> fitted, held_out = case.identify[0].window(10, 13), case.validate[0].window(8, 10)
    >>> few = {name: pc.EFFECTS[name] for name in ("stribeck", "quadratic_drag")}
    >>> diagnosis = pc.diagnose(replace(case, identify=(fitted,), validate=(held_out,)), few)
    >>> diagnosis.verdict.value, diagnosis.gap.before < 1  # per cent of the signals
    ('none', True)
    """
    began = time.perf_counter()
    options = options or DiagnosisOptions()
    report = progress or no_progress
    case = case if isinstance(case, Case) else read_case(case)
    report("reading", 0.0)
    flow_options, flow_selection = resolve_flow_form(
        case, IdentifyOptions(flow_form=options.flow_form, degrees=options.degrees)
    )
    study, notes = prepare(case, flow_options)
    chosen = applicable(study, EFFECTS if catalogue is None else catalogue)
    selection = select_effects(
        study, chosen, executor, progress_range(report, 0.02, 0.8), options.keep
    )
    effects = tuple(chosen[name]() for name in selection.chosen)
    judgement = judge(selection, effects)
    report("parameters and location", 0.82)
    checks = check_fit(study, selection.final, effects)
    known: Catalogue = {**EFFECTS, **chosen}
    verdict, hidden = review_verdict(judgement, checks, known)
    named = verdict in (Verdict.EFFECT, Verdict.AMBIGUOUS)
    apart = named or verdict is Verdict.UNKNOWN or not near_noise(judgement)
    inputs = estimate_unknown_inputs(study, selection.nominal)
    where = locate(
        study,
        selection.nominal,
        _in_order(selection, effects) if named else (),
        selection.final if named else None,
        gap=apart,
        inputs=inputs,
        catalogue=known,
    )
    report("simulating the held-out record", 0.88)
    final = selection.final if apart else selection.nominal
    shown = effects if final is selection.final else ()
    gap, more = simulated_gap(
        selection.simulations, selection.nominal, final, shown, selection.levels
    )
    report("done", 1.0)
    alike = judgement.alike if named else tuple((name,) for name in hidden)
    return Diagnosis(
        case=case.name,
        verdict=verdict,
        effects=_found(study, selection, judgement, chosen) if named else (),
        ranking=_ranking(study, selection, judgement, hidden, chosen),
        where=where,
        gap=gap,
        ambiguous=alike if len(alike) > 1 or hidden else (),
        experiment=_experiment(alike, chosen),
        hint=_hint(where, selection, judgement) if verdict is Verdict.UNKNOWN else "",
        checks=checks,
        notes=(
            *notes,
            *more,
            *(f"{joined_names(f.effects)}: {f.reason}" for f in selection.failures),
        ),
        nominal=_values(study.axis, selection.nominal),
        fitted=_values(study.axis.with_effects(*shown), final),
        seconds=time.perf_counter() - began,
        evidence=collect_evidence(study, inputs, selection.nominal, final if shown else None),
        flow_selection=flow_selection,
    )


def prepare(case: Case, options: IdentifyOptions | None = None) -> tuple[Study, tuple[str, ...]]:
    """Check the records of a case, fit its flow map and start a study; with notes.

    Parameters
    ----------
    case : Case
        What was measured.
    options : IdentifyOptions, optional
        Form of the flow map.

    Returns
    -------
    tuple
        The study, and what a reader must know of its records (tuple of str).

    Raises
    ------
    CaseError
        If a record is too short or shows no motion.
    """
    notes: list[str] = []
    train: Sequence[Recording] = case.identify
    held: Sequence[Recording] = case.validate
    if not held:
        notes.append(f"no validation record: the last {100 * HELD_OUT:.0f} % of each are held out")
        cuts = [(r, float(r.t[0] + (1 - HELD_OUT) * r.duration)) for r in train]
        held = [r.window(cut, float(r.t[-1]) + r.dt) for r, cut in cuts]
        train = [r.window(float(r.t[0]), cut) for r, cut in cuts]
    table, flow = read_flow(case, options or IdentifyOptions())
    axis = make_axis(case, flow)
    require_usable((*train, *held), axis.outputs)
    return start_study(axis, table, train, held), tuple(notes)


def applicable(study: Study, catalogue: Catalogue) -> dict[str, EffectFactory]:
    """Return the effects of a catalogue that an axis can have, as its metered valve shows them."""
    chosen = {}
    for name, effect in catalogue.items():
        if study.flow_map is not None and isinstance(effect, type) and issubclass(effect, Effect):
            effect = effect.on_metered(float(study.flow_map.u.min()), float(study.flow_map.u.max()))
        try:
            study.axis.with_effects(effect())
        except ModelError:
            continue
        chosen[name] = effect
    return chosen


def _values(axis: Axis, fitted: FittedModel) -> dict[str, Value]:
    return {
        item.name: Value(fitted.values[item.name], fitted.std.get(item.name, 0.0), item.unit)
        for item in axis.parameters
    }


def _own(study: Study, fitted: FittedModel, names: Names, catalogue: Catalogue) -> dict[str, Value]:
    """Return the parameters of a model's effects by their full names."""
    axis = study.axis.with_effects(*(catalogue[name]() for name in names))
    return {name: value for name, value in _values(axis, fitted).items() if "." in name}


def _short(own: Mapping[str, Value], effect: str) -> dict[str, Value]:
    """Return the parameters of one effect by their short names."""
    prefix = f"{effect}."
    return {n.removeprefix(prefix): value for n, value in own.items() if n.startswith(prefix)}


def _labelled(names: Names, own: Mapping[str, Value]) -> Mapping[str, Value]:
    """Return the parameters as a ranking shows them: short where one effect stands alone."""
    return _short(own, names[0]) if len(names) == 1 else own


def _found(
    study: Study, selection: Selection, judgement: Judgement, catalogue: Catalogue
) -> tuple[EffectFound, ...]:
    """Return the effects in the order in which they were added."""
    own = _own(study, selection.final, selection.chosen, catalogue)
    return tuple(
        EffectFound(
            name,
            min(1.0, sum(p for names, p in judgement.probability.items() if name in names)),
            _short(own, name),
        )
        for name in _order(selection)
    )


def _order(selection: Selection) -> list[str]:
    order: list[str] = []
    for names in selection.path:
        order += [name for name in names if name not in order]
    return [name for name in order if name in selection.chosen]


def _in_order(selection: Selection, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    by_name = {effect.name: effect for effect in effects}
    return tuple(by_name[name] for name in _order(selection))


def _ranking(
    study: Study,
    selection: Selection,
    judgement: Judgement,
    hidden: Sequence[str],
    catalogue: Catalogue,
) -> tuple[Candidate, ...]:
    """Rank all models fitted; ahead of them what may hide in the parameters."""
    ranked = [
        Candidate(
            names,
            judgement.probability.get(names, 0.0),
            balance_closure(selection.nominal, fitted, selection.levels),
            selection.screen[names[0]].explained if names[0] in selection.screen else 0.0,
            min(
                (selection.screen[n].observable for n in names if n in selection.screen),
                default=0.0,
            ),
            _labelled(names, _own(study, fitted, names, catalogue)),
        )
        for names, fitted in ({**selection.fits, selection.chosen: selection.final}).items()
        if names
    ]
    ranked.sort(key=lambda c: (-c.probability, selection.fits[c.names].cost))
    for name, screened in selection.screen.items():
        if (name,) not in selection.fits and all(name not in f.effects for f in selection.failures):
            ranked.append(Candidate((name,), 0.0, None, screened.explained, screened.observable))
    ranked += [
        Candidate(failed.effects, 0.0, None, 0.0, 0.0, {}, failed.reason)
        for failed in selection.failures
    ]
    shares = 1.0 / np.arange(1.0, len(hidden) + 1) ** 2  # the most likely first
    absorbed = [
        Candidate((name,), HIDDEN * float(share), None, 0.0, 0.0)
        for name, share in zip(hidden, shares / shares.sum(), strict=True)
    ]
    rest = [
        candidate
        for candidate in ranked
        if not (len(candidate.names) == 1 and candidate.names[0] in hidden)
    ]
    left = (
        (1.0 - HIDDEN) / max(1.0, sum(candidate.probability for candidate in rest))
        if hidden
        else 1.0
    )
    return (
        *absorbed,
        *(replace(candidate, probability=left * candidate.probability) for candidate in rest),
    )


def _experiment(alike: Sequence[Names], catalogue: Catalogue) -> str:
    """Return what would tell the members of a set apart."""
    if len(alike) < 2:
        return ""
    names = set().union(*alike)
    common = set(alike[0]).intersection(*alike[1:])
    told = [
        f"{name}: {catalogue[name]().separated_by}"
        for name in sorted(names - common)
        if name in catalogue and catalogue[name]().separated_by
    ]
    return "; ".join(told)


def _hint(where: Where, selection: Selection, judgement: Judgement) -> str:
    parts = [f"what is missing acts in {where.balance.replace('_', ' ')}"]
    if where.regimes:
        parts.append("most " + ", ".join(regime.name for regime in where.regimes[:2]))
    if selection.path:
        label = joined_names(selection.chosen)
        closure = balance_closure(selection.nominal, selection.final, selection.levels)
        parts.append(
            f"{label} closes {100 * closure.value:.0f} % of it ({100 * closure.lower:.0f} to "
            f"{100 * closure.upper:.0f} %) and may be part of the cause; "
            f"{100 * judgement.unexplained:.0f} % of the gap is left, which nothing in the "
            "catalogue explains"
        )
    return "; ".join(parts)
