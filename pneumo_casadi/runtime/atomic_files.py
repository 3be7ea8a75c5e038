"""Files and folders that are there whole, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as scratch:
        draft = Path(scratch) / path.name
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
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        yield draft
        draft.chmod(0o755)  # mkdtemp makes folders that only the owner may enter
        if over:
            _replace(draft, folder)
        else:
            if folder.exists():
                folder.rmdir()
            draft.replace(folder)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise


def _replace(draft: Path, folder: Path) -> None:
    if not folder.exists():
        draft.replace(folder)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{folder.name}.old.", dir=folder.parent))
    folder.replace(old)
    try:
        draft.replace(folder)
    except BaseException:
        old.replace(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
