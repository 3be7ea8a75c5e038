"""Files that others have written: regular files of limited size, read once, in a known encoding."""

import codecs
import os
import reprlib
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from unicodedata import category

from pneumo_casadi.errors import CaseError

#: Largest file that is read [bytes]: an hour of ten channels at 5 kHz as text is half of it.
LARGEST = 4 * 2**30
#: Byte order marks -> encoding, longer ones first.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
#: Values from a file in messages.
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
#: Categories of characters that are no text: control, invisible, broken, ends of lines.
_NO_TEXT = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def is_named(path: Path) -> bool:
    """Return whether a folder has an entry of this name, be it a file or something else.

    An optional file that is a folder or a link to nothing is an error, not an absent file.
    """
    return os.path.lexists(path)


def read_bytes(path: str | Path, absent: str, largest: int = LARGEST) -> bytes:
    """Return the content of a regular file.

    Parameters
    ----------
    path : path
        The file; a symbolic link to one is followed.
    absent : str
        What to do where there is no such file.
    largest : int, optional
        Most bytes that are read.

    Raises
    ------
    CaseError
        If there is no such file, it is a folder, a pipe or a device, it is too large, or may not
        be read.

    Examples
    --------
    >>> read_bytes("nowhere.json", "write one")
    Traceback (most recent call last):
    ...
    pneumo_casadi.errors.CaseError: nowhere.json: no such file; write one
    """
    path = Path(path)
    try:
        with open(path, "rb", opener=_open) as file:
            state = os.fstat(file.fileno())
            kind = stat.S_IFMT(state.st_mode)
            if kind != stat.S_IFREG:
                what = _KINDS.get(kind, "no file")
                raise CaseError(f"{path}: is {what}; put a regular file there")
            if state.st_size > largest:
                raise CaseError(
                    f"{path}: {state.st_size} bytes, more than the {largest} bytes that are read; "
                    "export less into one file"
                )
            content = file.read(largest + 1)
    except FileNotFoundError:
        if path.is_symlink():
            target = path.readlink()
            raise CaseError(
                f"{path}: is a link to {target}, which is not there; put the file there"
            ) from None
        raise CaseError(f"{path}: no such file; {absent}") from None
    except IsADirectoryError:  # Windows opens no folder
        raise CaseError(f"{path}: is a folder; put a regular file there") from None
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be read ({error.strerror or error}); correct the file or its rights"
        ) from None
    if len(content) > largest:
        raise CaseError(f"{path}: grows while it is read; copy it first")
    return content


def _open(path: str, flags: int) -> int:
    # Without O_NONBLOCK a pipe that nobody writes to would be waited for.
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def decoded(content: bytes, path: str | Path) -> str:
    """Return the text of a file: by its byte order mark, else UTF-8, else Windows-1252.

    Windows-1252 agrees with Latin-1 where that has printable characters; loggers on Windows write
    it unless they are told otherwise.

    Raises
    ------
    CaseError
        If the file holds zero bytes and no mark of UTF-16, or is no text of its own encoding.

    Examples
    --------
    >>> decoded("20 °C".encode("cp1252"), "a.csv") == decoded("20 °C".encode("utf-16"), "a.csv")
    True
    """
    mark, encoding = next(
        ((mark, name) for mark, name in _MARKS if content.startswith(mark)), (b"", "utf-8")
    )
    try:
        text = content[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        if mark:
            raise CaseError(
                f"{path}: begins as {encoding.upper()} text, but byte {error.start + len(mark)} is "
                "none; export it again"
            ) from None
        # The five bytes that Windows-1252 leaves free are those of Latin-1.
        text = content.decode("cp1252", errors="replace")
    if "\0" in text:
        raise CaseError(f"{path}: holds binary data; export it as UTF-8 text")
    return text


def shown(value: Any) -> str:
    """Return a value from a file for a message: short, and without control characters.

    Examples
    --------
    >>> shown("7 bar"), shown({"a": [1] * 100})
    ("'7 bar'", "{'a': [1, 1, 1, 1, 1, 1, ...]}")
    """
    try:
        return _SHORT.repr(value)
    except ValueError:  # an integer of thousands of digits
        return f"a {type(value).__name__}"


def printable(text: str) -> str:
    r"""Return a name with characters escaped that are no text: control characters, broken UTF-8.

    Examples
    --------
    >>> printable("Axis 2 µ"), printable("axis\x1b[2J\udcff")
    ('Axis 2 µ', 'axis\\x1b[2J\\udcff')
    """
    if text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode("ascii") if category(c) in _NO_TEXT else c for c in text
    )


def one_line(error: Exception) -> str:
    """Return a message of another library on one line, not too long."""
    return printable(" ".join(str(error).split())[:300])


def listed(names: Iterable[str], most: int = 30) -> str:
    """Return names from a file for a message: so many of them, short and printable.

    Examples
    --------
    >>> listed(["t_s", "x_m", "pA"], most=2)
    't_s, x_m and 1 more'
    """
    every = list(names)
    first = ", ".join(
        printable(name if len(name) <= 60 else f"{name[:60]}...") for name in every[:most]
    )
    return f"{first} and {len(every) - most} more" if len(every) > most else first
