"""Question: what does a command leave that is ended in the middle of its work.

Data: every command on a short case, ended at a random time of its run by SIGINT, SIGTERM, SIGHUP or
SIGKILL, some with an empty cache, and then run again. `half` counts outputs that are neither whole
nor absent, `left_processes` those alive five seconds later, `left_drafts` temporary files and
folders that are there after the next run, `different` results of that run that are not those of an
undisturbed one; `interrupt_s_p95` is the time from Ctrl-C to the end, 95th percentile. The longest
times by command are in `slowest`. With `--quick` the next run is a fork of this process, which has
imported all that it needs. Needs Linux: processes are told by their environment.
"""

import argparse
import contextlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import provenance
from damage.base import make_bases
from damage.kind import Subject
from hostility.attack import run_forked

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
#: After this time no process may be left [s].
GONE = 5.0
#: Longest time of a command that nothing disturbs [s].
LONGEST = 1800.0
#: One kill in so many begins with an empty cache: then models are compiled.
FRESH = 4
#: Environment variable that marks the processes of a run.
MARK = "PNEUMO_CASADI_KILLS"
#: Digests (some with a secret salt) and entries of results that differ from run to run.
DIGEST = re.compile(r"\b[0-9a-f]{64}\b")
VOLATILE = ("seconds", "provenance", "folder", "files", "made_of")


@dataclass(frozen=True)
class Command:
    """A command line; CASE, RESULT and OUT are replaced.

    Parameters
    ----------
    arguments : str
        The words.
    cheap : bool
        Whether it takes two or three seconds.
    bit_by_bit : bool
        Whether finished work stays in OUT, so that its tables tell what is whole.
    """

    arguments: str
    cheap: bool = False
    bit_by_bit: bool = False

    @property
    def name(self) -> str:
        """The first word, and the format of an export."""
        words = self.arguments.split()
        return " ".join(word for word in words[:4] if word[0] != "-" and word.islower())


COMMANDS = (
    Command("example OUT/example"),
    Command(
        "init CASE/identify.csv -o OUT/init --piston 32 --rod 12 --stroke 200 --supply 6",
        cheap=True,
    ),
    Command("check CASE --json OUT/check.json", cheap=True),
    Command("export -f c RESULT -o OUT/export"),
    Command("export -f fmu RESULT -o OUT/export"),
    Command("export -f ss RESULT -o OUT/export"),
    Command("export -f casadi RESULT -o OUT/export"),
    Command("export -f json RESULT -o OUT/export", cheap=True),
    Command("simulate CASE -p RESULT -o OUT/simulation"),
    Command("validate CASE -p RESULT -o OUT/validation --json OUT/validation.json"),
    Command("simulate --bench -o OUT/bench --duration 2 --effect stribeck"),
    Command("compare RESULT RESULT -o OUT/comparison"),
    Command("identify CASE -o OUT/report --json OUT/result.json"),
    Command("diagnose CASE -o OUT/diagnosis --workers 2 --no-refine WITHOUT"),
    Command("design CASE -o OUT/design --tries 20 --duration 2"),
    Command("demo -o OUT/demo"),
    Command("diagnose-many MANY -o OUT --workers 2", bit_by_bit=True),
    Command(
        "withheld -o OUT --cases 3 --seed 5 --workers 2 --duration 0.5",
        bit_by_bit=True,
    ),
)
#: Effects that the diagnosis is given: fits of all would take minutes each time.
KEPT = ("stribeck", "quadratic_drag")


@dataclass
class Bases:
    """What the commands work on."""

    folder: Path

    def make(self) -> None:
        """Write a case, its result, and a folder of cases too short to be diagnosed."""
        self.folder.mkdir()
        make_bases(self.folder)
        for name in ("one", "two", "three"):
            case = self.folder / "many" / name
            shutil.copytree(self.folder / Subject.CASE.value, case)
            for record in case.glob("*.csv"):
                if record.stem in ("identify", "validate"):
                    lines = record.read_text("utf-8").splitlines()[:300]
                    record.write_text("\n".join(lines) + "\n", "utf-8")

    def words(self, command: Command, out: Path) -> list[str]:
        """Return the words of a command."""
        from pneumo_casadi.effects import EFFECTS

        given = {
            "CASE": str(self.folder / Subject.CASE.value),
            "RESULT": str(self.folder / Subject.RESULT.value / "result.json"),
            "MANY": str(self.folder / "many"),
            "WITHOUT": " ".join(f"--without {name}" for name in EFFECTS if name not in KEPT),
        }
        text = command.arguments
        for name, value in given.items():
            text = text.replace(name, value)
        return text.replace("OUT", str(out)).split()


@dataclass
class Run:
    """A folder in which a command runs: its output, its cache and its temporary files."""

    folder: Path
    cache: Path

    def start(self, words: Sequence[str]) -> "subprocess.Popen[bytes]":
        """Start the command."""
        for path in (self.folder / "tmp", self.cache):
            path.mkdir(parents=True, exist_ok=True, mode=0o700)
        with (self.folder / "log.txt").open("wb") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "pneumo_casadi", *words],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env=os.environ | self.variables,
            )

    def fork(self, words: Sequence[str]) -> int:
        """Run the command to its end in a fork of this process; return its exit code."""
        code = (
            "import sys\nfrom pneumo_casadi.__main__ import main\n"
            f"sys.argv[1:] = {list(words)!r}\nmain()"
        )
        done = run_forked(code, self.folder, self.variables)
        return -signal.SIGKILL if done is None else done[0]

    @property
    def variables(self) -> dict[str, str]:
        """What the environment of its processes has besides."""
        return {
            MARK: str(self.folder),
            "TMPDIR": str(self.folder / "tmp"),
            "PNEUMO_CASADI_CACHE": str(self.cache),
        }

    @property
    def out(self) -> Path:
        """Where the output goes."""
        return self.folder / "out"

    def processes(self) -> list[int]:
        """Return the processes that belong to this run."""
        marked = f"{MARK}={self.folder}\0".encode()
        alive = []
        for path in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                dead = (path / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
                if not dead and marked in (path / "environ").read_bytes():
                    alive.append(int(path.name))
        return alive

    def drafts(self) -> list[Path]:
        """Return what is no output, and should be gone."""
        temporary = list((self.folder / "tmp").iterdir())
        known = ("matplotlib-",)  # a folder that matplotlib makes where HOME cannot be written
        return [
            path
            for path in (*temporary, *self.out.rglob("*"), *self.cache.rglob("*"))
            if (path in temporary or ".pneumo_casadi-" in path.name or ".tmp." in path.name)
            and not path.name.startswith(known)
        ]

    def files(self) -> set[str]:
        """Return the names of all files of the output."""
        return {
            str(path.relative_to(self.out))
            for path in self.out.rglob("*")
            if path.is_file() and ".pneumo_casadi-" not in str(path.relative_to(self.out))
        }

    def results(self) -> dict[str, Any]:
        """Return what the JSON and CSV files of the output hold, but times, paths and digests."""
        contents: dict[str, Any] = {}
        for name in sorted(self.files()):
            path = self.out / name
            if path.suffix == ".json" and path.name[0] != ".":
                text = path.read_text("utf-8").replace(str(self.folder), "RUN")
                contents[name] = _stable(json.loads(text))
            elif path.suffix == ".csv" and path.name != "cases.csv":  # holds seconds
                contents[name] = path.read_bytes()
        return contents


def _stable(value: Any) -> Any:
    """Return a result without times and digests of what holds them, numbers to nine digits."""
    if isinstance(value, dict):
        return {key: _stable(item) for key, item in value.items() if key not in VOLATILE}
    if isinstance(value, list):
        return [_stable(item) for item in value]
    if isinstance(value, str):
        return DIGEST.sub("digest", value)
    return float(f"{value:.9g}") if isinstance(value, float) else value


@dataclass
class Reference:
    """What a command does when nothing disturbs it."""

    code: int
    seconds: float
    files: set[str]
    results: dict[str, Any]


def undisturbed(run: Run, words: Sequence[str]) -> Reference:
    """Run a command to its end."""
    began = time.monotonic()
    code = run.start(words).wait(LONGEST)
    if code not in (0, 1) or "Traceback" in (run.folder / "log.txt").read_text("utf-8", "replace"):
        raise RuntimeError(f"{words}: {(run.folder / 'log.txt').read_text()[-2000:]}")
    return Reference(code, time.monotonic() - began, run.files(), run.results())


def is_half(run: Run, command: Command, reference: Reference) -> bool:
    """Return whether an output is neither whole nor absent."""
    files = run.files()
    try:
        run.results()
    except ValueError:
        return True
    if command.bit_by_bit:
        return "cases.csv" in files and not reference.files <= files
    tops = {name.split("/")[0] for name in files}
    return not files >= {name for name in reference.files if name.split("/")[0] in tops}


def kill(run: Run, words: Sequence[str], number: int, after: float) -> tuple[float, list[int]]:
    """End a command; return how long that took, and what processes are left."""
    process = run.start(words)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(after)
    began = time.monotonic()
    process.send_signal(number)
    process.wait(60)
    seconds = time.monotonic() - began
    while (left := run.processes()) and time.monotonic() - began < seconds + GONE:
        time.sleep(0.1)
    for pid in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return seconds, left


def kills(number: int, seed: int, only: str = "", cheap: bool = False) -> dict[str, Any]:
    """End commands at random times.

    Parameters
    ----------
    number : int
        How often.
    seed : int
        Of commands, signals and times.
    only : str, optional
        Part of the names of the commands.
    cheap : bool, optional
        Whether to leave out the commands that take longer than two or three seconds, and to fork
        where nothing is ended.
    """
    rng = random.Random(seed)
    chosen = [c for c in COMMANDS if only in c.name and (c.cheap or not cheap)]
    counted: Counter[str] = Counter()
    seconds: dict[str, list[float]] = defaultdict(list)
    examples: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as name:
        bases, cache = Bases(Path(name) / "bases"), Path(name) / "cache"
        bases.make()
        references: dict[Command, Reference] = {}
        order: list[Command] = []
        for k in range(number):
            order = order or rng.sample(chosen, len(chosen))
            command, ending = order.pop(), SIGNALS[k % len(SIGNALS)]
            share, fresh = rng.uniform(0.02, 1.0), rng.randrange(FRESH) == 0
            if command not in references:
                undisturbed_run = Run(Path(name) / f"reference{k}", cache)
                words = bases.words(command, undisturbed_run.out)
                references[command] = undisturbed(undisturbed_run, words)
                shutil.rmtree(undisturbed_run.folder)
            reference = references[command]
            folder = Path(name) / f"kill{k}"
            run = Run(folder, folder / "cache" if fresh and not cheap else cache)
            words = bases.words(command, run.out)
            took, left = kill(run, words, ending, share * reference.seconds)
            if ending == signal.SIGINT:
                seconds[command.name].append(took)
            faults = {"half": is_half(run, command, reference), "left_processes": bool(left)}
            again = run.fork(words) if cheap else run.start(words).wait(LONGEST)
            if again == 2 and not faults["half"]:  # refused: the new folder is there by now
                again = reference.code
            same = again == reference.code and run.results() == reference.results
            faults |= {"different": not same, "left_drafts": bool(run.drafts())}
            for fault in (fault for fault, holds in faults.items() if holds):
                counted[fault] += 1
                results = run.results()
                names = results.keys() | reference.results.keys()
                other = [n for n in sorted(names) if results.get(n) != reference.results.get(n)]
                text = f"{ending.name} after {share:.0%}: {left} {run.drafts()} {other}"
                examples.setdefault(f"{fault}: {command.name}", text)
            shutil.rmtree(folder, ignore_errors=True)
    interrupts = [value for values in seconds.values() for value in values]
    return {
        "kills": number,
        **{f: counted[f] for f in ("half", "left_processes", "left_drafts", "different")},
        "interrupt_s_p95": float(np.quantile(interrupts, 0.95)) if interrupts else None,
        "slowest": {name: max(values) for name, values in sorted(seconds.items())},
        "commands": {command.name: references[command].seconds for command in references},
        "examples": examples,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run it and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--only", default="", help="part of the names of the commands")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="cheap commands, one cache")
    options = parser.parse_args(arguments)
    for number in (signal.SIGINT, signal.SIGHUP):
        # A shell that starts this in the background has them ignored, by the commands as well.
        signal.signal(number, signal.default_int_handler)
    figures = kills(options.kills, options.seed, options.only, options.quick)
    provenance.write(options.json, {**provenance.made(options.seed, options.quick), **figures})
    for name in ("kills", "half", "left_processes", "left_drafts", "different", "interrupt_s_p95"):
        print(f"{name:16} {figures[name]}")
    for name, example in figures["examples"].items():
        print(f"{name}: {example}")


if __name__ == "__main__":
    main()
