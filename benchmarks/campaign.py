"""Question: what do damaged files do.

Data: a short case, a result and files of EMPS, to which one of the kinds of damage in `damage/` is
done at random. Each is read in a process that is watched: `tracebacks` are exceptions that are no
errors of the package, `hangs` take longer than five seconds, `crashes` end the process, `silent`
are accepted although the damage contradicts what is due, `valid_refused` are valid variants that
are refused, `nameless` are errors that do not name their file. A share goes through the command
line. Nothing is fitted. A hang takes five seconds of the processor, or a minute of the clock.
"""

import argparse
import contextlib
import io
import logging
import multiprocessing
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import provenance
from damage.base import all_kinds, make_bases
from damage.kind import Due, Kind, Subject
from tables.robustness import FAULTS

#: Seconds of processor time, and of the clock, after which reading counts as hanging: other work
#: on the machine must not make a hang.
LIMIT, CLOCK_LIMIT = 5.0, 60.0
#: Every how many-th case goes through the command line.
COMMANDS = 50
#: Cases that a process reads before it is replaced: memory that leaks must not add up.
LIFE = 2000


@dataclass
class Outcome:
    """What reading a damaged file came to."""

    kind: str
    fault: str = ""
    message: str = ""
    seconds: float = 0.0
    how: str = ""


def read_damaged(kind: Kind, seed: int, bases: Path, scratch: Path, command: bool) -> Outcome:
    """Damage a copy of a sound folder, read it, and say what was wrong with that."""
    folder = scratch / f"axis{seed}"
    shutil.copytree(bases / kind.subject.value, folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            kind.damage(folder, random.Random(seed))
        began = time.process_time()
        outcome = _by_command(kind, folder) if command else _in_process(kind, folder, bases)
        outcome.seconds = time.process_time() - began
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return outcome


def _in_process(kind: Kind, folder: Path, bases: Path) -> Outcome:
    from pneumo_casadi.errors import PneumoError

    try:
        with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
            warnings.simplefilter("error", RuntimeWarning)
            grades = _read(kind.subject, folder, bases)
    except PneumoError as error:
        return _judged(kind, str(error), ())
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        text = f"{type(error).__name__}: {str(error)[:200]} ({place})"
        return Outcome(kind.name, "tracebacks", text)
    return _judged(kind, None, grades)


def _read(subject: Subject, folder: Path, bases: Path) -> list[str]:
    """Read a folder as the commands do before their work; return the grades of what they say."""
    import pneumo_casadi as pc
    from pneumo_casadi.data.bench.bench import Bench
    from pneumo_casadi.data.truth import read_truth
    from pneumo_casadi.identification.flow_form import read_flow_maps
    from pneumo_casadi.identification.read_result import read_axis

    if subject is Subject.RESULT:
        pc.read_model(folder / "result.json")
        read_axis(folder / "result.json", pc.read_case(bases / Subject.CASE.value, check=False))
        return []
    checked = pc.check(folder)
    read_truth(folder)
    if isinstance(checked.case.bench, Bench) and checked.case.bench.valves.metered:
        read_flow_maps(checked.case, checked.case.bench)
    return [str(finding.grade) for finding in checked.findings]


def _judged(kind: Kind, message: str | None, grades: Sequence[str]) -> Outcome:
    """Compare an error (None: none) and the grades of findings with what is due."""
    if message is not None:
        how = "refused"
        if kind.due is Due.ACCEPT:
            return Outcome(kind.name, "valid_refused", message, how=how)
        if kind.file not in message or "\n" in message:
            return Outcome(kind.name, "nameless", message, how=how)
        return Outcome(kind.name, how=how)
    how = "severe" if "severe" in grades else "finding" if grades else "silent"
    if kind.due is Due.ACCEPT and how == "severe":
        return Outcome(kind.name, "valid_refused", "a severe finding", how=how)
    if (kind.due is Due.REFUSE and how != "severe") or (kind.due is Due.FINDING and not grades):
        return Outcome(kind.name, "silent", "accepted", how=how)
    return Outcome(kind.name, how=how)


def _by_command(kind: Kind, folder: Path) -> Outcome:
    """Run the command that reads such a folder."""
    arguments = ["check", str(folder), "--strict"]
    if kind.subject is Subject.RESULT:
        arguments = ["export", str(folder), "-f", "json", "-o", str(folder / "out")]
    command = [sys.executable, "-m", "pneumo_casadi", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, timeout=CLOCK_LIMIT, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(kind.name, "hangs", " ".join(arguments[:1]))
    said = done.stderr.decode("utf-8", "replace")
    if done.returncode < 0:
        return Outcome(kind.name, "crashes", f"signal {-done.returncode}")
    if "Traceback" in said:
        return Outcome(kind.name, "tracebacks", said.strip().splitlines()[-1][:200])
    lines = [line for line in said.splitlines() if line.startswith("error: ")]
    if done.returncode == 2 and kind.due is Due.ACCEPT:
        return Outcome(kind.name, "valid_refused", said[-300:])
    if done.returncode == 2 and (len(lines) != 1 or kind.file not in lines[0]):
        return Outcome(kind.name, "nameless", said[-300:])
    how = {0: "accepted", 3: "severe"}.get(done.returncode, "refused")
    if how == "accepted" and kind.due is Due.REFUSE:
        return Outcome(kind.name, "silent", said[-300:], how=how)
    return Outcome(kind.name, how=how)


def work(connection: Connection, bases: Path, scratch: Path) -> None:
    """Read what is asked for until nothing is."""
    logging.getLogger("pneumo_casadi").setLevel(logging.CRITICAL)
    kinds = {kind.name: kind for kind in all_kinds()}
    while (task := connection.recv()) is not None:
        name, seed, command = task
        connection.send(read_damaged(kinds[name], seed, bases, scratch, command))


@dataclass
class Worker:
    """A process that reads, and what it is at."""

    bases: Path
    scratch: Path
    task: tuple[str, int, bool] | None = None
    since: float = 0.0
    done: int = 0
    connection: Any = field(init=False)
    process: Any = field(init=False)

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        """Start the process anew."""
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=work, args=(other, self.bases, self.scratch))
        self.process.start()
        other.close()
        self.done = 0

    def give(self, task: tuple[str, int, bool]) -> None:
        """Give it a task."""
        self.task, self.since = task, time.monotonic()
        self.connection.send(task)

    def result(self) -> Outcome | None:
        """Return what became of the task, None where it is not done yet."""
        assert self.task is not None
        try:
            if self.connection.poll():
                outcome: Outcome = self.connection.recv()
                self.done += 1
                if outcome.seconds > LIMIT and self.done > 1 and not outcome.fault:
                    outcome.fault = "hangs"  # the first one imports the package
                if self.done >= LIFE:
                    self.stop()
                    self.start()
                return outcome
        except (EOFError, ConnectionError):
            self.process.join()
            outcome = Outcome(self.task[0], "crashes", f"exit code {self.process.exitcode}")
            self.start()
            return outcome
        if time.monotonic() - self.since < CLOCK_LIMIT + 10.0:
            return None
        self.process.kill()
        self.process.join()
        self.start()
        return Outcome(self.task[0], "hangs", f"seed {self.task[1]}")

    def stop(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            self.connection.send(None)
        self.process.join(5)
        self.process.kill()


def outcomes(
    tasks: Iterator[tuple[str, int, bool]], bases: Path, scratch: Path, workers: int
) -> Iterator[tuple[tuple[str, int, bool], Outcome]]:
    """Yield what became of each task, several at a time."""
    pool = [Worker(bases, scratch) for _ in range(workers)]
    try:
        busy = []
        for worker in pool:
            task = next(tasks, None)
            if task is not None:
                worker.give(task)
                busy.append(worker)
        while busy:
            wait([worker.connection for worker in busy], timeout=0.5)
            for worker in list(busy):
                outcome = worker.result()
                if outcome is None:
                    continue
                assert worker.task is not None
                yield worker.task, outcome
                task = next(tasks, None)
                if task is None:
                    busy.remove(worker)
                else:
                    worker.give(task)
    finally:
        for worker in pool:
            worker.stop()


def campaign(
    cases: int, seed: int, workers: int = 2, only: str = "", commands: int = COMMANDS
) -> dict[str, Any]:
    """Read damaged files, each kind as often as the others.

    Parameters
    ----------
    cases : int
        How many.
    seed : int
        Of the damage.
    workers : int, optional
        Processes.
    only : str, optional
        Part of the names of the kinds to be done.
    commands : int, optional
        Every how many-th case goes through the command line; 0 for none.

    Returns
    -------
    dict
        Counts of the faults, by kind too, and examples.
    """
    kinds = [kind for kind in all_kinds() if only in kind.name]
    rng = random.Random(seed)

    def tasks() -> Iterator[tuple[str, int, bool]]:
        order: list[Kind] = []
        for case in range(cases):
            order = order or rng.sample(kinds, len(kinds))
            command = bool(commands) and case % commands == commands - 1
            yield order.pop().name, rng.randrange(2**40), command

    faults: Counter[str] = Counter()
    table = {kind.name: {"due": kind.due.value, "cases": 0} for kind in kinds}
    examples: dict[str, str] = {}
    with tempfile.TemporaryDirectory(dir=_memory()) as name:
        bases, scratch = Path(name) / "bases", Path(name) / "scratch"
        bases.mkdir()
        scratch.mkdir()
        make_bases(bases, any(kind.subject is Subject.RESULT for kind in kinds))
        for task, outcome in outcomes(tasks(), bases, scratch, workers):
            row: dict[str, Any] = table[outcome.kind]
            row["cases"] += 1
            if outcome.how:
                row[outcome.how] = row.get(outcome.how, 0) + 1
            if outcome.fault:
                faults[outcome.fault] += 1
                row[outcome.fault] = row.get(outcome.fault, 0) + 1
                where = "command" if task[2] else "in process"
                examples.setdefault(
                    f"{outcome.kind} ({outcome.fault})", f"{where}, {task[1]}: {outcome.message}"
                )
    return {
        "cases": cases,
        **{fault: faults[fault] for fault in FAULTS},
        "kinds": table,
        "examples": examples,
    }


def _memory() -> str | None:
    """Return a folder in memory where there is one: files come and go by the thousands."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the campaign and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", default="", help="part of the names of the kinds")
    parser.add_argument(
        "--commands", type=int, default=COMMANDS, help="one case in so many by the command line"
    )
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args(arguments)
    cases = 200 if options.quick else options.cases
    figures: Mapping[str, Any] = campaign(
        cases, options.seed, options.workers, options.only, options.commands
    )
    provenance.write(
        options.json,
        {**provenance.made(options.seed, options.quick, "pandas", "msgspec"), **figures},
    )
    for name in ("cases", *FAULTS):
        print(f"{name:14} {figures[name]}")
    for kind, example in sorted(figures["examples"].items()):
        print(f"{kind}: {example}")


if __name__ == "__main__":
    main()
