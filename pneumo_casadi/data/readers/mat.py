"""MAT files as MATLAB users have them: vectors, matrices, structs, cells; up to 7 and 7.3."""

import importlib.util
import io
import json
import sys
from collections import Counter
from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.data.readers import mat_process
from pneumo_casadi.data.readers.mat_process import is_hdf5
from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.children.serving import ChildEndedError, ServingChild
from pneumo_casadi.runtime.input_files import printable

#: Time that a file may take by the clock, over the processor time that it may take: machines are
#: busy with other work.
CLOCK = 10


class UnreadableError(Exception):
    """A file that the parsers do not read; the message says why."""


def read_mat(
    path: Path, content: bytes, wanted: Collection[str]
) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Read vectors of numbers from a MAT file.

    Parameters
    ----------
    path : Path
        Its name in messages.
    content : bytes
        Of version 4 to 7, or of 7.3 with the package h5py.
    wanted : collection of str
        Names of the vectors to read.

    Returns
    -------
    columns : dict of str to (N,) array
        The requested vectors.
    names : tuple of str
        All vectors of the file as MATLAB would address them: ``log.p.A``, ``run(2).t``,
        ``yout(:,3)``, ``data{1}``. A field whose last name is the only one of its kind goes by
        that name, if it is asked for: ``p_P_Pa`` finds ``log.p_P_Pa``.

    Raises
    ------
    CaseError
        If the file is no MAT file, or of version 7.3 and h5py is not installed.
    """
    if is_hdf5(content) and importlib.util.find_spec("h5py") is None:
        raise CaseError(
            f"{path}: a MAT file of version 7.3 (HDF5); pip install 'pneumo-casadi[mat]' to read "
            "it, or save it with save(file, ..., '-v7')"
        )
    try:
        vectors = vectors_of(content, wanted)
    except UnreadableError as error:
        raise CaseError(
            f"{path}: not a readable MAT file ({printable(str(error))}); save it again with '-v7'"
        ) from None
    leaves = [name.rpartition(".")[2] for name in vectors]
    once = {leaf for leaf, count in Counter(leaves).items() if count == 1}
    columns, names = {}, []
    for (name, values), leaf in zip(vectors.items(), leaves, strict=True):
        short = name not in wanted and leaf in wanted and leaf in once
        names.append(leaf if short else name)
        if names[-1] in wanted and values is not None:
            columns[names[-1]] = np.asarray(values, dtype=float)
    return columns, tuple(names)


def vectors_of(content: bytes, wanted: Collection[str]) -> dict[str, Any]:
    """Return the vectors of a MAT file by name, values of those only that are wanted.

    Raises
    ------
    UnreadableError
        If the parser fails, crashes, or takes too long.
    """
    request = json.dumps(list(wanted)).encode() + b"\n" + content
    limit = CLOCK * mat_process.longest(len(request))
    try:
        answer = _parser().ask(request, limit)
    except TimeoutError:
        raise UnreadableError(f"it is not parsed within {limit:.0f} s") from None
    except ChildEndedError:
        raise UnreadableError("the parser ended without an answer") from None
    wrong, _, vectors = answer.partition(b"\n")
    if reason := json.loads(wrong):
        raise UnreadableError(reason)
    with np.load(io.BytesIO(vectors), allow_pickle=False) as held:
        names = json.loads(str(held["names"]))
        return {name: held.get(str(k)) for k, name in enumerate(names)}


@cache
def _parser() -> ServingChild:
    """Return the process that parses all files."""
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return ServingChild([sys.executable, "-P", str(Path(mat_process.__file__))], single)
