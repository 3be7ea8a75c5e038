"""From a case to a study: records checked and split, flow map fitted, effects that suit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from pneumo_casadi.data import Case, Clock, Recording
from pneumo_casadi.data.recording.clock import uniform
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.diagnosis.prepare.study import Study, start_study
from pneumo_casadi.diagnosis.prepare.usable_records import ROUNDING, SHORTEST, require_usable
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.starting_axis import make_axis, with_flow_from_records
from pneumo_casadi.model.effect import Effect, EffectFactory
from pneumo_casadi.signals.resampling import require_one_frequency

#: Share of a record that is held out where a case has no validation record.
HELD_OUT = 0.4


def prepare_study(
    case: Case, options: IdentifyOptions | None = None, criteria: Criteria = CRITERIA
) -> tuple[Study, tuple[str, ...]]:
    """Check the records of a case, fit its flow map and start a study; with notes.

    The clock of the study begins with the first record of the case.

    Parameters
    ----------
    case : Case
        What was measured.
    options : IdentifyOptions, optional
        Form of the flow map.
    criteria : Criteria, optional
        What decides the verdict.

    Returns
    -------
    tuple
        The study, and what a reader must know of its records (tuple of str).

    Raises
    ------
    CaseError
        If all records are too short, one shows no motion, or those to fit differ in sampling
        frequency.
    """
    case, unused = _without_motion_sensors(case)
    case, short = _without_short_records(case)
    train, held, notes = split_records(case)
    train, held = _from_zero(train, held)
    require_one_frequency(train)
    table, flow = read_flow(case, options or IdentifyOptions(), train)
    axis = make_axis(case, flow)
    require_usable((*train, *held), axis.outputs)
    axis = with_flow_from_records(axis, train)
    return start_study(axis, table, train, held, criteria), (*unused, *short, *notes)


def _without_motion_sensors(case: Case) -> tuple[Case, tuple[str, ...]]:
    """Return a case whose axis is seen by pressures and position, with a note on other sensors.

    The balances are evaluated along the motion that these show. Records lose the other sensors too:
    a filtered record takes its motion from all that it holds.
    """
    bench = case.bench
    others = {name for name, use in bench.kind.further.items() if use == "output"}
    unused = sorted(bench.signals & others)
    plain = replace(bench, signals=bench.signals - others)
    fitted, held_out = (
        tuple(record.without(others) for record in records)
        for records in (case.identify, case.validate)
    )
    note = f"{', '.join(unused)}: recorded but not used; the motion is that of the position sensor"
    plain_case = replace(case, bench=plain, identify=fitted, validate=held_out)
    return plain_case, ((note,) if unused else ())


def _without_short_records(case: Case) -> tuple[Case, tuple[str, ...]]:
    """Return a case without records that are too short, with a note, where others are not.

    Gaps leave short stretches of a record whose clock is taken as recorded.
    """
    shortest = (SHORTEST if case.validate else SHORTEST / HELD_OUT) * (1 - ROUNDING)
    every = (*case.identify, *case.validate)
    fitted, held_out = (
        tuple(record for record in records if record.duration >= shortest) or records
        for records in (case.identify, case.validate)
    )
    left_out = len(every) - len(fitted) - len(held_out)
    if not left_out:
        return case, ()
    note = f"{left_out} of {len(every)} records are shorter than {shortest:.3g} s and are not used"
    return replace(case, identify=fitted, validate=held_out), (note,)


def _from_zero(*parts: Sequence[Recording]) -> list[list[Recording]]:
    """Return the records on a clock that begins with the first of them.

    Logs count from midnight or from 1970: a formula over such times has no usable scale.
    """
    first = min(float(record.t[0]) for records in parts for record in records)
    return [[_begun(record, first) for record in records] for records in parts]


def _begun(record: Recording, first: float) -> Recording:
    t = record.t - first
    if record.clock is Clock.AS_RECORDED:
        return replace(record, t=t)
    return replace(record, t=uniform(t, record.dt))  # stamps since 1970 are rounded to 0.2 µs


def split_records(
    case: Case,
) -> tuple[Sequence[Recording], Sequence[Recording], tuple[str, ...]]:
    """Return the records to fit and those held out, with a note where a record was split.

    Raises
    ------
    CaseError
        If what would be held out of a record is too short.
    """
    if case.validate:
        return case.identify, case.validate, ()
    for record in case.identify:
        if HELD_OUT * record.duration < SHORTEST * (1 - ROUNDING):
            raise CaseError(
                f"{record.source}: {record.duration:.3g} s without a validation record are too "
                f"short for a diagnosis, which holds out the last {100 * HELD_OUT:.0f} %: record "
                f"at least {SHORTEST / HELD_OUT:g} s, better 20 s, of varied motion, or add a "
                "validation record"
            )
    cuts = [(r, float(r.t[0] + (1 - HELD_OUT) * r.duration)) for r in case.identify]
    train = [r.window(float(r.t[0]), cut) for r, cut in cuts]
    held = [r.window(cut, float(r.t[-1]) + r.dt) for r, cut in cuts]
    note = f"no validation record: the last {100 * HELD_OUT:.0f} % of each are held out"
    return train, held, (note,)


def applicable(study: Study, catalogue: Mapping[str, EffectFactory]) -> dict[str, EffectFactory]:
    """Return the effects of a catalogue that an axis can have, as its metered valve shows them."""
    chosen = {}
    for name, effect in catalogue.items():
        if study.flow_map is not None and isinstance(effect, type) and issubclass(effect, Effect):
            effect = effect.on_metered(float(study.flow_map.u.min()), float(study.flow_map.u.max()))
        if getattr(effect, "measured_by", "") in study.axis.bench.signals:
            continue  # what it would explain is recorded
        try:
            study.axis.with_effects(effect())
        except ModelError:
            continue
        chosen[name] = effect
    return chosen
