"""Damage to records: text of CSV files, packed, binary, their numbers, and copies of them."""

import gzip
import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd
import scipy.io

from damage.kind import Damage, Due, Kind
from damage.of_json import flipped

NAME = "identify.csv"
CHANNELS = ("u_P_V", "u_N_V", "p_P_Pa", "p_N_Pa", "x_m")


def of_text(change: Callable[[str, Random], str | bytes]) -> Damage:
    """Return the damage that changes the text of the record."""

    def damage(folder: Path, rng: Random) -> None:
        changed = change((folder / NAME).read_text("utf-8"), rng)
        (folder / NAME).write_bytes(changed if isinstance(changed, bytes) else changed.encode())

    return damage


def of_cell(*cells: str) -> Damage:
    """Return the damage that replaces a cell."""

    def change(text: str, rng: Random) -> str:
        lines = text.splitlines()
        row = rng.randrange(1, len(lines))
        values = lines[row].split(",")
        values[rng.randrange(len(values))] = rng.choice(cells)
        lines[row] = ",".join(values)
        return "\n".join(lines) + "\n"

    return of_text(change)


def of_frame(change: Callable[[pd.DataFrame, Random], Any], *names: str) -> Damage:
    """Return the damage that changes the numbers of the record, or of several."""

    def damage(folder: Path, rng: Random) -> None:
        state = rng.getstate()
        for name in names or (NAME,):
            rng.setstate(state)
            frame = pd.read_csv(folder / name)
            result = change(frame, rng)
            result = result if isinstance(result, pd.DataFrame) else frame
            result.to_csv(folder / name, index=False)

    return damage


def written(suffix: str, write: Callable[[pd.DataFrame, Path, Random], None]) -> Damage:
    """Return the damage that writes the record in another format."""

    def damage(folder: Path, rng: Random) -> None:
        frame = pd.read_csv(folder / NAME)
        (folder / NAME).unlink()
        write(frame, folder / f"identify{suffix}", rng)

    return damage


def damaged(
    write: Callable[[pd.DataFrame, Path, Random], None],
    change: Callable[[bytes, Random], bytes] = flipped,
) -> Callable[[pd.DataFrame, Path, Random], None]:
    """Return a writer whose file is damaged."""

    def damage(frame: pd.DataFrame, path: Path, rng: Random) -> None:
        write(frame, path, rng)
        path.write_bytes(change(path.read_bytes(), rng))

    return damage


def gz(frame: pd.DataFrame, path: Path, rng: Random) -> None:
    """Write gzipped CSV."""
    path.write_bytes(gzip.compress(frame.to_csv(index=False).encode(), 1))


def mat(frame: pd.DataFrame, path: Path, rng: Random) -> None:
    """Write a MAT file of version 5."""
    content = {name: frame[name].to_numpy() for name in frame}
    scipy.io.savemat(path, {"log": content}, do_compression=rng.random() < 0.5)


def hdf5(frame: pd.DataFrame, path: Path, rng: Random) -> None:
    """Write a MAT file of version 7.3."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        log = file.create_group("log")
        for name in frame:
            log.create_dataset(name, data=frame[name].to_numpy()[None])
    content = bytearray(buffer.getvalue())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(bytes(content))


def parquet(frame: pd.DataFrame, path: Path, rng: Random) -> None:
    """Write a Parquet file."""
    frame.to_parquet(path)


def cut(content: bytes, rng: Random) -> bytes:
    """Cut a file short."""
    return content[: rng.randrange(len(content) // 20, len(content) * 9 // 10)]


def bomb(frame: pd.DataFrame, path: Path, rng: Random) -> None:
    """Write a few kilobytes that unpack to hundreds of megabytes."""
    head = frame.to_csv(index=False).encode()
    member = gzip.compress(b"0," * 2**23 * 4, 1)
    path.write_bytes(gzip.compress(head, 1) + member * 4)


def channel(rng: Random) -> str:
    """Return a channel at random."""
    return rng.choice(CHANNELS)


def scatter(frame: pd.DataFrame, rng: Random) -> None:
    """Replace a measured channel by noise of its mean and spread."""
    name = rng.choice(CHANNELS[2:])
    noise = np.random.default_rng(rng.randrange(2**32)).standard_normal(len(frame))
    frame[name] = frame[name].mean() + frame[name].std() * noise


def copied(name: str, part: Callable[[pd.DataFrame], pd.DataFrame] = lambda f: f) -> Damage:
    """Return the damage that puts a copy of the record beside it."""

    def damage(folder: Path, rng: Random) -> None:
        part(pd.read_csv(folder / NAME)).to_csv(folder / name, index=False)

    return damage


def shifted_clock(frame: pd.DataFrame) -> pd.DataFrame:
    """Return the last two thirds, the clock from zero."""
    tail = frame.iloc[len(frame) // 3 :].copy()
    tail["t_s"] = (tail["t_s"] - tail["t_s"].iloc[0]).round(6)
    return tail


def instead(make: Callable[[Path], None]) -> Damage:
    """Return the damage that puts something else in place of the record."""

    def damage(folder: Path, rng: Random) -> None:
        (folder / NAME).unlink()
        make(folder / NAME)

    return damage


def kinds() -> Iterator[Kind]:
    """Yield the kinds of damage to records."""
    refuse: dict[str, Damage] = {
        "cut short": of_text(lambda t, r: t[: r.randrange(1, len(t) // 100)]),
        "empty": of_text(lambda t, r: ""),
        "header alone": of_text(lambda t, r: t.split("\n", 1)[0]),
        "noise": of_text(lambda t, r: r.randbytes(5000)),
        "text in a cell": of_cell("1.0 V", "n/a?", "--", "1,5", "#REF!", "a" * 5000),
        "Latin-1 text in a cell": of_text(
            lambda t, r: (
                t.encode().replace(b"0.0,", "20 °C,".encode("latin-1"), 3)
                if b"0.0," in t.encode()
                else t.encode().replace(b"\n0", "\n20 °C".encode("latin-1"), 3)
            )
        ),
        "an impossible number": of_cell("nan", "inf", "-inf", "1e999", "9" * 400, "1e308"),
        "an empty cell": of_cell(""),
        "a column twice": of_text(lambda t, r: t.replace("u_N_V", "u_P_V", 1)),
        "a column missing": of_frame(lambda f, r: f.drop(columns=channel(r))),
        "no header": of_text(lambda t, r: t.split("\n", 1)[1]),
        "semicolons": of_text(lambda t, r: t.replace(",", ";")),
        "tabs": of_text(lambda t, r: t.replace(",", "\t")),
        "decimal commas": of_text(lambda t, r: t.replace(",", ";").replace(".", ",")),
        "ragged": of_text(
            lambda t, r: t.replace("\n", ",7\n", 1).replace(",7\n", "\n", 1) + "1,2\n"
        ),
        "a row too long": of_text(lambda t, r: t + "1,2,3,4,5,6,7,8,9\n"),
        "zero bytes": of_text(lambda t, r: t[:2000] + "\0" * 100 + t[2000:]),
        "rows lost": of_frame(lambda f, r: f.drop(index=range(k := r.randrange(500, 900), k + 5))),
        "rows twice": of_frame(lambda f, r: pd.concat([f[:900], f[880:]])),
        "time backward": of_frame(lambda f, r: f[::-1]),
        "time constant": of_frame(lambda f, r: f.update({"t_s": f["t_s"] * 0})),
        "time in ms": of_frame(lambda f, r: f.__setitem__("t_s", f["t_s"] * 1e3)),
        "time huge": of_frame(lambda f, r: f.__setitem__("t_s", f["t_s"] + 1e300)),
        "time overflows": of_frame(
            lambda f, r: f.__setitem__("t_s", np.where(f.index == 700, 1e308, f["t_s"]))
        ),
        "bar": of_frame(lambda f, r: f.__setitem__("p_P_Pa", f["p_P_Pa"] * 1e-5)),
        "mm": of_frame(lambda f, r: f.__setitem__("x_m", f["x_m"] * 1e3)),
        "a dead sensor": of_frame(lambda f, r: f.__setitem__(k := r.choice(CHANNELS[2:]), f[k][5])),
        "a spike": of_frame(
            lambda f, r: f.__setitem__("x_m", np.where(f.index == 777, 9, f["x_m"]))
        ),
        "swapped chambers": of_frame(
            lambda f, r: f.rename(columns={"p_P_Pa": "p_N_Pa", "p_N_Pa": "p_P_Pa"})
        ),
        "position reversed": of_frame(lambda f, r: f.__setitem__("x_m", -f["x_m"])),
        "a folder": instead(lambda p: p.mkdir()),
        "a pipe": instead(lambda p: os.mkfifo(p)),
        "a link to nothing": instead(lambda p: p.symlink_to("gone.csv")),
        "a device": instead(lambda p: p.symlink_to("/dev/zero")),
        "packed, cut short": written(".csv.gz", damaged(gz, cut)),
        "packed, no gzip": written(".csv.gz", lambda f, p, r: p.write_bytes(r.randbytes(900))),
        "packed, a bomb": written(".csv.gz", bomb),
        "MAT cut short": written(".mat", damaged(mat, cut)),
        "MAT of noise": written(".mat", lambda f, p, r: p.write_bytes(r.randbytes(5000))),
        "HDF5 cut short": written(".mat", damaged(hdf5, cut)),
        "Parquet cut short": written(".parquet", damaged(parquet, cut)),
        "two formats": lambda folder, rng: gz(
            pd.read_csv(folder / NAME), folder / "identify.csv.gz", rng
        ),
    }
    finding: dict[str, Damage] = {
        "gauge pressures": of_frame(
            lambda f, r: [f.__setitem__(k, f[k] - 1e5) for k in ("p_P_Pa", "p_N_Pa")], NAME
        ),
        "noise for a channel": of_frame(scatter),
        "a channel doubled": of_frame(lambda f, r: f.__setitem__(k := channel(r), f[k] * 2.0)),
        "a channel halved": of_frame(lambda f, r: f.__setitem__(k := channel(r), f[k] * 0.5)),
        "p_P one bar high": of_frame(lambda f, r: f.__setitem__("p_P_Pa", f["p_P_Pa"] + 1e5)),
        "the command late": of_frame(
            lambda f, r: [f.__setitem__(k, f[k].shift(3, fill_value=0)) for k in CHANNELS[:2]]
        ),
        "a copy beside it": copied("identify_old.csv"),
        "half a copy beside it": copied("identify_2.csv", lambda f: f.iloc[: len(f) // 2]),
        "a tail beside it": copied("identify_tail.csv", shifted_clock),
        "the record held out": copied("validate_again.csv"),
        "x from the end": of_frame(
            lambda f, r: [f.__setitem__(k, f[k] + 0.25) for k in ("x_m", "x_ref_m")]
        ),
    }
    valid: dict[str, Damage] = {
        "packed": written(".csv.gz", gz),
        "MAT": written(".mat", mat),
        "HDF5": written(".mat", hdf5),
        "Parquet": written(".parquet", parquet),
        "Windows line ends": of_text(lambda t, r: t.replace("\n", "\r\n")),
        "old Mac line ends": of_text(lambda t, r: t.replace("\n", "\r")),
        "byte order mark": of_text(lambda t, r: "\ufeff" + t),
        "UTF-16": of_text(lambda t, r: t.encode("utf-16")),
        "a Latin-1 column": of_text(
            lambda t, r: t.replace("\n", ",20 °C\n").replace("20 °C", "T", 1).encode("latin-1")
        ),
        "another column": of_frame(lambda f, r: f.__setitem__("note", "warm")),
        "other order": of_frame(lambda f, r: f[r.sample(list(f), len(f.columns))]),
        "empty lines at the end": of_text(lambda t, r: t + "\n\n"),
        "no last line end": of_text(lambda t, r: t.rstrip("\n")),
        "quoted header": of_text(
            lambda t, r: (
                ",".join(f'"{n}"' for n in t.split("\n", 1)[0].split(","))
                + "\n"
                + t.split("\n", 1)[1]
            )
        ),
        "exponents": of_frame(lambda f, r: f.map(lambda v: f"{v:.12e}")),
        "a link": lambda folder, rng: [
            (folder / NAME).rename(folder / "log.txt"),
            (folder / NAME).symlink_to("log.txt"),
        ],
    }
    unclear: dict[str, Damage] = {
        "a byte changed": of_text(lambda t, r: flipped(t.encode(), r)),
        "packed, a byte changed": written(".csv.gz", damaged(gz)),
        "MAT, a byte changed": written(".mat", damaged(mat)),
        "MAT, header changed": written(
            ".mat", damaged(mat, lambda b, r: flipped(b[:200], r) + b[200:])
        ),
        "HDF5, a byte changed": written(".mat", damaged(hdf5)),
        "HDF5, header changed": written(
            ".mat", damaged(hdf5, lambda b, r: b[:512] + flipped(b[512:2500], r) + b[2500:])
        ),
        "Parquet, a byte changed": written(".parquet", damaged(parquet)),
    }
    for due, group in (
        (Due.REFUSE, refuse),
        (Due.FINDING, finding),
        (Due.ACCEPT, valid),
        (Due.ANY, unclear),
    ):
        for what, damage in group.items():
            yield Kind(f"record: {what}", due, damage, "identify")
