"""Damage to `result.json` beyond that to any JSON file, and to the folder of a case."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import scipy.io

from damage.kind import Damage, Due, Kind, Subject

RESULT = "result.json"


def of_result(change: Callable[[dict[str, Any], Random], Any]) -> Damage:
    """Return the damage that changes a result."""

    def damage(folder: Path, rng: Random) -> None:
        content = json.loads((folder / RESULT).read_text("utf-8"))
        change(content, rng)
        (folder / RESULT).write_text(json.dumps(content))

    return damage


def parameter(content: dict[str, Any], rng: Random) -> dict[str, Any]:
    """Return a parameter of the model at random."""
    return content["model"]["parameters"][rng.choice(sorted(content["model"]["parameters"]))]


def results() -> Iterator[Kind]:
    """Yield the kinds of damage to a result."""
    refuse = {
        "a later format": of_result(lambda c, r: c.update(format=r.choice((2, 99)))),
        "no format": of_result(lambda c, r: c.pop("format")),
        "a format that is none": of_result(lambda c, r: c.update(format=r.choice(("1", None, -3)))),
        "scale 0": of_result(lambda c, r: parameter(c, r).update(scale=r.choice((0, -1.0)))),
        "another unit": of_result(lambda c, r: parameter(c, r).update(unit=r.choice(("lb", "")))),
        "numbers as text": of_result(
            lambda c, r: (p := parameter(c, r)).update(value=str(p["value"]))
        ),
        "a value beyond its bounds": of_result(
            lambda c, r: c["model"]["parameters"]["M"].update(value=-1.0)
        ),
        "bounds crossed": of_result(lambda c, r: parameter(c, r).update(lower=1e9, upper=-1e9)),
        "areas a hundredfold": of_result(
            lambda c, r: [
                c["model"]["bench"].update({k: 100 * c["model"]["bench"][k]}) for k in AREAS
            ]
        ),
        "a parameter missing": of_result(
            lambda c, r: c["model"]["parameters"].pop(r.choice(sorted(c["model"]["parameters"])))
        ),
        "a strange parameter": of_result(
            lambda c, r: c["model"]["parameters"].update(zz=c["model"]["parameters"]["M"])
        ),
        "a strange effect": of_result(lambda c, r: c["model"]["effects"].append("os.system")),
        "degrees negative": of_result(lambda c, r: c["model"]["flow"].update(degrees=[-1, 7, 4])),
        "degrees huge": of_result(lambda c, r: c["model"]["flow"].update(degrees=[10**9, 7, 4])),
        "a covariance of another size": of_result(
            lambda c, r: c["model"]["flow"]["covariance"].pop()
        ),
        "a strange form": of_result(lambda c, r: c["model"]["flow"].update(form="__import__")),
        "no flow": of_result(lambda c, r: c["model"].update(flow=None)),
        "no model": of_result(lambda c, r: c.update(model=None)),
        "no estimates": of_result(lambda c, r: c.pop("output_error")),
        "sampling of nothing": of_result(
            lambda c, r: c["model"]["bench"].update(sampling_frequency_Hz=r.choice((0, -5, 1e30)))
        ),
    }
    valid = {
        "another name": of_result(lambda c, r: c.update(case="Achse 2 (µ)")),
        "a comment": of_result(lambda c, r: c.update(comment="checked")),
        "no folder": of_result(lambda c, r: c.pop("folder")),
    }
    for due, group in ((Due.REFUSE, refuse), (Due.ACCEPT, valid)):
        for what, damage in group.items():
            yield Kind(f"{RESULT}: {what}", due, damage, RESULT, Subject.RESULT)


AREAS = ("S_P_m2", "S_N_m2")


def folders() -> Iterator[Kind]:
    """Yield what may be wrong with a folder."""

    def strange(name: bytes) -> Damage:
        def damage(folder: Path, rng: Random) -> None:
            (folder / "identify.csv").rename(folder / os.fsdecode(name))

        return damage

    refuse: dict[str, Damage] = {
        "no bench": lambda f, r: (f / "bench.json").unlink(),
        "no record": lambda f, r: (f / "identify.csv").unlink(),
        "records in a folder": lambda f, r: [
            (f / "data").mkdir(),
            (f / "identify.csv").rename(f / "data" / "identify.csv"),
        ],
    }
    valid: dict[str, Damage] = {
        "notes": lambda f, r: (f / "notes.txt").write_bytes(r.randbytes(500)),
        "hidden files": lambda f, r: (f / ".DS_Store").write_bytes(r.randbytes(500)),
        "a folder beside": lambda f, r: (f / "figures").mkdir(),
        "nothing held out": lambda f, r: (f / "validate.csv").unlink(),
        "a name that is no UTF-8": strange(b"identify_\xff\xfe.csv"),
        "a name with a line end": strange(b"identify_\n\x1b[2J.csv"),
        "capitals": lambda f, r: None,
    }
    for due, group in ((Due.REFUSE, refuse), (Due.ACCEPT, valid)):
        for what, damage in group.items():
            yield Kind(f"folder: {what}", due, damage, "")


def emps() -> Iterator[Kind]:
    """Yield the kinds of damage to the files of EMPS."""

    def changed(change: Callable[[dict[str, Any], Random], Any]) -> Damage:
        def damage(folder: Path, rng: Random) -> None:
            path = folder / "DATA_EMPS.mat"
            content = {k: v for k, v in scipy.io.loadmat(path).items() if not k.startswith("__")}
            change(content, rng)
            scipy.io.savemat(path, content)

        return damage

    def flip(folder: Path, rng: Random) -> None:
        path = folder / "DATA_EMPS.mat"
        content = bytearray(path.read_bytes())
        content[rng.randrange(200)] = rng.randrange(256)
        path.write_bytes(bytes(content))

    groups: dict[Due, dict[str, Damage]] = {
        Due.REFUSE: {
            "a constant missing": changed(lambda c, r: c.pop(r.choice(("kp", "kv", "gtau")))),
            "a signal missing": changed(lambda c, r: c.pop(r.choice(("qm", "t", "vir")))),
            "a signal shorter": changed(lambda c, r: c.update(qm=c["qm"][:-5])),
            "NaN": changed(lambda c, r: c.update(qm=np.full_like(c["qm"], np.nan))),
            "other gains": changed(lambda c, r: c.update(kp=c["kp"] * 2)),
            "cut short": lambda f, r: (f / "DATA_EMPS.mat").write_bytes(
                (f / "DATA_EMPS.mat").read_bytes()[:3000]
            ),
            "the other file gone": lambda f, r: (f / "DATA_EMPS_PULSES.mat").unlink(),
        },
        Due.ANY: {"a byte changed": flip},
        Due.ACCEPT: {"another variable": changed(lambda c, r: c.update(note=np.ones(3)))},
    }
    for due, group in groups.items():
        for what, damage in group.items():
            yield Kind(f"EMPS: {what}", due, damage, "DATA_EMPS", Subject.EMPS)
