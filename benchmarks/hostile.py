"""Question: does a file that is only read do anything but be read.

Data: files that try to run code, to escape a folder, to exhaust memory or time, or to inject
markup, formulas or commands of a terminal (`hostility/`). Each is put beside a sound case, result
and export, and read in a process with limits of time and memory; with `--quick` most are read in
forks of this one. `succeeded` counts those that ran code, ended the process, exhausted it, or left
their mark in an output; `won` says how.
"""

import argparse
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import provenance
from damage.base import make_bases
from damage.kind import Subject
from hostility import execution, exhaustion, injection
from hostility.attack import Attack, succeeds

from pneumo_casadi.export import read_model, write_functions


def attacks() -> Iterator[Attack]:
    """Yield all attacks."""
    yield from execution.attacks()
    yield from exhaustion.attacks()
    yield from injection.attacks()


def make_base(folder: Path) -> Path:
    """Write a folder with a sound case, its result and its exported functions, and return it."""
    bases = folder / "bases"
    bases.mkdir()
    make_bases(bases)
    base = bases / Subject.CASE.value
    shutil.copy(bases / Subject.RESULT.value / "result.json", base)
    write_functions(read_model(base / "result.json"), base)
    return base


def attack_all(only: str = "", forked: bool = False) -> dict[str, Any]:
    """Carry all attacks out, those whose name holds a text.

    Parameters
    ----------
    only : str, optional
        The text.
    forked : bool, optional
        Whether to read in forks of this process what needs no interpreter of its own.

    Returns
    -------
    dict
        ``files``, ``succeeded``, and how by name.
    """
    chosen = [attack for attack in attacks() if only in attack.name]
    won = {}
    with tempfile.TemporaryDirectory() as name:
        base = make_base(Path(name))
        for k, attack in enumerate(chosen):
            folder = Path(name) / f"attack{k}"
            shutil.copytree(base, folder)
            how = succeeds(attack, folder, forked)
            shutil.rmtree(folder, ignore_errors=True)
            shutil.rmtree(Path(name) / "cache", ignore_errors=True)
            print(f"{attack.name}: {how or 'nothing'}", flush=True)
            if how:
                won[attack.name] = how
    files = sum(attack.files for attack in chosen)
    return {"files": files, "succeeded": len(won), "won": won}


def main(arguments: Sequence[str] | None = None) -> None:
    """Carry the attacks out and print what succeeded."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="part of the names of the attacks")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help="in forks of one process")
    options = parser.parse_args(arguments)
    figures = attack_all(options.only, options.quick)
    provenance.write(options.json, {**provenance.made(None, options.quick, "msgspec"), **figures})
    print(f"files {figures['files']}, succeeded {figures['succeeded']}")


if __name__ == "__main__":
    main()
