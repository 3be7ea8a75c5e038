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

from pneumo_casadi.errors import CaseError
from pneumo_casadi.evaluation.sealed_check.draw import Draw
from pneumo_casadi.runtime.json_files import write_json

SEAL, LABELS, OPENED, VERDICTS = "seal.json", "labels.sealed", "opened.json", "verdicts"


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
        kept = _read(folder / LABELS)
        if digest(labels, str(kept.get("salt"))) != _read(folder / SEAL).get("sha256"):
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
    stored = _read(path)
    content = {"case": stored.get("case"), "verdict": stored.get("verdict")}
    if content["case"] != name or stored.get("sha256") != digest(content):
        raise CaseError(f"{path}: not as the diagnosis wrote it; delete it and diagnose again")
    verdict: dict[str, Any] = stored["verdict"]
    return verdict


def opened(folder: Path) -> tuple[tuple[Draw, ...], dict[str, dict[str, Any]]]:
    """Open the labels once every verdict is there, and return both.

    Raises
    ------
    CaseError
        If a verdict is missing, or labels or verdicts are not those that were sealed.
    """
    published = _read(folder / SEAL)
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
    elif _read(before).get("verdicts") != hashes:
        raise CaseError(
            f"{folder}: verdicts have changed since the labels were opened ({OPENED}); draw anew"
        )
    kept = _read(folder / LABELS)
    if digest(kept.get("labels"), str(kept.get("salt"))) != published.get("sha256"):
        raise CaseError(f"{folder / LABELS}: not the labels that {SEAL} was made of; draw anew")
    draws = tuple(Draw.of(label) for label in kept["labels"]["draws"])
    if sorted(draw.name for draw in draws) != names:
        raise CaseError(f"{folder / VERDICTS}: verdicts on other cases than those drawn")
    return draws, verdicts


def is_open(folder: Path) -> bool:
    """Return whether the labels were opened: no verdict may be given any more."""
    return (folder / OPENED).is_file()


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise CaseError(f"{path}: no such file; run it again, or draw anew") from None
    except ValueError as error:
        raise CaseError(f"{path}: no JSON ({error}); it was changed or cut short") from None
    if not isinstance(content, dict):
        raise CaseError(f"{path}: expected a JSON object; it was changed")
    return content
