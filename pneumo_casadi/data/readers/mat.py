"""MAT files as MATLAB users have them: vectors, matrices, structs, cells; up to 7 and 7.3."""

from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabOpaque

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray

#: Struct arrays, cells and matrices with more elements than this are not read as columns.
MOST = 100
#: Length of the header; its last four bytes hold version and order of bytes, 2 for HDF5.
_HEADER = 128


def read_mat(path: Path, wanted: Container[str]) -> tuple[dict[str, FloatArray], tuple[str, ...]]:
    """Read vectors of numbers from a MAT file.

    Parameters
    ----------
    path : Path
        Of version 4 to 7, or of 7.3 with the package h5py.
    wanted : container of str
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
    with path.open("rb") as file:
        header = file.read(_HEADER)
    hdf5 = header.startswith(b"MATLAB") and header[124:] in (b"\x00\x02IM", b"\x02\x00MI")
    reader = _read_hdf5 if hdf5 else _read_classic
    try:
        vectors = reader(path)
    except CaseError:
        raise
    except Exception as error:  # a damaged file may raise anything from the parser
        raise CaseError(
            f"{path}: not a readable MAT file ({' '.join(str(error).split())}); save it again "
            "with '-v7'"
        ) from None
    leaves = [name.rpartition(".")[2] for name in vectors]
    columns, names = {}, []
    for (name, values), leaf in zip(vectors.items(), leaves, strict=True):
        short = name not in wanted and leaf in wanted and leaves.count(leaf) == 1
        names.append(leaf if short else name)
        if names[-1] in wanted and values is not None:
            columns[names[-1]] = values.astype(float)
    return columns, tuple(names)


def _read_classic(path: Path) -> dict[str, Any]:
    content = scipy.io.loadmat(path)
    return {
        name: values
        for variable, value in content.items()
        if not variable.startswith("__")
        for name, values in _vectors(variable, value)
    }


def _vectors(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a variable, with structs, cells and matrices split into vectors."""
    if isinstance(value, MatlabOpaque | MatlabFunction):
        yield f"{name} (an object: save its columns as vectors)", None
    elif not isinstance(value, np.ndarray) or value.size == 0:
        return
    elif value.dtype.names is not None or value.dtype.kind == "O":
        struct = value.dtype.names is not None
        elements = value.ravel("F")[: MOST + 1]
        if elements.size > MOST:
            return
        for k, element in enumerate(elements):
            single = struct and value.size == 1
            here = name if single else f"{name}({k + 1})" if struct else f"{name}{{{k + 1}}}"
            if struct:
                for field in value.dtype.names:
                    yield from _vectors(f"{here}.{field}", element[field])
            else:
                yield from _vectors(here, element)
    elif value.dtype.kind in "fiub":
        yield from _columns(name, value)


def _columns(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if value.size == max(value.shape, default=0):
        yield name, value.ravel()
    elif value.ndim == 2 and min(value.shape) <= MOST:
        rows, columns = value.shape
        for k in range(min(rows, columns)):
            tall = rows >= columns
            yield (f"{name}(:,{k + 1})", value[:, k]) if tall else (f"{name}({k + 1},:)", value[k])


def _read_hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise CaseError(
            f"{path}: a MAT file of version 7.3 (HDF5); pip install 'pneumo-casadi[mat]' to read "
            "it, or save it with save(file, ..., '-v7')"
        ) from None
    with h5py.File(path, "r") as file:
        return {
            name: values
            for variable in file
            if not variable.startswith("#")
            for name, values in _hdf5_vectors(variable, _own(file, variable), file)
        }


def _hdf5_vectors(name: str, item: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of an HDF5 item, with arrays transposed to the shape that MATLAB shows."""
    if item is None or "MATLAB_empty" in item.attrs:
        return
    if "MATLAB_object_decode" in item.attrs:
        yield f"{name} (an object: save its columns as vectors)", None
    elif hasattr(item, "keys"):
        for field in item:
            child = _own(item, field)
            array = child is not None and _references(child) and not _is_cell(child)
            if not array:
                yield from _hdf5_vectors(f"{name}.{field}", child, file)
                continue
            for k, reference in _listed(child):
                yield from _hdf5_vectors(f"{name}({k + 1}).{field}", file[reference], file)
    elif _references(item):
        for k, reference in _listed(item):
            yield from _hdf5_vectors(f"{name}{{{k + 1}}}", file[reference], file)
    elif item.dtype.kind in "fiub" and item.attrs.get("MATLAB_class") != b"char":
        yield from _columns(name, np.asarray(item[()]).T)


def _own(group: Any, name: str) -> Any:
    """Return a member of a group, None for a link to another file."""
    link = type(group.get(name, getlink=True)).__name__
    return group[name] if link == "HardLink" else None


def _references(item: Any) -> bool:
    return hasattr(item, "dtype") and bool(item.dtype.kind == "O")


def _is_cell(item: Any) -> bool:
    return bool(item.attrs.get("MATLAB_class") == b"cell")


def _listed(item: Any) -> list[tuple[int, Any]]:
    if item.size > MOST:
        return []
    return list(enumerate(np.asarray(item[()]).T.ravel("F")))
