"""A share of each campaign of `benchmarks/`, all in one process, which imports the package once.

Arguments: a result file, and a folder where the figures of each campaign go. It runs in
`benchmarks/`, so that its scripts can be imported.
"""

import multiprocessing
import os
import signal
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from shutil import copy
from typing import Any

#: Rows of the records: enough for all that is checked, and read in a third of the time.
ROWS = {"identify.csv": 2000, "validate.csv": 1500}


def once(named: Iterable[Any]) -> list[Any]:
    """Keep what is done to several JSON files, which have one reader, for one of them by turns.

    Where only some files owe an error, it is one of these.
    """
    groups = defaultdict(list)
    for item in named:
        groups[any_json(item) or item.name].append(item)
    chosen = []
    for k, group in enumerate(groups.values()):
        strict = [item for item in group if getattr(item, "due", None) is not Due.ANY] or group
        chosen.append(strict[k % len(strict)])
    return chosen


def any_json(item: Any) -> str:
    """Return what is done to a JSON file; an empty text for other files."""
    file, _, what = item.name.partition(": ")
    return what if file.endswith(".json") else ""


def spread(named: Iterable[Any], every: int) -> list[Any]:
    """Return one in `every` things that are done to each file, the last one always."""
    groups = defaultdict(list)
    for item in named:
        groups[item.name.partition(":")[0]].append(item)
    return [item for group in groups.values() for item in group[::-every]]


def share(all_of_them: Sequence[Any], every: int) -> list[Any]:
    """Return what is done to any JSON file, and a spread of the others."""
    repeated = Counter(any_json(item) for item in all_of_them)
    chosen = once(all_of_them)
    general = [item for item in chosen if any_json(item) and repeated[any_json(item)] > 1]
    return general + spread((item for item in chosen if item not in general), every)


def parquet(folder: Path, canary: Path) -> None:
    """Write two hundred million rows as the attack does, but empty ones: that takes a quarter."""
    (folder / "identify.csv").unlink()
    table = pa.table({"t_s": pa.nulls(10**6, pa.float64())})
    with pq.ParquetWriter(folder / "identify.parquet", table.schema) as writer:
        for _ in range(200):
            writer.write_table(table)


def make_sound_files(result: Path, folder: Path) -> None:
    """Write what the campaigns damage: a case with short records, a result, and files of EMPS."""
    for subject in Subject:
        (folder / subject.value).mkdir(parents=True)
    case = folder / Subject.CASE.value
    case.rmdir()
    base.short_case(case)
    for name, rows in ROWS.items():
        lines = (case / name).read_text("utf-8").splitlines(keepends=True)
        (case / name).write_text("".join(lines[: rows + 1]), "utf-8")
    base.write_emps(folder / Subject.EMPS.value)
    copy(result, folder / Subject.RESULT.value / "result.json")


def main(result: Path, folder: Path) -> None:
    """Make the files and run the campaigns on them."""
    os.environ[base.KEPT] = str(folder / "sound")
    make_sound_files(result, folder / "sound")
    pc.check(folder / "sound" / Subject.CASE.value)  # what is imported late is there for all forks

    exhaustion.parquet = parquet
    attacks = share(tuple(hostile.attacks()), 4)
    kinds = share(campaign.all_kinds(), 6)
    hostile.attacks = lambda: iter(attacks)
    campaign.all_kinds = lambda: tuple(kinds)
    # The worker is a fork too.
    fork = multiprocessing.get_context("fork")
    multiprocessing.get_context = lambda method=None: fork
    options = ["--workers", "1", "--commands", "0", "--cases", str(len(kinds)), "--seed", "4"]
    campaign.main([*options, "--json", str(folder / "damage.json")])
    hostile.main(["--quick", "--json", str(folder / "hostility.json")])
    if Path("/proc").is_dir():
        # What a command can clean up after, and what it cannot; tests/runtime/ ends workers,
        # compilers and compiled functions by each signal.
        kills.SIGNALS = (signal.SIGINT, signal.SIGKILL)
        options = ["--kills", "2", "--seed", "7", "--only", "init", "--quick"]
        kills.main([*options, "--json", str(folder / "kills.json")])


if __name__ == "__main__":
    sys.path.insert(0, str(Path.cwd()))
    import campaign
    import h5py  # noqa: F401
    import hostile
    import kills
    import pyarrow as pa
    import pyarrow.parquet as pq
    from damage import base
    from damage.kind import Due, Subject
    from hostility import exhaustion

    import pneumo_casadi as pc
    from pneumo_casadi.cli import app  # noqa: F401

    main(Path(sys.argv[1]), Path(sys.argv[2]))
