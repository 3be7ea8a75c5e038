"""Recordings held against the bench: what cannot be is an error, what is odd a finding."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, triu

from pneumo_casadi.data.bench.bench import Bench
from pneumo_casadi.data.bench.driven_bench import AnyBench, PressureBench
from pneumo_casadi.data.checks.balance_mistakes import check_mass_balances
from pneumo_casadi.data.checks.chambers import cannot_tell, check_chambers
from pneumo_casadi.data.checks.continuity import check_continuity
from pneumo_casadi.data.checks.finding import ContradictionError, Finding, Grade, merge_findings
from pneumo_casadi.data.checks.force_balance import (
    check_driven_mass,
    check_force_balance,
    check_measured_force,
)
from pneumo_casadi.data.checks.metered_flow import (
    ON_A_LINE,
    USELESS,
    MeteredFlow,
    check_flow_map,
)
from pneumo_casadi.data.checks.motion_sensors import check_motion_sensors
from pneumo_casadi.data.checks.ranges import check_ranges, check_statements
from pneumo_casadi.data.checks.sensors import check_sensors
from pneumo_casadi.data.checks.smoothed import smoothed_record
from pneumo_casadi.data.checks.supply import check_supply
from pneumo_casadi.data.checks.timing import check_timing
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.readers.columns import COLUMNS_FILE
from pneumo_casadi.data.readers.recordings import FEWEST_ROWS
from pneumo_casadi.data.readers.tables import read_table, suffix_of
from pneumo_casadi.data.recording.channels import UNITS, column_name
from pneumo_casadi.data.recording.clock import CLOCK_TOLERANCE, RARE, Clock, usual_step
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.errors import CaseError

log = logging.getLogger(__name__)

#: Standard deviations of what jitter may add to the mean step of a short record.
SIGMAS_OF_JITTER = 4.0
#: Share of the median step within which a step of a clock as recorded is a usual one, and what
#: jitter may add to the mean of these at most.
NEAR, MOST_JITTER = 0.25, 0.01
SHARED = 0.1
"""Share of unique rows that two records do not have in common by chance."""
OF_ALL_RECORDS = frozenset({"map of another valve", "swapped areas", "ratio of the areas"})
_NO_FLOWS: Mapping[str, MeteredFlow] = MappingProxyType({})


def check_recording(
    recording: Recording,
    bench: AnyBench,
    flows: Mapping[str, MeteredFlow] = _NO_FLOWS,
    entries: ColumnEntries | None = None,
) -> tuple[Finding, ...]:
    """Check that a recording can come from a bench, and look for the commonest mistakes.

    Channels present, enough rows, clock as the bench's, values within stroke, pressures and
    command limits and in the right unit, sensors alive, chambers not swapped; gauge pressures,
    position from the end of the stroke, areas, delay of the command, supply pressure, flow map.

    Parameters
    ----------
    recording : Recording
        The record; left as it is.
    bench : Bench or ForceBench
        What it is held against.
    flows : mapping of str to MeteredFlow, optional
        Metered flow of the valves by chamber, where there is one.
    entries : ColumnEntries, optional
        The columns from which it was read, for the suggestions.

    Returns
    -------
    tuple of Finding
        What is possible but odd, or most likely a mistake; the gravest first.

    Raises
    ------
    CaseError
        At the first contradiction, naming file, row, value, unit and remedy.
    """
    return merge_findings(_findings(recording, bench, flows, entries or ColumnEntries()))


def check_records(
    recordings: Iterable[Recording],
    bench: AnyBench,
    flows: Mapping[str, MeteredFlow] = _NO_FLOWS,
    entries: ColumnEntries | None = None,
    refuse: bool = True,
) -> tuple[Finding, ...]:
    """Check all records of a case; see `check_recording`.

    Parameters
    ----------
    recordings : iterable of Recording
        All of them.
    bench, flows, entries
        As in `check_recording`.
    refuse : bool, optional
        Whether a contradiction is an error, as by default, or a severe finding.

    Returns
    -------
    tuple of Finding
        The gravest first; what several records have in common is one finding. Logged as
        warnings, unless contradictions are findings: then they are the result.
    """
    recordings = tuple(recordings)
    stated = tuple(check_statements(bench, entries or ColumnEntries()))
    misread = {channel: finding for finding in stated for channel in finding.about.split(", ")}
    of_map = [finding for flow in _distinct(flows) for finding in check_flow_map(flow)]
    for finding in of_map if refuse else ():
        if finding.name == ON_A_LINE:
            raise ContradictionError(finding)
    if any(finding.name in USELESS for finding in of_map):
        flows = _NO_FLOWS  # what a record has beside such a map is no mistake of the record
    by_record: list[tuple[Finding, ...]] = []
    for recording in recordings:
        try:
            by_record.append(check_recording(recording, bench, flows, entries))
        except CaseError as error:
            contradiction = _contradiction(error)
            cause = misread.get(contradiction.about)  # what is stated of the channel comes first
            if refuse and cause:
                raise ContradictionError(cause) from error
            if refuse:
                raise
            by_record.append(() if cause else (contradiction,))
    findings = merge_findings(
        [
            *stated,
            *(_unless_doubtful(item, by_record) for findings in by_record for item in findings),
            *_check_copies(recordings, bench),
            *of_map,
        ]
    )
    for finding in findings if refuse else ():
        log.warning("%s: %s", finding.grade, finding.sentence)
    return findings


def _distinct(flows: Mapping[str, MeteredFlow]) -> Iterable[MeteredFlow]:
    return {id(flow): flow for flow in flows.values()}.values()


def _check_copies(recordings: Sequence[Recording], bench: AnyBench) -> Iterator[Finding]:
    """Yield records that share rows: what is measured once would count twice.

    Noise makes rows of several sensors unique; rows that a record has twice, of coarse sensors at
    rest, are left out.
    """
    signals = (*bench.kind.outputs, *bench.kind.inputs)
    names = [name for name in signals if all(name in recording for recording in recordings)]
    keys = [_row_keys(recording, names) for recording in recordings] if names else []
    for i, j, share in _shared_rows(keys):
        first, second = recordings[i], recordings[j]
        if share > SHARED:
            yield Finding(
                Grade.SEVERE,
                "copied rows",
                "record",
                f"`{first.name}` and `{second.name}` share {100 * share:.0f} % of the rows of the "
                "shorter: what is measured once counts twice, and intervals come out too small; "
                "remove one.",
                source=f"{first.name} and {second.name}",
            )


def _row_keys(recording: Recording, names: Sequence[str]) -> NDArray[np.uint64]:
    """Return numbers that stand for the rows of the sensors, those that occur once.

    Rows that agree to seven digits have the same number. Others share one by chance of N² / 2⁶⁴.
    """
    factors = np.random.default_rng(0).integers(1, 2**63, len(names), dtype=np.uint64)
    keys = np.zeros(recording.N, dtype=np.uint64)
    with np.errstate(over="ignore"):  # what is beyond all sensors is alike
        for name, factor in zip(names, factors, strict=True):
            digits = np.asarray(recording[name], dtype=np.float32).view(np.uint32)
            keys = (keys ^ digits.astype(np.uint64)) * (2 * factor + 1)
            keys ^= keys >> np.uint64(32)
    values, counts = np.unique(keys, return_counts=True)
    once: NDArray[np.uint64] = values[counts == 1]
    return once


def _shared_rows(keys: Sequence[NDArray[np.uint64]]) -> Iterator[tuple[int, int, float]]:
    """Yield the pairs of records with common rows, and their share of the shorter one's rows."""
    sizes = np.array([key.size for key in keys])
    long_enough = np.flatnonzero(sizes >= FEWEST_ROWS)
    if long_enough.size < 2:
        return
    record = np.repeat(long_enough, sizes[long_enough])
    rows: NDArray[np.uint64] = np.concatenate([keys[i] for i in long_enough.tolist()])
    _, row = np.unique(rows, return_inverse=True)
    # Counts of common rows for all pairs at once: they would be compared one by one otherwise.
    occurs = coo_array((np.ones(row.size, dtype=np.int32), (record, row))).tocsr()
    common = triu(occurs @ occurs.T, k=1).tocoo()
    for i, j, shared in zip(*common.coords, common.data, strict=True):
        yield int(i), int(j), float(shared) / float(min(sizes[i], sizes[j]))


def _contradiction(error: CaseError) -> Finding:
    """Return what contradicts a record as a finding."""
    if isinstance(error, ContradictionError):
        return error.finding
    return Finding(Grade.SEVERE, "contradiction", "record", str(error))


def _unless_doubtful(finding: Finding, by_record: Sequence[Sequence[Finding]]) -> Finding:
    """Return a finding about bench or map, no longer severe where a record does not bear it out.

    Areas and map are the same for all records: one that contradicts them alone is a poor witness.
    """
    everywhere = all(finding.name in {other.name for other in findings} for findings in by_record)
    if finding.name in OF_ALL_RECORDS and not everywhere and finding.grade is Grade.SEVERE:
        return replace(finding, grade=Grade.CAUTION)
    return finding


def _findings(
    recording: Recording,
    bench: AnyBench,
    flows: Mapping[str, MeteredFlow],
    entries: ColumnEntries,
) -> Iterator[Finding]:
    _check_channels(recording, bench)
    _check_clock(recording, bench)
    check_ranges(recording, bench, entries)
    yield from check_sensors(recording, bench)
    yield from check_continuity(recording)
    if isinstance(bench, Bench):
        yield from check_supply(recording, bench, flows, entries)
        record = smoothed_record(recording)
        if record is None:
            yield cannot_tell(recording)
            return
        yield from check_chambers(record, entries)
        yield from check_mass_balances(record, bench, flows, entries)
        yield from check_force_balance(record, bench, entries)
        yield from check_timing(recording, bench, entries)
        yield from check_motion_sensors(record, bench, entries)
        return
    record = smoothed_record(recording)
    if record is None:
        return
    if isinstance(bench, PressureBench):
        yield from check_driven_mass(record, bench, entries)
    else:
        yield from check_measured_force(record, bench, entries)
    yield from check_motion_sensors(record, bench, entries)


#: Where nobody recorded the reference, nothing can be said of the closed loop.
_WITHOUT_REFERENCE = '; if it was not recorded, write in bench.json "controller": {"type": "none"}'


def _check_channels(recording: Recording, bench: AnyBench) -> None:
    reference = ("x_ref",) if bench.controller.closes_loop else ()
    needed = (*bench.kind.inputs, *bench.kind.outputs, *reference)
    missing = [column_name(name) for name in needed if name not in recording]
    if missing:
        names = _names_in_file(recording)
        raise CaseError(
            f"{recording.source}: no column {', '.join(f'`{name}`' for name in missing)}; the file "
            f"has {', '.join(f'`{name}`' for name in names)}; add the column, or write in "
            f'{COLUMNS_FILE} which of them it is, as "{missing[0]}": "NAME"'
            + (_WITHOUT_REFERENCE if missing == [column_name("x_ref")] else "")
        )
    if recording.N < FEWEST_ROWS:
        raise CaseError(
            f"{recording.source}: {recording.N} rows, fewer than {FEWEST_ROWS}: too few to learn "
            "from; was the file cut short?"
        )


def _names_in_file(recording: Recording) -> tuple[str, ...]:
    """Return the columns of the file of a recording, or its channels where there is no file."""
    path = Path(recording.source)
    if path.is_file() and suffix_of(path):
        return read_table(path, ()).names
    return tuple(column_name(name) if name in UNITS else name for name in ("t", *recording.names))


def _check_clock(recording: Recording, bench: AnyBench) -> None:
    step = recording.dt
    fits = [(step, 0.0)]  # steps of which one must fit, and what jitter may add to each [1]
    if recording.clock is Clock.AS_RECORDED:
        # Jitter moves the median, and not the mean; lost samples move the mean, and so do single
        # samples that come late, by any time.
        intervals = np.diff(recording.t)
        step = float(np.mean(intervals))
        counts = np.maximum(np.round(intervals / np.median(intervals)), 1.0)
        complete = float(np.sum(intervals) / np.sum(counts))
        usual, spread, share = usual_step(intervals, near=NEAR)
        # Lateness cancels in the mean of all steps, and not in that of some.
        jitter = SIGMAS_OF_JITTER * float(np.std(intervals)) / (intervals.size * step)
        of_some = SIGMAS_OF_JITTER * spread / ((share * intervals.size) ** 0.5 * step)
        fits = [(step, jitter), (complete, jitter)]
        if share >= 1 - RARE:  # else another clock, with steps now of one length and now of another
            fits.append((usual, min(of_some, MOST_JITTER)))
    recorded, expected = 1 / step, bench.sampling_frequency
    if any(abs(1 / (s * expected) - 1) <= CLOCK_TOLERANCE + more for s, more in fits):
        return
    if abs(recorded * 1e3 / expected - 1) <= CLOCK_TOLERANCE:
        remedy = "is `t` in ms?"
    else:
        remedy = "correct `t` or the bench's `sampling_frequency`"
    raise CaseError(
        f"{recording.source}: `t` steps by {step:.6g} s, that is {recorded:.6g} Hz, but "
        f"the bench samples at {expected:.6g} Hz; {remedy}"
    )
