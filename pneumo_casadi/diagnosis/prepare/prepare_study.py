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
        If a record is too short or shows no motion, or those to fit differ in sampling frequency.
    """
    case, unused = _without_motion_sensors(case)
    train, held, notes = split_records(case)
    train, held = _from_zero(train, held)
    require_one_frequency(train)
    table, flow = read_flow(case, options or IdentifyOptions(), train)
    axis = make_axis(case, flow)
    require_usable((*train, *held), axis.outputs)
    axis = with_flow_from_records(axis, train)
    return start_study(axis, table, train, held, criteria), (*unused, *notes)


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
    """Return the records to fit and those held out, with notes on what was split or left out.

    Gaps leave stretches of a record whose clock is taken as recorded: those that are too short are
    left out where others are not.

    Raises
    ------
    CaseError
        If what would be held out of a record is too short.
    """
    if case.validate:
        fitted, short = _long_stretches(case.identify, SHORTEST)
        held, more = _long_stretches(case.validate, SHORTEST)
        return fitted, held, (*short, *more)
    fitted, short = _long_stretches(case.identify, SHORTEST / HELD_OUT)
    for record in fitted:
        if HELD_OUT * record.duration < SHORTEST * (1 - ROUNDING):
            raise CaseError(
                f"{record.source}: {record.duration:.3g} s without a validation record are too "
                f"short for a diagnosis, which holds out the last {100 * HELD_OUT:.0f} %: record "
                f"at least {SHORTEST / HELD_OUT:g} s, better 20 s, of varied motion, or add a "
                "validation record"
            )
    cuts = [(r, float(r.t[0] + (1 - HELD_OUT) * r.duration)) for r in fitted]
    train = [r.window(float(r.t[0]), cut) for r, cut in cuts]
    held = [r.window(cut, float(r.t[-1]) + r.dt) for r, cut in cuts]
    note = f"no validation record: the last {100 * HELD_OUT:.0f} % of each are held out"
    return train, held, (*short, note)


def _long_stretches(
    records: Sequence[Recording], shortest: float
) -> tuple[Sequence[Recording], tuple[str, ...]]:
    """Return the stretches that last so long [s], with notes; all records where none does."""
    short = [
        record
        for record in records
        if record.clock is Clock.AS_RECORDED and record.duration < shortest * (1 - ROUNDING)
    ]
    if not short or len(short) == len(records):
        return records, ()
    notes = []
    for source in dict.fromkeys(record.source for record in short):
        of_file = [record for record in records if record.source == source]
        lost = [record.duration for record in short if record.source == source]
        notes.append(
            f"{source}: {len(lost)} of {len(of_file)} stretches between gaps, {sum(lost):.3g} of "
            f"{sum(record.duration for record in of_file):.3g} s, are shorter than {shortest:g} s "
            "and are not used"
        )
    return [record for record in records if record not in short], tuple(notes)


def check_catalogue(catalogue: object) -> None:
    """Refuse a catalogue that is not of effects by name.

    Raises
    ------
    ModelError
        Naming what was given.
    """
    example = 'give classes of effects by name, as {"stribeck": pc.EFFECTS["stribeck"]}'
    if not isinstance(catalogue, Mapping):
        raise ModelError(f"catalogue: {catalogue!r}; {example}")
    for name, effect in catalogue.items():
        if not callable(effect):
            raise ModelError(f"catalogue: {name} is {effect!r}; {example}")


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
