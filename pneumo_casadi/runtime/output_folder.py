"""Output folders: only what an earlier output of the same kind wrote is replaced.

A manifest in the folder lists the files of each kind with their hashes. What users have added, or
changed, is theirs: added files stay, and a changed one stops the command before its work.
"""

import os
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path

from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.atomic_files import atomic_folder, draft_folder
from pneumo_casadi.runtime.json_files import write_json
from pneumo_casadi.runtime.json_input import read_json
from pneumo_casadi.runtime.provenance import sha256

#: The list of files that the package wrote into a folder.
MANIFEST = ".pneumo_casadi.json"
_REMEDY = "choose another folder, or move it away"

#: Hashes by file of a kind; None for names that are a kind's own whatever they hold.
Owned = dict[str, str | None]


class OutputKind(StrEnum):
    """Kinds of output."""

    IDENTIFICATION = "identification"
    VALIDATION = "validation"
    SIMULATION = "simulation"
    DIAGNOSIS = "diagnosis"
    COMPARISON = "comparison"
    DESIGN = "design"
    EXPORT = "export"
    CASES = "diagnoses of cases"
    SEALED_CHECK = "sealed check"


def check_replaceable(folder: str | Path, kind: OutputKind) -> None:
    """Check that a folder can be written, and loses nothing of the user's.

    Raises
    ------
    CaseError
        If it holds files and no earlier output of this kind, or one of that output was changed.
    OSError
        If it cannot be written.
    """
    folder = Path(folder)
    owned = _manifest(folder)
    if kind not in owned and folder.is_dir() and any(folder.iterdir()):
        first = sorted(path.name for path in folder.iterdir())[0]
        raise CaseError(f"{folder}: holds {first} and no earlier {kind}; {_REMEDY}")
    _check_unchanged(folder, owned.get(kind, {}))
    _check_writable(folder.parent)


@contextmanager
def output_folder(folder: str | Path, kind: OutputKind) -> Iterator[Path]:
    """Yield a draft folder that takes the place of an earlier output when all is well.

    After an error the draft is gone and `folder` is as it was. What else lies in the folder is
    kept.

    Raises
    ------
    CaseError
        As `check_replaceable`, and if a file of the draft would replace one of the user's.
    """
    folder = Path(folder)
    check_replaceable(folder, kind)
    with atomic_folder(folder) as draft:
        yield draft
        owned = _manifest(folder)
        written: Owned = {
            name: sha256(draft / name) for name in _files(draft) if (draft / name).is_file()
        }
        before = owned.get(kind, {})
        _check_unchanged(folder, before)
        _check_absent(folder, [name for name in written if name not in before])
        for name in _files(folder):
            if name not in before and name != MANIFEST:
                _link(folder / name, draft / name)
        write_json(_content(owned | {kind: written}), draft / MANIFEST)


def check_writable_files(folder: str | Path, kind: OutputKind, names: Collection[str]) -> None:
    """Check that files of a kind can be written into a folder among whatever lies there.

    Raises
    ------
    CaseError
        If the folder is a file, or one of the names is a file of the user's.
    OSError
        If it cannot be written.
    """
    folder = Path(folder)
    owned = _manifest(folder).get(kind, {})
    _check_unchanged(folder, {name: owned[name] for name in names if name in owned})
    _check_absent(folder, [name for name in names if name not in owned])
    _check_writable(folder if folder.is_dir() else folder.parent)


def write_files(
    files: Mapping[str, str | bytes], folder: str | Path, kind: OutputKind = OutputKind.EXPORT
) -> tuple[Path, ...]:
    """Write files into a folder once all of them are complete; other files stay.

    Parameters
    ----------
    files : mapping of str to (str or bytes)
        Content by name, text as UTF-8.
    folder : path
        Made where it is missing.
    kind : OutputKind, optional
        Files of the same names are replaced where an earlier output of this kind wrote them.

    Raises
    ------
    CaseError
        As `check_writable_files`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in write_files({"a.txt": "one"}, folder)]
    ['a.txt']
    """
    folder = Path(folder)
    check_writable_files(folder, kind, files)
    owned = _manifest(folder)
    there = folder.is_dir()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with draft_folder(folder if there else folder.parent, folder.name) as scratch:
        draft = scratch / "files"
        draft.mkdir()
        for name, content in files.items():
            (draft / name).write_bytes(content.encode() if isinstance(content, str) else content)
        written = {name: sha256(draft / name) for name in files}
        write_json(_content(owned | {kind: owned.get(kind, {}) | written}), draft / MANIFEST)
        if not there:
            draft.replace(folder)
        else:  # the manifest last: it holds the hashes of what is there
            for name in (*files, MANIFEST):
                (draft / name).replace(folder / name)
    return tuple(folder / name for name in files)


def claim_names(folder: str | Path, kind: OutputKind, names: Collection[str]) -> None:
    """Make a folder whose `names` are written again and again, as finished work is kept.

    Raises
    ------
    CaseError
        If one of the names is there and no earlier output of this kind.
    """
    folder = Path(folder)
    owned = _manifest(folder)
    _check_absent(folder, [name for name in names if name not in owned.get(kind, {})])
    _check_writable(folder if folder.is_dir() else folder.parent)
    claimed: Owned = dict.fromkeys(names)
    if owned.get(kind) != claimed:
        write_json(_content(owned | {kind: claimed}), folder / MANIFEST)


def check_result_file(path: str | Path | None, key: str) -> None:
    """Check that a JSON file can be written; one that is there must be an earlier result.

    Parameters
    ----------
    path : path or None
        None where no file is wanted.
    key : str
        An entry that results of this command have.

    Raises
    ------
    CaseError
        If something else is there.
    OSError
        If it cannot be written.
    """
    if path is None:
        return
    path = Path(path)
    if path.exists() or path.is_symlink():
        with suppress(CaseError):
            if key in read_json(path, ""):
                _check_writable(path.parent)
                return
        raise CaseError(
            f"{path}: is there and no earlier result of this command; choose another file, or move "
            "it away"
        )
    _check_writable(path.parent)


def check_new(folder: str | Path) -> None:
    """Check that a folder is not there, or empty, and can be written.

    Raises
    ------
    CaseError
        If it holds something or cannot be written.
    """
    folder = Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise CaseError(f"{folder}: is there already and not empty; choose a new folder")
    _check_writable(folder.parent)


def _manifest(folder: Path) -> dict[str, Owned]:
    """Return what the package wrote into a folder, by kind."""
    if (folder.exists() or folder.is_symlink()) and not folder.is_dir():
        raise CaseError(f"{folder}: is a file; name a folder for the output")
    path = folder / MANIFEST
    if not path.exists():
        return {}
    content = read_json(path, _REMEDY).get("outputs")
    if not isinstance(content, dict) or not all(isinstance(x, dict) for x in content.values()):
        raise CaseError(f"{path}: `outputs` is no list of files by kind; {_REMEDY}")
    return content


def _content(owned: Mapping[str, Owned]) -> dict[str, Mapping[str, Owned]]:
    return {"outputs": {str(kind): files for kind, files in owned.items()}}


def _check_unchanged(folder: Path, owned: Owned) -> None:
    for name, written in owned.items():
        path = folder / name
        if written is None or not path.exists():
            continue
        if not path.is_file() or sha256(path) != written:
            raise CaseError(
                f"{path}: was changed since it was written and would be lost; rename it, or choose "
                "another folder"
            )


def _check_absent(folder: Path, names: Collection[str]) -> None:
    for name in names:
        path = folder / name
        if path.exists() or path.is_symlink():
            raise CaseError(f"{path}: is no earlier output and would be lost; {_REMEDY}")


def _check_writable(folder: Path) -> None:
    """Check that a folder, or the one in which it would be made, can be written."""
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise CaseError(f"{folder}: is a file; name a folder for the output")
    try:
        with draft_folder(folder) as draft:
            (draft / "file").write_bytes(b"")
    except OSError as error:
        raise CaseError(
            f"{folder}: cannot be written ({error.strerror}); choose another folder"
        ) from error


def _files(folder: Path) -> list[str]:
    """Return what lies in a folder, by path within it: files, links and empty folders."""
    names = []
    for path, folders, files in os.walk(folder):
        links = [name for name in folders if (Path(path) / name).is_symlink()]
        names += [str((Path(path) / name).relative_to(folder)) for name in (*files, *links)]
        if not folders and not files and Path(path) != folder:
            names.append(str(Path(path).relative_to(folder)))
    return sorted(names)


def _link(source: Path, target: Path) -> None:
    """Give a file a second name; copy it where the file system has no such thing."""
    if source.is_dir() and not source.is_symlink():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)
