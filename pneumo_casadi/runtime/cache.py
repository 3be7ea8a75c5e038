"""The cache folder: compiled models and compiled kernels of the virtual bench."""

import os
from pathlib import Path

from platformdirs import user_cache_path

#: Environment variable that names another cache folder.
FOLDER = "PNEUMO_CASADI_CACHE"


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
        If the folder cannot be made. `PermissionError` if others may write to it: libraries in
        it are loaded and run.
    """
    named = os.environ.get(FOLDER)
    base = Path(named) if named else user_cache_path("pneumo_casadi", appauthor=False)
    folder = base / name
    base.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    if hasattr(os, "getuid"):
        state = folder.stat()
        if state.st_uid != os.getuid() or state.st_mode & 0o022:
            raise PermissionError(
                f"{folder}: others may write to it; make it yours alone (chmod 700), or name "
                f"another folder in {FOLDER}"
            )
    return folder
