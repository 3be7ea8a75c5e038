"""Files of an export: all of them written, or none."""

import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from pneumo_casadi.errors import CaseError


def write_files(files: Mapping[str, str | bytes], folder: str | Path) -> tuple[Path, ...]:
    """Write files into a folder once all of them are complete.

    Parameters
    ----------
    files : mapping of str to (str or bytes)
        Content by name, text as UTF-8.
    folder : path
        Made where it is missing; files of the same names are replaced, others left alone.

    Raises
    ------
    CaseError
        If `folder` is a file.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in write_files({"a.txt": "one"}, folder)]
    ['a.txt']
    """
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise CaseError(f"{folder}: is a file; name a folder for the export")
    folder.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=".export.", dir=folder))
    try:
        for name, content in files.items():
            data = content.encode("utf-8") if isinstance(content, str) else content
            (draft / name).write_bytes(data)
        return tuple((draft / name).replace(folder / name) for name in files)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
