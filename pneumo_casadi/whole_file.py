"""Files that are there whole, or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Lend a draft beside `path` that takes its place in one step when the block ends.

    Parameters
    ----------
    path : str or Path
        Where the file shall be; its folder is made. What stands there stays until the draft is
        whole, and for good where the block fails.

    Yields
    ------
    Path
        The draft, of the same name in a folder of its own: to be written by whatever means.

    Examples
    --------
    >>> folder = Path(tempfile.mkdtemp())
    >>> with whole_file(folder / "answer.txt") as draft:
    ...     _ = draft.write_text("42")
    >>> (folder / "answer.txt").read_text(), len(list(folder.iterdir()))
    ('42', 1)
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as scratch:
        draft = Path(scratch) / path.name
        yield draft
        with draft.open("rb+") as file:  # on the disk before it has the name
            os.fsync(file.fileno())
        draft.replace(path)
