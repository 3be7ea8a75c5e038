"""Damage to the metered flow map."""

from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd

from damage.kind import Damage, Due, Kind

NAME = "flow_map.csv"
U, P, Q = "u_V", "p_Pa", "q_m_kg_per_s"


def of_map(change: Callable[[pd.DataFrame, Random], Any]) -> Damage:
    """Return the damage that changes the points of the map."""

    def damage(folder: Path, rng: Random) -> None:
        frame = pd.read_csv(folder / NAME)
        result = change(frame, rng)
        frame = result if isinstance(result, pd.DataFrame) else frame
        frame.to_csv(folder / NAME, index=False)

    return damage


def noise(frame: pd.DataFrame, rng: Random) -> None:
    """Replace the flow by noise."""
    generator = np.random.default_rng(rng.randrange(2**32))
    frame[Q] = frame[Q].std() * generator.standard_normal(len(frame))


def contradicted(frame: pd.DataFrame, rng: Random) -> pd.DataFrame:
    """Meter some points a second time, with other flows."""
    again = frame.sample(20, random_state=rng.randrange(2**32)).copy()
    again[Q] = again[Q] * rng.choice((-1.0, 3.0)) + 1e-3
    return pd.concat([frame, again])


def two_valves(folder: Path, rng: Random) -> None:
    """Write the map twice, as those of two valves."""
    for name in ("flow_map_P.csv", "flow_map_N.csv"):
        (folder / name).write_bytes((folder / NAME).read_bytes())
    (folder / NAME).unlink()


def kinds() -> Iterator[Kind]:
    """Yield the kinds of damage to the flow map."""
    groups: dict[Due, dict[str, Damage]] = {
        Due.REFUSE: {
            "empty": lambda folder, rng: (folder / NAME).write_bytes(b""),
            "gone": lambda folder, rng: (folder / NAME).unlink(),
            "header alone": of_map(lambda f, r: f[:0]),
            "three points": of_map(lambda f, r: f.sample(3, random_state=r.randrange(2**32))),
            "a column missing": of_map(lambda f, r: f.drop(columns=r.choice((U, P, Q)))),
            "a column twice": of_map(lambda f, r: f.set_axis([U, U, Q], axis=1)),
            "text": of_map(lambda f, r: f.astype(object).replace({f[Q].iloc[40]: "fast"})),
            "NaN": of_map(lambda f, r: f.replace({f[Q].iloc[40]: np.nan})),
            "pressures in bar": of_map(lambda f, r: f.__setitem__(P, f[P] * 1e-5)),
            "flow in NL/min": of_map(lambda f, r: f.__setitem__(Q, f[Q] * 5e4)),
            "flow zero": of_map(lambda f, r: f.__setitem__(Q, 0.0)),
            "one command": of_map(lambda f, r: f[f[U] == f[U].max()]),
            "one pressure": of_map(lambda f, r: f[f[P] == f[P].max()]),
            "a folder": lambda folder, rng: [(folder / NAME).unlink(), (folder / NAME).mkdir()],
            "a link to nothing": lambda folder, rng: [
                (folder / NAME).unlink(),
                (folder / NAME).symlink_to("gone"),
            ],
            "of one valve alone": lambda folder, rng: (folder / NAME).rename(
                folder / "flow_map_P.csv"
            ),
            "beside those of two": lambda folder, rng: (folder / "flow_map_P.csv").write_bytes(
                (folder / NAME).read_bytes()
            ),
        },
        Due.FINDING: {
            "noise": of_map(noise),
            "flow reversed": of_map(lambda f, r: f.__setitem__(Q, -f[Q])),
            "commands reversed": of_map(lambda f, r: f.__setitem__(U, -f[U])),
            "commands in mV": of_map(lambda f, r: f.__setitem__(U, f[U] * 1e3)),
            "pressures halved": of_map(lambda f, r: f.__setitem__(P, f[P] * 0.5)),
            "gauge pressures": of_map(lambda f, r: f.__setitem__(P, f[P] - 8e4)),
            "a point with two flows": of_map(contradicted),
            "columns swapped": of_map(lambda f, r: f.__setitem__(U, r.choice((f[Q], f[P])))),
            "shuffled flows": of_map(
                lambda f, r: f.__setitem__(
                    Q, f[Q].sample(frac=1, random_state=r.randrange(2**32)).to_numpy()
                )
            ),
            "an outlier": of_map(
                lambda f, r: f.__setitem__(Q, np.where(f.index == r.randrange(len(f)), 0.1, f[Q]))
            ),
            "flow three times": of_map(lambda f, r: f.__setitem__(Q, f[Q] * 3.0)),
            "flow a third": of_map(lambda f, r: f.__setitem__(Q, f[Q] / 3.0)),
        },
        Due.ACCEPT: {
            "shuffled": of_map(lambda f, r: f.sample(frac=1, random_state=r.randrange(2**32))),
            "every second": of_map(lambda f, r: f[f.index % 2 == 0]),
            "another column": of_map(lambda f, r: f.__setitem__("note", "warm")),
            "points twice": of_map(lambda f, r: pd.concat([f, f[:30]])),
            "of two valves": two_valves,
            "empty lines": lambda folder, rng: (folder / NAME).write_text(
                (folder / NAME).read_text() + "\n\n"
            ),
        },
    }
    for due, group in groups.items():
        for what, damage in group.items():
            yield Kind(f"flow map: {what}", due, damage, "flow_map")
