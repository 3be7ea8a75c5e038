"""MAT files parsed in a process of their own: a damaged file may crash or stall the parsers.

Run as a script, without the rest of the package: it answers the requests of a `ServingChild`. A
request is a line of JSON, the names wanted, and then the file; the answer is a line of JSON, what
went wrong, and then the vectors as npz. Where processes can fork, each file has one of its own, and
the parsers are imported once for all.
"""

import io
import json
import math
import os
import signal
import struct
import sys
import traceback
from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np

#: Struct arrays, cells and matrices with more elements than this are not read as columns.
MOST = 100
#: Most vectors of a file, and deepest nesting: loggers write some dozens, three levels deep.
MOST_VECTORS, DEEPEST = 20_000, 30
#: Most values of an array: an hour of ten channels at 5 kHz.
MOST_VALUES = 2 * 10**8
#: Address space of the process [bytes]: a compressed file may claim any size.
MEMORY = 8 * 2**30
#: Processor time to parse a file [s], and in addition per 100 MB; a few seconds are usual.
TIME, TIME_PER_100_MB = 20.0, 20.0
#: The length that begins a request and its answer.
_LENGTH = struct.Struct("<Q")

Vectors = Iterator[tuple[str, Any]]


def main() -> None:
    """Answer requests on standard input until it ends."""
    _limit_memory()
    isolated = hasattr(os, "fork")
    if isolated:
        import scipy.io  # noqa: F401 - before all forks
    while head := sys.stdin.buffer.read(_LENGTH.size):
        request = sys.stdin.buffer.read(*_LENGTH.unpack(head))
        answer = _in_a_fork(_answer, request) if isolated else _answer(request)
        sys.stdout.buffer.write(_LENGTH.pack(len(answer)) + answer)
        sys.stdout.buffer.flush()


def _in_a_fork(answer: Callable[[bytes], bytes], request: bytes) -> bytes:
    """Answer a request in a process of its own, and say so where that does not survive it."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        _limit_time(longest(len(request)))
        with os.fdopen(writer, "wb") as stream:
            stream.write(answer(request))
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        answered = stream.read()
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        if os.WTERMSIG(status) == signal.SIGXCPU:
            return _packed(f"parsing it takes more than {longest(len(request)):.0f} s")
        return _packed(f"the parser ended with signal {os.WTERMSIG(status)}")
    return answered


def _answer(request: bytes) -> bytes:
    names, _, content = request.partition(b"\n")
    try:
        return _packed("", _vectors_as_npz(content, frozenset(json.loads(names))))
    except Exception as error:
        return _packed(traceback.format_exception_only(error)[-1].strip()[:200])


def _packed(wrong: str, vectors: bytes = b"") -> bytes:
    return json.dumps(wrong).encode() + b"\n" + vectors


def _vectors_as_npz(content: bytes, wanted: Collection[str]) -> bytes:
    names: list[str] = []
    arrays: dict[str, Any] = {}
    for name, values in _parsed(content):
        if len(names) >= MOST_VECTORS:
            raise ValueError(f"more than {MOST_VECTORS} vectors")
        if values is not None and (name in wanted or name.rpartition(".")[2] in wanted):
            arrays[str(len(names))] = np.asarray(values).astype(float)
        names.append(name)
    vectors = io.BytesIO()
    np.savez(vectors, names=np.array(json.dumps(names)), **arrays)
    return vectors.getvalue()


def longest(size: int) -> float:
    """Return the processor time that a file of so many bytes may take [s]."""
    return TIME + TIME_PER_100_MB * size / 1e8


def _limit_time(seconds: float) -> None:
    """Let this process end by SIGXCPU: what else a busy machine does must not count."""
    import resource

    allowed = math.ceil(seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (allowed, allowed + 1))


def _limit_memory() -> None:
    try:
        import resource
    except ImportError:  # not on Windows
        return
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _parsed(content: bytes) -> Vectors:
    return _hdf5(content) if is_hdf5(content) else _classic(content)


def is_hdf5(content: bytes) -> bool:
    """Return whether a MAT file is of version 7.3: version and order of bytes end its header."""
    return content.startswith(b"MATLAB") and content[124:128] in (b"\x00\x02IM", b"\x02\x00MI")


def _classic(content: bytes) -> Vectors:
    import scipy.io

    file: Any = io.BytesIO(content)
    for variable, value in scipy.io.loadmat(file).items():
        if not variable.startswith("__"):
            yield from _vectors(variable, value, 1)


def _vectors(name: str, value: Any, depth: int) -> Vectors:
    """Yield the vectors of a variable, with structs, cells and matrices split into vectors."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque

    if isinstance(value, MatlabOpaque | MatlabFunction):
        yield f"{name} (an object: save its columns as vectors)", None
    elif not isinstance(value, np.ndarray) or value.size == 0:
        return
    elif value.dtype.names is not None or value.dtype.kind == "O":
        struct = value.dtype.names is not None
        elements = value.ravel("F")[: MOST + 1]
        if elements.size > MOST or depth > DEEPEST:
            return
        for k, element in enumerate(elements):
            single = struct and value.size == 1
            here = name if single else f"{name}({k + 1})" if struct else f"{name}{{{k + 1}}}"
            if struct:
                for field in value.dtype.names:
                    yield from _vectors(f"{here}.{field}", element[field], depth + 1)
            else:
                yield from _vectors(here, element, depth + 1)
    elif value.dtype.kind in "fiub":
        yield from _columns(name, value)


def _columns(name: str, value: Any) -> Vectors:
    if value.size == max(value.shape, default=0):
        yield name, value.ravel()
    elif value.ndim == 2 and min(value.shape) <= MOST:
        rows, columns = value.shape
        for k in range(min(rows, columns)):
            tall = rows >= columns
            yield (f"{name}(:,{k + 1})", value[:, k]) if tall else (f"{name}({k + 1},:)", value[k])


def _hdf5(content: bytes) -> Vectors:
    import h5py

    entered: set[Any] = set()
    with h5py.File(io.BytesIO(content), "r") as file:
        for variable in file:
            if not variable.startswith("#"):
                yield from _hdf5_vectors(variable, _own(file, variable), file, entered)


def _hdf5_vectors(name: str, item: Any, file: Any, entered: set[Any], depth: int = 1) -> Vectors:
    """Yield the vectors of an HDF5 item, with arrays transposed to the shape that MATLAB shows.

    An object is entered once: links may form a circle, or lead to the next object twice.
    """
    if item is None or "MATLAB_empty" in item.attrs or depth > DEEPEST or item.id in entered:
        return
    entered.add(item.id)
    if "MATLAB_object_decode" in item.attrs:
        yield f"{name} (an object: save its columns as vectors)", None
    elif hasattr(item, "keys"):
        for field in item:
            child = _own(item, field)
            array = child is not None and _references(child) and not _is_cell(child)
            if not array:
                yield from _hdf5_vectors(f"{name}.{field}", child, file, entered, depth + 1)
                continue
            for k, reference in _listed(child):
                yield from _hdf5_vectors(
                    f"{name}({k + 1}).{field}", file[reference], file, entered, depth + 1
                )
    elif _references(item):
        for k, reference in _listed(item):
            yield from _hdf5_vectors(
                f"{name}{{{k + 1}}}", file[reference], file, entered, depth + 1
            )
    elif item.dtype.kind in "fiub" and item.attrs.get("MATLAB_class") != b"char":
        if item.size > MOST_VALUES:  # chunks that are not stored take no room in the file
            raise ValueError(f"{name}: {item.size} values, more than {MOST_VALUES}")
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


if __name__ == "__main__":
    main()
