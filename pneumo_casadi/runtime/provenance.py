"""Where a result comes from: date, versions, machine, options, records and their hashes."""

import hashlib
import importlib.metadata
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from pneumo_casadi import __version__

#: Packages whose versions every result names.
PACKAGES = ("casadi", "numpy", "scipy", "pandas")


def provenance(
    files: Iterable[Path],
    options: Mapping[str, Any],
    seeds: Mapping[str, int] | None = None,
    records: Sequence[Mapping[str, Any]] = (),
    made: str = "",
) -> dict[str, Any]:
    """Return what is needed to repeat a result.

    Parameters
    ----------
    files : iterable of Path
        Data that it was made from.
    options : mapping
        How it was made, as plain values.
    seeds : mapping of str to int, optional
        Of the random numbers; left out if None.
    records : sequence of mapping, optional
        What the records cover, see `record_ranges`.
    made : str, optional
        When the result was made; by default now.

    Returns
    -------
    dict
        ``made``, ``versions``, ``platform``, ``sha256`` by name of the file, ``records``,
        ``options``, and ``seeds``.
    """
    content: dict[str, Any] = {
        "made": made or now(),
        "versions": package_versions(),
        "platform": platform.platform(),
    }
    if seeds is not None:
        content["seeds"] = dict(seeds)
    return content | {
        "sha256": {path.name: sha256(path) for path in files},
        "records": [dict(record) for record in records],
        "options": dict(options),
    }


def now() -> str:
    """Return date and time in ISO 8601, coordinated universal time, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def package_versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Return the versions of Python, of this package and of others.

    Examples
    --------
    >>> list(package_versions(["numpy"]))
    ['python', 'pneumo_casadi', 'numpy']
    """
    own = {"python": platform.python_version(), "pneumo_casadi": __version__}
    return own | {name: importlib.metadata.version(name) for name in packages}


@cache
def code_identity() -> str:
    """Return the version of this package with a hash of its code, which tells checkouts apart.

    The code is that of the files when it is first asked for; without files (from an archive) the
    version stands alone.

    Examples
    --------
    >>> code_identity().partition("+")[0] == __version__
    True
    """
    code = code_hash(Path(__file__).parent.parent)
    return f"{__version__}+{code}" if code else __version__


def code_hash(root: Path) -> str:
    """Return a hash of all Python files below a folder and their names; empty without any."""
    digest, files = hashlib.sha256(), sorted(root.rglob("*.py"))
    for path in files:
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12] if files else ""


def machine() -> str:
    """Return processor architecture, operating system and number of processors."""
    return f"{platform.machine()} {platform.system()}, {os.cpu_count()} CPUs"


def sha256(path: Path) -> str:
    """Return the hash of a file's content as hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
