"""Question: what does a batch cost beside its diagnoses, and how much faster are two workers.

Cases of the virtual bench, one effect in turn, are diagnosed with the whole catalogue one after
the other in this process, by two processes, and by two Dask workers where `distributed` is
installed. Outside the work is all time that no diagnosis takes: hashing data, sending tasks,
writing records and tables. It is measured twice: on the real run in this process, and on many
tasks without any work on the same data, where nothing hides it; the bar is 5 % of the work.
Speed-ups count from a pool that has started; what its start takes stands beside them.
"""

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from provenance import made, write

from pneumo_casadi.diagnosis import diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.evaluation.batch import Row, diagnose_many
from pneumo_casadi.evaluation.batch.run import Diagnosing, real_diagnosis
from pneumo_casadi.runtime.processes import processes
from pneumo_casadi.virtual_bench import make_case

SINGLE_EFFECTS = ("spring_load", "stribeck", "heat_transfer", "leakage_P")
BAR_PERCENT = 5.0
WORKERS = 2


def no_work(folder: Path) -> dict[str, Any]:
    """Return at once what a diagnosis could have said."""
    gap = {"before": 1.0, "after": 0.5, "shrink": 0.5, "shrink_interval": [0.4, 0.6]}
    return {
        "verdict": "effect",
        "effects": [{"name": "hose", "probability": 0.9}],
        "ambiguous": [],
        "where": {"balance": "force"},
        "gap": gap,
    }


def one_effect(folder: Path) -> dict[str, Any]:
    """Diagnose with a catalogue of one effect, for a quick run."""
    return diagnose(folder, {SINGLE_EFFECTS[0]: EFFECTS[SINGLE_EFFECTS[0]]}).as_dict()


@contextmanager
def dask_workers(number: int) -> Iterator[Executor]:
    """Yield the executor of a local cluster, one thread a process, set as the how-to says."""
    import dask
    from distributed import Client, LocalCluster

    settings = {
        "distributed.worker.profile.enabled": False,
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    }
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=number, threads_per_worker=1, dashboard_address=None, silence_logs="CRITICAL"
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client.get_executor()


def make_cases(folder: Path, number: int, duration: float) -> list[Path]:
    """Record cases of random axes, one effect each in turn."""
    folders = [folder / f"b{seed:03d}" for seed in range(number)]
    for seed, case_folder in enumerate(folders):
        asked = {SINGLE_EFFECTS[seed % len(SINGLE_EFFECTS)]: "large"}
        make_case(case_folder, seed, asked, duration=duration)
    return folders


def linked(cases: Sequence[Path], folder: Path, number: int) -> list[Path]:
    """Return many folders with the data of a few."""
    folder.mkdir()
    copies = [folder / f"n{i:04d}" for i in range(number)]
    for i, copy in enumerate(copies):
        copy.symlink_to(cases[i % len(cases)], target_is_directory=True)
    return copies


def warm(executor: Executor | None, cases: Sequence[Path], scratch: Path) -> None:
    """Have all workers do their imports."""
    if executor is not None:
        many = linked(cases, scratch / "warm", 4 * WORKERS)
        diagnose_many(many, executor, keep=scratch / "warm_out", diagnosing=slow)


def slow(folder: Path) -> dict[str, Any]:
    """Take so long that one worker cannot do it all."""
    time.sleep(0.5)
    return no_work(folder)


def timed(
    cases: Sequence[Path], executor: Executor | None, keep: Path, diagnosing: Diagnosing
) -> tuple[float, tuple[Row, ...]]:
    """Return the time of a batch and its rows."""
    began = time.perf_counter()
    rows = diagnose_many(cases, executor, keep=keep, diagnosing=diagnosing)
    return time.perf_counter() - began, rows


def measure(
    name: str,
    opening: AbstractContextManager[Executor | None],
    cases: list[Path],
    empty: int,
    diagnosing: Diagnosing,
) -> dict[str, Any]:
    """Run the cases, and tasks without work, on an executor."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as held, opening as executor:
        scratch = Path(held)
        warm(executor, cases, scratch)
        start = time.perf_counter() - began
        wall, rows = timed(cases, executor, scratch / "out", diagnosing)
        failed = [f"{row.case}: {row.error}" for row in rows if row.error]
        if failed:
            raise SystemExit(f"{name}: {failed[0]}")
        work = [row.seconds for row in rows if row.seconds is not None]
        again, _ = timed(cases, executor, scratch / "out", diagnosing)
        bare, _ = timed(linked(cases, scratch / "many", empty), executor, scratch / "bare", no_work)
    result = {
        "workers": 1 if executor is None else WORKERS,
        "start_s": start,
        "wall_s": wall,
        "work_s": sum(work),
        "work_per_case_s": statistics.mean(work),
        "resumed_s_per_case": again / len(cases),
        "outside_s_per_case": bare / empty,
        "outside_percent": 100 * bare / empty / statistics.mean(work),
        "verdicts": {row.case: [row.verdict, *row.effects] for row in rows},
    }
    print(
        f"{name}: {wall:.1f} s for {len(cases)} cases, {result['work_per_case_s']:.1f} s of work "
        f"each; outside it {1e3 * bare / empty:.1f} ms a case, {result['outside_percent']:.2f} %",
        flush=True,
    )
    return result


def run(number: int, duration: float, empty: int, diagnosing: Diagnosing) -> dict[str, Any]:
    """Measure all executors on the same cases."""
    with tempfile.TemporaryDirectory() as held:
        cases = make_cases(Path(held) / "cases", number, duration)
        # Compiles every model that any case asks for; counts for nobody.
        with processes(WORKERS) as pool:
            diagnose_many(cases, pool, keep=Path(held) / "first", diagnosing=diagnosing)
        openings: dict[str, AbstractContextManager[Executor | None]]
        openings = {"in turn": processes(1), "processes": processes(WORKERS)}
        if find_spec("distributed") is not None:
            openings["dask"] = dask_workers(WORKERS)
        result = {
            name: measure(name, opening, cases, empty, diagnosing)
            for name, opening in openings.items()
        }
    alone = result["in turn"]
    alone["outside_real_percent"] = 100 * (alone["wall_s"] / alone["work_s"] - 1)
    for name, entry in result.items():
        entry["speed_up"] = alone["wall_s"] / entry["wall_s"]
        entry["same_verdicts"] = entry["verdicts"] == alone["verdicts"]
        print(
            f"{name}: speed-up {entry['speed_up']:.2f}, same: {entry['same_verdicts']}", flush=True
        )
    return {
        "cases": number,
        "duration_s": duration,
        "empty_tasks": empty,
        "bar_percent": BAR_PERCENT,
        "load_before": os.getloadavg()[0],
        "executors": result,
    }


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--cases", type=int, default=12, help="how many to diagnose")
    parser.add_argument(
        "--quick",
        action="store_true",
        help="two cases, one effect in the catalogue, 100 tasks without work",
    )
    arguments = parser.parse_args()
    number, empty = (2, 100) if arguments.quick else (arguments.cases, 1000)
    result = run(number, 4.0, empty, one_effect if arguments.quick else real_diagnosis)
    packages = ["pandas", "pyarrow", "numba"]
    packages += ["distributed"] if find_spec("distributed") is not None else []
    write(arguments.json, {**made(0, arguments.quick, *packages), **result})


if __name__ == "__main__":
    main()
