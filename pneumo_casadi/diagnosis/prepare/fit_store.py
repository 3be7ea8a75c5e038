"""Finished fits on disk: interrupted work is taken up again where it stopped."""

import hashlib
import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from pneumo_casadi.data.bench.bench_file import bench_content
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.runtime.atomic_files import atomic_file
from pneumo_casadi.runtime.provenance import code_identity


@dataclass(frozen=True, slots=True)
class Store:
    """A folder of fits of one study.

    Parameters
    ----------
    folder : path
        Where they lie; made if it is not there.
    token : str
        Hash of records, bench, start, flow map, code and criterion of a credible map: fits of
        others are not taken.
    """

    folder: Path
    token: str

    @classmethod
    def of(cls, folder: Path, study: Study) -> "Store":
        """Return the store of a study in a folder."""
        folder.mkdir(parents=True, exist_ok=True)
        digest = hashlib.sha256()
        for record in (*study.train, *study.held_out):
            digest.update(repr((record.hold, record.clock, record.dt)).encode())
            digest.update(np.ascontiguousarray(record.t).tobytes())
            for name, values in sorted(record.channels.items()):
                digest.update(name.encode())
                digest.update(np.ascontiguousarray(values).tobytes())
        known = study.flow_map
        for table in () if known is None else (known if isinstance(known, tuple) else (known,)):
            for part in (table.u, table.p, table.q_m, table.p_supply, table.p_ext):
                digest.update(np.asarray(part, dtype=float).tobytes())
        bench = study.axis.bench  # one's own controller, which no file holds, enters no fit
        # Fits that the metered map contradicts are not kept: by how much is a criterion.
        words = code_identity(), bench_content(bench), sorted(bench.signals)
        known_by = study.criteria.map_ratio, study.axis.parameters.as_dict()
        digest.update(repr((*words, *known_by)).encode())
        return cls(folder, digest.hexdigest())

    def _path(self, effects: Sequence[Effect]) -> Path:
        digest = hashlib.sha256(self.token.encode())
        for effect in effects:
            digest.update(f"{effect.name} {_source(type(effect))}".encode())
        return self.folder / f"{digest.hexdigest()[:32]}.npz"

    def read(self, effects: Sequence[Effect]) -> FittedModel | None:
        """Return a fit that is there, None where none is or the file is damaged."""
        path = self._path(effects)
        try:
            with np.load(path, allow_pickle=False) as held:
                arrays = dict(held)
            parts: list[Any] = [
                tuple(arrays[f"{name}_{i}"] for i in range(int(arrays[f"n_{name}"])))
                for name in _PARTS
            ]
            return FittedModel(
                tuple(effect.name for effect in effects),
                dict(zip(arrays["names"].tolist(), arrays["values"].tolist(), strict=True)),
                dict(zip(arrays["free"].tolist(), arrays["std"].tolist(), strict=True)),
                float(arrays["cost"]),
                parts[0],
                parts[1],
                parts[2],
                parts[3],
                bool(arrays["converged"]),
            )
        except (OSError, KeyError, ValueError, BadZipFile):
            return None

    def write(self, effects: Sequence[Effect], fitted: FittedModel) -> None:
        """Keep a fit, by way of a temporary file."""
        content: dict[str, object] = {
            "names": np.array(list(fitted.values)),
            "values": np.array(list(fitted.values.values())),
            "free": np.array(list(fitted.std)),
            "std": np.array(list(fitted.std.values())),
            "cost": fitted.cost,
            "converged": fitted.converged,
        }
        for name in _PARTS:
            arrays = getattr(fitted, name)
            content[f"n_{name}"] = len(arrays)
            content |= {f"{name}_{i}": array for i, array in enumerate(arrays)}
        with atomic_file(self._path(effects)) as draft, draft.open("wb") as file:
            np.savez(file, **content)  # type: ignore[arg-type]


_PARTS = ("train", "held_out", "used_train", "used_held_out")


def _source(effect: type[Effect]) -> str:
    """Return what makes an effect, and the text of its file: one that has changed is another."""
    made = repr((effect.equation, effect.parameters))  # of terms, whose file is that of all
    try:
        return made + inspect.getsource(inspect.getmodule(effect) or effect)
    except (OSError, TypeError):  # written in a console
        return made
