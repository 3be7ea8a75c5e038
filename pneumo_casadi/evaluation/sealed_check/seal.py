"""Labels under seal: a hash is published first, and nothing is opened before all is answered.

``seal.json`` holds the SHA-256 of the labels with a secret salt; salt and labels lie in
``labels.sealed``. Whoever has the hash can tell later that no label was changed, and cannot guess
labels from it. When the labels are opened, the hashes of all verdicts are written down
(``opened.json``): from then on no verdict may change, vanish or be added.
"""

import hashlib
import json
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check.draw import Draw, Kind
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.json_input import Section, read_json, typed

#: What to do where a file of the check is missing.
ABSENT = "run it again, or draw anew"
SEAL, LABELS, OPENED, VERDICTS = "seal.json", "labels.sealed", "opened.json", "verdicts"


class _Label(Section):
    name: str
    kind: Kind
    seed: int
    effects: dict[str, str]
    forms: dict[str, str] = msgspec.field(default_factory=dict)
    background: list[str] = msgspec.field(default_factory=list)

    @property
    def draw(self) -> Draw:
        return Draw(
            self.name, self.kind, self.seed, self.effects, self.forms, tuple(self.background)
        )


class _Labels(Section):
    draws: list[_Label]


class _Verdict(Section):
    sha256: str
    case: str
    verdict: dict[str, Any]


def canonical(content: Any) -> bytes:
    """Return JSON of which there is one form only.

    Examples
    --------
    >>> canonical({"b": 1, "a": [0.5]})
    b'{"a":[0.5],"b":1}'
    """
    text = json.dumps(
        content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )
    return text.encode()


def digest(content: Any, salt: str = "") -> str:
    """Return the SHA-256 of a salt and some content."""
    return hashlib.sha256(salt.encode() + canonical(content)).hexdigest()


def seal(folder: Path, draws: Sequence[Draw], duration: float, fs: float) -> None:
    """Write the seal, and the labels beside it: before any case is diagnosed.

    A folder that is sealed already is left alone if it holds the very same draw.

    Raises
    ------
    CaseError
        If the folder holds another draw, or verdicts without a seal.
    """
    labels = _labels(draws, duration, fs)
    if (folder / SEAL).is_file():
        kept = read_json(folder / LABELS, ABSENT)
        if digest(labels, str(kept.get("salt"))) != read_json(folder / SEAL, ABSENT).get("sha256"):
            raise CaseError(
                f"{folder}: holds cases of another seed, number or length; choose another folder, "
                "or ask for the same draw to go on with it"
            )
        return
    if any((folder / VERDICTS).glob("*.json")):
        raise CaseError(f"{folder}: verdicts without {SEAL}; choose a new folder")
    salt = secrets.token_hex(32)
    write_json({"salt": salt, "labels": labels}, folder / LABELS)
    sealed = {"algorithm": "SHA-256 of salt and canonical JSON", "sha256": digest(labels, salt)}
    write_json(sealed | {"cases": len(draws)}, folder / SEAL)


def _labels(draws: Sequence[Draw], duration: float, fs: float) -> dict[str, Any]:
    return {"duration_s": duration, "fs_Hz": fs, "draws": [draw.as_dict() for draw in draws]}


def verdict_path(folder: Path, name: str) -> Path:
    """Return where the verdict on a case lies."""
    return folder / VERDICTS / f"{name}.json"


def write_verdict(folder: Path, name: str, verdict: Mapping[str, Any]) -> None:
    """Write a verdict with its hash, whole or not at all."""
    content = {"case": name, "verdict": dict(verdict)}
    write_json({"sha256": digest(content), **content}, verdict_path(folder, name))


def read_verdict(folder: Path, name: str) -> dict[str, Any]:
    """Return a verdict.

    Raises
    ------
    CaseError
        If it is missing, or not as it was written.
    """
    path = verdict_path(folder, name)
    content = read_json(path, ABSENT)
    try:
        stored = typed(content, _Verdict)
    except CaseError as error:
        raise CaseError(f"{path}: {error}; delete it and diagnose again") from None
    made_of = {"case": stored.case, "verdict": stored.verdict}
    if stored.case != name or stored.sha256 != digest(made_of):
        raise CaseError(f"{path}: not as the diagnosis wrote it; delete it and diagnose again")
    return stored.verdict


def opened(folder: Path) -> tuple[tuple[Draw, ...], dict[str, dict[str, Any]]]:
    """Open the labels once every verdict is there, and return both.

    Raises
    ------
    CaseError
        If a verdict is missing, or labels or verdicts are not those that were sealed.
    """
    published = read_json(folder / SEAL, ABSENT)
    names = sorted(path.stem for path in (folder / VERDICTS).glob("*.json"))
    if len(names) != published.get("cases"):
        raise CaseError(
            f"{folder}: {len(names)} verdicts on {published.get('cases')} cases; the labels stay "
            "closed until all are there: run it again"
        )
    verdicts = {name: read_verdict(folder, name) for name in names}
    hashes = {name: digest(verdict) for name, verdict in verdicts.items()}
    before = folder / OPENED
    if not before.is_file():
        write_json({"verdicts": hashes}, before)
    elif read_json(before, ABSENT).get("verdicts") != hashes:
        raise CaseError(
            f"{folder}: verdicts have changed since the labels were opened ({OPENED}); draw anew"
        )
    kept = read_json(folder / LABELS, ABSENT)
    if digest(kept.get("labels"), str(kept.get("salt"))) != published.get("sha256"):
        raise CaseError(f"{folder / LABELS}: not the labels that {SEAL} was made of; draw anew")
    try:
        labels = typed(kept["labels"], _Labels, "labels")
        draws = tuple(label.draw for label in labels.draws)
    except CaseError as error:
        raise CaseError(f"{folder / LABELS}: {error}; draw anew") from None
    if sorted(draw.name for draw in draws) != names:
        raise CaseError(f"{folder / VERDICTS}: verdicts on other cases than those drawn")
    return draws, verdicts


def is_open(folder: Path) -> bool:
    """Return whether the labels were opened: no verdict may be given any more."""
    return (folder / OPENED).is_file()
