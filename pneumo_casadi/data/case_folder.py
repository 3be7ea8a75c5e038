"""Case folders: read, and written whole or not at all."""

import gzip
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneumo_casadi.data.bench.bench_file import bench_content, read_bench
from pneumo_casadi.data.bench.driven_bench import AnyBench, PressureBench, is_metered
from pneumo_casadi.data.case import Case
from pneumo_casadi.data.checks.finding import Finding, Grade, merge_findings
from pneumo_casadi.data.checks.metered_flow import metered_flows
from pneumo_casadi.data.emps import IDENTIFY as EMPS_FILE
from pneumo_casadi.data.emps import read_emps
from pneumo_casadi.data.readers.column_entries import ColumnEntries
from pneumo_casadi.data.readers.columns import COLUMNS_FILE, ColumnSpec, read_columns
from pneumo_casadi.data.readers.recordings import read_stretches
from pneumo_casadi.data.readers.tables import suffix_of
from pneumo_casadi.data.record_checks import check_records
from pneumo_casadi.data.recording.channels import UNITS, InputHold, column_name
from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.data.seal_friction import is_seal_friction, read_seal_friction
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.atomic_files import atomic_folder
from pneumo_casadi.runtime.input_files import is_named
from pneumo_casadi.runtime.output_folder import check_new

TIME_DECIMALS = 10
#: Of compression: higher ones take three times as long and save three per cent.
LEVEL = 4
#: The case that comes with the package.
EXAMPLE = Path(__file__).parent / "examples" / "table1"


def read_case(
    folder: str | Path,
    check: bool = True,
    hold: InputHold | None = None,
    columns: Mapping[str, ColumnSpec] | None = None,
) -> Case:
    """Read a case folder, or public measurements (EMPS, seal friction) that lie in the folder.

    A case folder holds ``bench.json``, one or more records ``identify*`` and any number of records
    ``validate*`` (.csv, .csv.gz, .mat, .parquet; in the order of their names), and
    ``flow_map.csv`` where the valve was metered, or ``flow_map_P.csv`` and ``flow_map_N.csv`` where
    the two valves differ.

    Parameters
    ----------
    folder : str or Path
        The case folder.
    check : bool, optional
        Whether to compare the records with the bench (`check_records`).
    hold : InputHold, optional
        Course of the commands between samples: constant (``ZERO``, right for commands of a sampled
        controller) or linear (``LINEAR``, for a measured continuous signal). By default constant,
        and linear for a pressure-driven axis, whose inputs are measured.
    columns : mapping, optional
        Names and units of columns that are not those of a case folder; see `read_recording`.
        By default those in ``columns.json``, if the folder contains one; see
        `read_columns`.

    Raises
    ------
    CaseError
        If something is missing, cannot be read, or contradicts the bench.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> case = pc.read_case(pc.data.EXAMPLE)
    >>> case.name, case.bench.stroke, case.identify[0].names
    ('table1', 0.5, ('u_P', 'u_N', 'p_P', 'p_N', 'x', 'x_ref'))
    """
    refuse = True if check else None
    return _read(Path(folder), refuse, hold, columns)


def inspect_case(folder: str | Path) -> Case:
    """Read a case folder as `read_case` does, contradictions of records being severe findings."""
    return _read(Path(folder), False, None, None)


def _read(
    folder: Path,
    refuse: bool | None,
    hold: InputHold | None,
    columns: Mapping[str, ColumnSpec] | None,
) -> Case:
    """Read a case; `refuse` as in `check_records`, None to leave the checks out."""
    if (folder / EMPS_FILE).is_file() and not (folder / "bench.json").exists():
        return read_emps(folder)
    if is_seal_friction(folder):
        return read_seal_friction(folder)
    if not folder.is_dir():
        raise CaseError(f"{folder}: no such folder; give the folder that holds bench.json")
    bench = read_bench(folder / "bench.json")
    if columns is None and is_named(folder / COLUMNS_FILE):
        columns = read_columns(folder / COLUMNS_FILE)
    files = {
        role: [
            read_stretches(path, hold or _hold_of(bench), columns, bench.clock)
            for path in _record_files(folder, role)
        ]
        for role in ("identify", "validate")
    }
    one_command = any(file.one_command for contents in files.values() for file in contents)
    records = {
        role: tuple(part for file in contents for part in file.stretches)
        for role, contents in files.items()
    }
    bench, findings = _with_signals(bench, [*records["identify"], *records["validate"]])
    records = {role: _without_unused(parts, bench) for role, parts in records.items()}
    if refuse is not None:
        findings += check_records(
            (*records["identify"], *records["validate"]),
            bench,
            metered_flows(folder) if is_metered(bench) else {},
            ColumnEntries(columns or {}, one_command),
            refuse,
        )
    maps = _flow_maps(folder)
    return Case(
        folder,
        bench,
        records["identify"],
        records["validate"],
        maps[0],
        merge_findings(findings),
        maps[1],
    )


def _hold_of(bench: AnyBench) -> InputHold:
    """Return the course of the inputs of a kind of axis between samples.

    Held pressures would be half a sample late, which a fit takes for another mass.
    """
    return InputHold.LINEAR if isinstance(bench, PressureBench) else InputHold.ZERO


def _with_signals(
    bench: AnyBench, records: Sequence[Recording]
) -> tuple[AnyBench, tuple[Finding, ...]]:
    """Return the bench with the further signals that all records have, and what the others lack."""
    known = {name for name in bench.kind.further for record in records if name in record}
    shared = {name for name in known if all(name in record for record in records)}
    findings = tuple(
        Finding(
            Grade.CAUTION,
            "missing signal",
            name,
            f"no column `{column_name(name)}`, which other records have: it is not used; add it.",
            source=record.name,
        )
        for name in sorted(known - shared)
        for record in records
        if name not in record
    )
    return (replace(bench, signals=frozenset(shared)) if shared else bench), findings


def _without_unused(records: Sequence[Recording], bench: AnyBench) -> tuple[Recording, ...]:
    """Return the records without the further signals that only some of them have."""
    unused = set(bench.kind.further) - bench.signals
    return tuple(record.without(unused) for record in records)


def _flow_maps(folder: Path) -> tuple[Path | None, Path | None]:
    """Return the map of both valves, or of chamber P's and of chamber N's where they differ."""
    shared, P, N = (folder / f"flow_map{end}.csv" for end in ("", "_P", "_N"))
    own = is_named(P) or is_named(N)
    if own and not (is_named(P) and is_named(N)):
        missing = N if is_named(P) else P
        raise CaseError(f"{missing}: no such file; give the map of both valves, or flow_map.csv")
    if own and is_named(shared):
        raise CaseError(f"{shared}: stands beside {P.name} and {N.name}; keep one or the other")
    if own:
        return P, N
    return (shared if is_named(shared) else None), None


def _record_files(folder: Path, role: str) -> list[Path]:
    files = sorted(path for path in folder.glob(f"{role}*") if suffix_of(path))
    stems = [path.name.removesuffix(suffix_of(path)) for path in files]
    twice = sorted({stem for stem in stems if stems.count(stem) > 1})
    if twice:
        raise CaseError(
            f"{folder}: record {', '.join(twice)} stands there in two formats; keep one of them"
        )
    return files


def example_case() -> Case:
    """Return the case that comes with the package.

    A servo axis with the parameters of the paper's Table 1, recorded at 5 kHz: 10 s to identify
    on, 8 s held out, and a measured flow map. Its true parameters stand in ``truth.json`` of its
    folder.

    Examples
    --------
    >>> record = example_case().identify[0]
    >>> round(record.duration), record.N
    (10, 50000)
    """
    return read_case(EXAMPLE)


def write_case(
    folder: str | Path,
    bench: AnyBench,
    identify: Sequence[Recording],
    validate: Sequence[Recording] = (),
    flow_map: str | Path | Mapping[str, ArrayLike] | None = None,
    flow_map_N: str | Path | Mapping[str, ArrayLike] | None = None,
) -> Case:
    """Write a case folder that `read_case` reads back, number for number.

    The folder appears in one step once everything is written; numbers have as many digits as
    they need.

    Parameters
    ----------
    folder : str or Path
        Folder to make; it must be new or empty.
    bench : Bench or ForceBench
        The axis.
    identify, validate : sequence of Recording
        One record gives ``identify.csv.gz``, several ``identify_1.csv.gz`` and so on.
    flow_map : path or mapping of str to (n,) array, optional
        ``flow_map.csv`` to copy (unpacked where it ends in ``.gz``), or its columns by name.
    flow_map_N : path or mapping of str to (n,) array, optional
        The map of the valve of chamber N where the valves differ; `flow_map` is then P's.

    Returns
    -------
    Case
        The case as written.

    Raises
    ------
    CaseError
        If the folder holds something, a record cannot stand in a case folder, or there is a map
        of chamber N's valve alone.

    Examples
    --------
    >>> import tempfile
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> short = [case.identify[0].window(5.0, 5.5)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     copy = pc.write_case(folder, case.bench, short, flow_map=case.flow_map_path)
    ...     sorted(path.name for path in copy.folder.iterdir())
    ['bench.json', 'flow_map.csv', 'identify.csv.gz']
    """
    folder = Path(folder)
    check_new(folder)
    if not identify:
        raise CaseError(f"{folder}: no record to identify on; a case needs at least one")
    if flow_map_N is not None and flow_map is None:
        raise CaseError(f"{folder}: a map of chamber N's valve alone; give that of chamber P's too")
    with atomic_folder(folder, over=False) as draft:
        text = json.dumps(bench_content(bench), indent=1, ensure_ascii=False)
        (draft / "bench.json").write_text(text + "\n", "utf-8")
        for role, records in (("identify", identify), ("validate", validate)):
            for name, recording in zip(_file_names(role, len(records)), records, strict=True):
                _write_csv(draft / name, _columns(recording, _hold_of(bench)))
        end = "" if flow_map_N is None else "_P"
        for name, table in ((f"flow_map{end}.csv", flow_map), ("flow_map_N.csv", flow_map_N)):
            if isinstance(table, Mapping):
                _write_csv(draft / name, table)
            elif table is not None and str(table).endswith(".gz"):
                with gzip.open(table) as packed, (draft / name).open("wb") as plain:
                    shutil.copyfileobj(packed, plain)
            elif table is not None:
                shutil.copyfile(table, draft / name)
    maps = _flow_maps(folder)
    return Case(folder, bench, tuple(identify), tuple(validate), maps[0], flow_map_N_path=maps[1])


def _file_names(role: str, count: int) -> list[str]:
    if count == 1:
        return [f"{role}.csv.gz"]
    digits = len(str(count))  # padded, so that the order of names is the order of records
    return [f"{role}_{number:0{digits}d}.csv.gz" for number in range(1, count + 1)]


def _columns(recording: Recording, hold: InputHold) -> dict[str, ArrayLike]:
    if recording.hold is not hold:
        course = "run linearly" if hold is InputHold.LINEAR else "are held at zero order"
        raise CaseError(
            f"{recording.name}: hold {recording.hold.value}, but the inputs of such a case folder "
            f"{course} between samples; resample the inputs"
        )
    unknown = [name for name in recording.names if name not in UNITS]
    if unknown:
        raise CaseError(
            f"{recording.name}: no unit is known for channel {', '.join(unknown)}; a case folder "
            f"holds {', '.join(UNITS)}"
        )
    columns: dict[str, ArrayLike] = {"t_s": np.round(recording.t, TIME_DECIMALS)}
    return columns | {column_name(name): recording[name] for name in recording.names}


def _write_csv(path: Path, columns: Mapping[str, Any]) -> None:
    # As pandas writes them, digit for digit, in a quarter of its time.
    arrays = {name: np.asarray(values, float) for name, values in columns.items()}
    rows = np.column_stack(list(arrays.values())).tolist()
    lines = [",".join(arrays), *(",".join(map(repr, row)) for row in rows), ""]
    text = "\n".join(lines).encode()
    # A fixed time stamp: equal data give equal files.
    path.write_bytes(gzip.compress(text, LEVEL, mtime=0) if path.suffix == ".gz" else text)
