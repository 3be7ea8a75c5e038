"""Files that try to exhaust memory or time, and such as would escape a folder."""

import gzip
import io
import json
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from hostility.attack import Attack
from hostility.execution import READ_CASE, READ_FUNCTIONS, READ_MODEL
from pneumo_casadi.runtime.output_folder import MANIFEST

HEADER = "t_s,u_P_V,u_N_V,p_P_Pa,p_N_Pa,x_m,x_ref_m\n"


def record(suffix: str, content: Callable[[], bytes]) -> Callable[[Path, Path], None]:
    """Return what puts a file in place of the record."""

    def write(folder: Path, canary: Path) -> None:
        (folder / "identify.csv").unlink()
        (folder / f"identify{suffix}").write_bytes(content())

    return write


def text(name: str, content: str) -> Callable[[Path, Path], None]:
    """Return what writes a text file."""
    return lambda folder, canary: (folder / name).write_text(content) and None


def element(kind: int, data: bytes) -> bytes:
    """Return an element of a MAT file."""
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def mat(elements: bytes) -> bytes:
    """Return a MAT file of version 5."""
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + elements


def matrix(rows: int, data: bytes) -> bytes:
    """Return a matrix that claims so many rows."""
    parts = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", rows, 1))
    return element(14, parts + element(1, b"t_s") + element(9, data))


def zeros(size: int) -> bytes:
    """Return so many zeros, packed, without packing each of them."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    mebibyte = packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH)
    checksum = struct.pack(">I", size % 65521 << 16 | 1)  # Adler-32 of zeros
    return b"\x78\xda" + mebibyte * (size >> 20) + b"\x03\x00" + checksum


def gzip_of(block: bytes, count: int) -> bytes:
    """Return a block many times, packed once: members of a gzip file are read one after another."""
    return gzip.compress(HEADER.encode(), 9) + gzip.compress(block, 9) * count


def hdf5(kind: str) -> Callable[[], bytes]:
    """Return what makes a MAT file of version 7.3 with links or sizes that never end."""

    def make() -> bytes:
        import h5py

        buffer = io.BytesIO()
        with h5py.File(buffer, "w", userblock_size=512) as file:
            if kind == "double links":
                groups = [file.create_group(f"g{k}") for k in range(60)]
                for first, second in pairwise(groups):
                    first["a"] = second
                    first["b"] = second
            elif kind == "circle":
                group = file.create_group("g")
                group["g"] = group
            elif kind == "references":
                cell = file.create_dataset("c", (2, 1), dtype=h5py.ref_dtype)
                cell.attrs["MATLAB_class"] = "cell"
                cell[0, 0] = cell[1, 0] = cell.ref
            elif kind == "another file":
                file["t_s"] = h5py.ExternalLink("/etc/hostname", "/")
            else:
                file.create_dataset("t_s", (10**11, 1), dtype="f8", chunks=(10**6, 1))
        content = bytearray(buffer.getvalue())
        content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        return bytes(content)

    return make


def parquet(folder: Path, canary: Path) -> None:
    """Write a Parquet file of a billion equal rows in some kilobytes."""
    import numpy as np
    import pyarrow
    import pyarrow.parquet

    (folder / "identify.csv").unlink()
    table = pyarrow.table({"t_s": pyarrow.array(np.zeros(10**6))})
    with pyarrow.parquet.ParquetWriter(folder / "identify.parquet", table.schema) as writer:
        for _ in range(200):
            writer.write_table(table)


def linked(name: str, target: str) -> Callable[[Path, Path], None]:
    """Return what puts a link in place of a file."""

    def write(folder: Path, canary: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(target)

    return write


def pipe(name: str) -> Callable[[Path, Path], None]:
    """Return what puts a pipe in place of a file."""

    def write(folder: Path, canary: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)

    return write


def through_link(folder: Path, canary: Path) -> None:
    """Lay a link to a file outside where an export is written."""
    (folder / "out").mkdir()
    (folder / "precious").write_text("mine")
    (folder / "out" / "axis.json").symlink_to(folder / "precious")


#: What an export to JSON leaves in its folder: the axis, and the list of what belongs to it.
EXPORTED = {"axis.json", MANIFEST}


def elsewhere(folder: Path, canary: Path) -> None:
    """Give the result a name that leads out of the folder."""
    content = json.loads((folder / "result.json").read_text("utf-8"))
    content["case"] = f"../../{canary.name}"
    (folder / "result.json").write_text(json.dumps(content))


def attacks() -> Iterator[Attack]:
    """Yield the attacks on memory, time and other folders."""
    rows = b"0.001,0.1,-0.1,400000,400000,0.1,0.1\n" * 20_000
    records = {
        "zeros packed": (".csv.gz", lambda: gzip_of(bytes(2**20), 2000)),
        "rows packed": (".csv.gz", lambda: gzip_of(rows, 2000)),
        "a line of 60 MB": (".csv", lambda: (HEADER + "1," * 30_000_000).encode()),
        "a million columns": (".csv", lambda: ",".join(map(str, range(10**6))).encode() + b"\n1\n"),
        "bare carriage returns": (
            ".csv",
            lambda: (HEADER + "1,1,1,1,1,1,1\n" * 10**5).replace("\n", "\r").encode(),
        ),
        "a quote that never ends": (".csv", lambda: (HEADER + '"' + "1,2\n" * 10**6).encode()),
        "a claim of rows": (".mat", lambda: mat(matrix(2**31 - 1, bytes(80)))),
        "zeros in a MAT file": (
            ".mat",
            lambda: mat(struct.pack("<II", 15, len(z := zeros(2**31))) + z),
        ),
        "nested cells": (
            ".mat",
            lambda: mat(b"".join(struct.pack("<II", 14, 2**31 - 1) for _ in range(50_000))),
        ),
        "groups linked twice": (".mat", hdf5("double links")),
        "a group in itself": (".mat", hdf5("circle")),
        "a cell of itself": (".mat", hdf5("references")),
        "a link to another file": (".mat", hdf5("another file")),
        "values that are not stored": (".mat", hdf5("sparse")),
    }
    for name, (suffix, content) in records.items():
        yield Attack(f"record: {name}", record(suffix, content), READ_CASE)
    yield Attack("record: 200 million rows", parquet, READ_CASE)
    keys = ", ".join(f'"k{k % 40_000}": 1' for k in range(80_000))
    for name in ("bench.json", "columns.json", "result.json"):
        read = READ_MODEL if name == "result.json" else READ_CASE
        yield Attack(f"{name}: brackets", text(name, "[" * 100_000), read)
        yield Attack(f"{name}: deep objects", text(name, '{"a":' * 100_000), read)
        yield Attack(f"{name}: a long integer", text(name, f'{{"a": {"9" * 10**6}}}'), read)
        yield Attack(f"{name}: keys twice", text(name, f"{{{keys}}}"), read)
        yield Attack(f"{name}: 40 MB", text(name, f'{{"a": [{"1," * 20_000_000}1]}}'), read)
        yield Attack(f"{name}: a pipe", pipe(name), read)
        yield Attack(f"{name}: a device", linked(name, "/dev/zero"), read)
    yield Attack("sidecar: a device", linked("functions.json", "/dev/zero"), READ_FUNCTIONS)
    yield Attack("flow map: a device", linked("flow_map.csv", "/dev/zero"), READ_CASE)
    long_name = text("log.csv", "t," + "p" + "_ " * 20_000 + "\n" + "0,1\n" * 200)
    yield Attack(
        "header: a name that patterns search long",
        long_name,
        "from pneumo_casadi.data.readers.column_guess import guess_channels, guess_unit\n"
        "import numpy as np\n"
        "name = open('log.csv').readline().split(',')[1]\n"
        "guess_channels((name,)); guess_unit('x', name, np.arange(3.0), 1.0)",
    )
    export = "import pneumo_casadi as pc; pc.export_model('result.json', 'out', 'json')"
    yield Attack(
        "export: through a link",
        through_link,
        export,
        lambda folder, printed: (folder / "precious").read_text() != "mine",
    )
    yield Attack(
        "export: a name that leads elsewhere",
        elsewhere,
        export,
        lambda folder, printed: {p.name for p in (folder / "out").iterdir()} != EXPORTED,
    )
