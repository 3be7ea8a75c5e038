"""Diagnoses that cost nothing, in a module that worker processes can import."""

import os
import signal
import time
import uuid
from pathlib import Path

from pneumo_casadi.errors import FitError


def verdict(folder):
    """Made from the case's data alone, so that it is the same wherever it is made."""
    size = float((folder / "bench.json").read_text())
    return {
        "verdict": "effect",
        "effects": [{"name": "hose", "probability": 0.9}, {"name": "stribeck", "probability": 0.7}],
        "ambiguous": [],
        "where": {"balance": "force"},
        "gap": {
            "before": size,
            "after": size / 10,
            "shrink": 0.9,
            "shrink_interval": [0.8, 0.95],
        },
        "seconds": 0.0,
    }


def marked(folder):
    """Leave a mark for each time that the case is diagnosed."""
    marks = folder.parent.parent / "marks"
    marks.mkdir(exist_ok=True)
    (marks / f"{folder.name}.{os.getpid()}.{uuid.uuid4().hex}").touch()
    return verdict(folder)


def broken(folder):
    """Fail in the ways that a case can."""
    if folder.name == "c1":
        raise FitError("no step was\nfound; record more motion")
    if folder.name == "c2":
        return verdict(folder) | {"notes": [float("nan")]}
    if folder.name == "c3":
        return {"verdict": "none"}
    return marked(folder)


def out_of_disk(folder):
    if folder.name == "c1" and not (folder.parent.parent / "mended").exists():
        raise OSError("disk full")
    return marked(folder)


def interrupted(folder):
    if folder.name == "c2" and not (folder.parent.parent / "mended").exists():
        raise KeyboardInterrupt
    return marked(folder)


def garbled(folder):
    """What becomes of Ctrl-C within a compiled function."""
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise NotImplementedError("wrong type of arguments") from None


def killed_once(folder):
    """In the middle of the fourth case its worker is killed, once."""
    time.sleep(0.02)
    killed = folder.parent.parent / "killed"
    if folder.name == "c4" and not killed.exists():
        killed.write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    return marked(folder)


def killed_always(folder):
    """The fourth case costs its worker each time."""
    if folder.name == "c4":
        os.kill(os.getpid(), signal.SIGKILL)
    return marked(folder)


def spring_load(folder: Path):
    """A real diagnosis with a catalogue of one."""
    from pneumo_casadi.diagnosis import diagnose  # a second that the other fakes do not wait for
    from pneumo_casadi.effects import EFFECTS

    return diagnose(folder, {"spring_load": EFFECTS["spring_load"]}).as_dict()
