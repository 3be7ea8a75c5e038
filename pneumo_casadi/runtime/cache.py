"""The cache folder: compiled models and compiled kernels of the virtual bench.

What lies in it is loaded and run. It is therefore the user's alone, and each library carries a code
that only this user's key makes: one that was put there, or came with the folder, is not loaded.
"""

import hashlib
import hmac
import os
import secrets
import stat
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path, user_data_path

from pneumo_casadi.runtime.atomic_files import draft_folder

#: Environment variable that names another cache folder.
FOLDER = "PNEUMO_CASADI_CACHE"
#: Length of the key and of the codes that it makes [bytes].
LENGTH = 32


def cache_folder(name: str = "") -> Path:
    """Return the cache folder, or a folder within it; create it if it is missing.

    Parameters
    ----------
    name : str, optional
        Of a folder within the cache.

    Returns
    -------
    Path
        The folder that ``PNEUMO_CASADI_CACHE`` names, otherwise the place of the operating
        system for caches of this user (``~/.cache/pneumo_casadi`` on Linux).

    Raises
    ------
    OSError
        If the folder cannot be made. `PermissionError` if others may write to it, or replace it:
        libraries in it are loaded and run.
    """
    named = os.environ.get(FOLDER)
    base = Path(named) if named else user_cache_path("pneumo_casadi", appauthor=False)
    folder = (base / name).absolute()
    _make(folder)
    if hasattr(os, "getuid"):
        for above in (folder, *folder.parents):
            _check_owner(above, own=above in (folder, base.absolute()))
    return folder


def authentication_code(content: bytes) -> bytes:
    """Return the code that shows that content was written by this user (HMAC-SHA-256)."""
    return hmac.digest(_key(), content, hashlib.sha256)


def is_own_file(path: Path) -> bool:
    """Return whether a path is a regular file that this user alone may write and read."""
    try:
        state = path.lstat()
    except OSError:
        return False
    if not hasattr(os, "getuid"):
        return stat.S_ISREG(state.st_mode)
    private = stat.S_ISREG(state.st_mode) and not state.st_mode & 0o077
    return private and state.st_uid == os.getuid()


def _make(folder: Path) -> None:
    """Make a folder, and those above it that are missing, for this user alone.

    ``mkdir(parents=True)`` gives the folders above whatever the umask leaves.
    """
    for above in (*reversed(folder.parents), folder):
        if not above.exists():
            above.mkdir(mode=0o700, exist_ok=True)


def _check_owner(folder: Path, own: bool) -> None:
    """Check that nobody else can write to a folder, or rename what lies in it."""
    state = folder.stat()
    others = bool(state.st_mode & 0o022) and (own or not state.st_mode & stat.S_ISVTX)
    if others or state.st_uid not in ((os.getuid(),) if own else (0, os.getuid())):
        raise PermissionError(
            f"{folder}: others may write to it, so that what lies in it may be theirs; remove it, "
            f"or name another folder in {FOLDER}"
        )


@cache
def _key() -> bytes:
    """Return the key of this user, made at its first use; it lies outside the cache.

    Where no file can be kept, each process has a key of its own and builds for itself.
    """
    path = user_data_path("pneumo_casadi", appauthor=False) / "cache.key"
    try:
        _make(path.parent.absolute())
        if not _is_key(path):
            _make_key(path)
        return path.read_bytes()
    except OSError:
        return secrets.token_bytes(LENGTH)


def _make_key(path: Path) -> None:
    """Write a new key; of processes that do so at once the first one decides.

    With keys of their own they would take each other's libraries for somebody else's.
    """
    with draft_folder(path.parent, path.name) as scratch:
        draft = scratch / path.name
        draft.touch(mode=0o600)
        draft.write_bytes(secrets.token_bytes(LENGTH))
        try:
            path.hardlink_to(draft)
        except OSError:  # something is there, or the file system has no links
            if not _is_key(path):
                draft.replace(path)


def _is_key(path: Path) -> bool:
    """Return whether a key of this user is there, whole."""
    return is_own_file(path) and path.stat().st_size == LENGTH
