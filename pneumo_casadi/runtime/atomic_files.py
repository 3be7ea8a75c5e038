"""Files and folders that are there whole, or not at all.

Each is written in a draft folder beside its place. A process that is killed leaves its drafts; the
next one that writes into the same folder removes them. A draft is locked while its process lives.
"""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from pneumo_casadi.runtime.interruption import at_hard_end

if sys.platform != "win32":  # there nothing tells a draft in work from a stale one, which stays
    from fcntl import LOCK_EX, LOCK_NB, flock

_PREFIX, _SUFFIX = ".", ".pneumo_casadi-"
_NAME = re.compile(rf"{re.escape(_PREFIX)}(?P<name>.+){re.escape(_SUFFIX)}\w{{8}}")
#: Within a draft: what is to take its place, and what it replaces.
_NEW, _REPLACED = "new", "replaced"


@contextmanager
def draft_folder(parent: str | Path | None = None, name: str = "draft") -> Iterator[Path]:
    """Yield a temporary folder that is removed at the end, by the next process if this one dies.

    Parameters
    ----------
    parent : path, optional
        Where it is made; by default in the folder of the system for temporary files.
    name : str, optional
        Of what is drafted.

    Yields
    ------
    Path
        The folder, for this user alone.

    Examples
    --------
    >>> with draft_folder() as folder:
    ...     folder.is_dir()
    True
    >>> folder.exists()
    False
    """
    parent = Path(parent or tempfile.gettempdir())
    _remove_stale(parent)
    folder, lock = _locked_folder(parent, name)
    try:
        with at_hard_end(partial(_discard, folder)):
            yield folder
    finally:
        _discard(folder)
        if lock is not None:
            os.close(lock)


@contextmanager
def atomic_file(path: str | Path) -> Iterator[Path]:
    """Yield a draft beside `path` that replaces it in one step when the block ends.

    Parameters
    ----------
    path : str or Path
        Path of the file; its folder is created. An existing file is kept until the draft is
        complete, and kept for good if the block fails.

    Yields
    ------
    Path
        The draft: a file of the same name in a temporary folder.

    Examples
    --------
    >>> folder = Path(tempfile.mkdtemp())
    >>> with atomic_file(folder / "answer.txt") as draft:
    ...     _ = draft.write_text("42")
    >>> (folder / "answer.txt").read_text(), len(list(folder.iterdir()))
    ('42', 1)
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with draft_folder(path.parent, path.name) as scratch:
        draft = scratch / path.name
        yield draft
        with draft.open("rb+") as file:  # on the disk before it is renamed
            os.fsync(file.fileno())
        draft.replace(path)


@contextmanager
def atomic_folder(folder: str | Path, over: bool = True) -> Iterator[Path]:
    """Yield a draft folder beside `folder` that replaces it when the block ends.

    Parameters
    ----------
    folder : str or Path
        Path of the folder; its parent is created. An existing folder is kept until the draft is
        complete, and kept for good if the block fails.
    over : bool
        Whether a folder that is not empty may be replaced.

    Yields
    ------
    Path
        The draft, empty.

    Raises
    ------
    OSError
        If the folder may not be replaced and, by the end of the block, holds something.

    Examples
    --------
    >>> place = Path(tempfile.mkdtemp()) / "answers"
    >>> with atomic_folder(place) as draft:
    ...     _ = (draft / "answer.txt").write_text("42")
    >>> [file.name for file in place.iterdir()], len(list(place.parent.iterdir()))
    (['answer.txt'], 1)
    """
    folder = Path(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with draft_folder(folder.parent, folder.name) as scratch:
        draft = scratch / _NEW
        draft.mkdir()
        yield draft
        if folder.exists():
            if over:
                folder.replace(scratch / _REPLACED)
            else:
                folder.rmdir()
        draft.replace(folder)


def _locked_folder(parent: Path, name: str) -> tuple[Path, int | None]:
    """Make a draft folder and lock it; another process may take it for stale in between."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{name}{_SUFFIX}", dir=parent))
        if sys.platform == "win32":
            return folder, None
        try:
            lock = os.open(folder, os.O_RDONLY)
        except FileNotFoundError:
            continue
        with suppress(OSError):  # a file system without locks: stale drafts stay there
            flock(lock, LOCK_EX)
        if folder.exists():
            return folder, lock
        os.close(lock)


def _remove_stale(parent: Path) -> None:
    """Remove the drafts of processes that are gone."""
    if sys.platform == "win32":
        return
    for folder in [path for path in parent.iterdir() if _NAME.fullmatch(path.name)]:
        with suppress(OSError):  # of another user, or gone by now, or in work
            lock = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY)
            try:
                flock(lock, LOCK_EX | LOCK_NB)
                if os.fstat(lock).st_uid == os.getuid():
                    _discard(folder)
            finally:
                os.close(lock)


def _discard(folder: Path) -> None:
    """Remove a draft; what it was about to replace goes back to its place."""
    named = _NAME.fullmatch(folder.name)
    assert named is not None
    replaced, target = folder / _REPLACED, folder.parent / named["name"]
    if replaced.exists() and not target.exists():
        replaced.replace(target)
    shutil.rmtree(folder, ignore_errors=True)
