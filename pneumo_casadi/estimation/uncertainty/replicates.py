"""Replicates of a bootstrap, one file each, so that an interrupted run goes on."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pneumo_casadi.errors import CaseError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import atomic_file
from pneumo_casadi.runtime.json_input import read_json


@dataclass(frozen=True, slots=True)
class Replicate:
    """One refit.

    Parameters
    ----------
    index : int
        Which one; its seed follows from it.
    status : str
        ``"converged"``, or why not.
    cost : float
        ½ Σ (residual/σ)².
    iterations : int
        Of the solver.
    values : tuple of float
        The fitted parameters, SI units; where it stopped, if it did not converge.
    """

    index: int
    status: str
    cost: float
    iterations: int
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ReplicateFolder:
    """A folder of replicates of one bootstrap.

    Parameters
    ----------
    folder : Path
        Made when the first replicate is written.
    fingerprint : str
        Of the fit, its data and the plan: replicates of another one are refused.
    """

    folder: Path
    fingerprint: str

    def path(self, index: int) -> Path:
        """Return the file of a replicate."""
        return self.folder / f"replicate_{index:05d}.json"

    def write(self, replicate: Replicate) -> None:
        """Write a replicate in one step: the file is there whole, or not at all."""
        text = json.dumps({"fingerprint": self.fingerprint} | asdict(replicate)) + "\n"
        with atomic_file(self.path(replicate.index)) as draft:
            draft.write_text(text, encoding="utf-8")

    def read(self, index: int) -> Replicate | None:
        """Return a replicate, or None where it is not there.

        Raises
        ------
        CaseError
            If the file cannot be read, or belongs to another bootstrap.
        """
        path = self.path(index)
        if not path.exists():
            return None
        try:
            content = read_json(path, "run it again")
            fingerprint = content.pop("fingerprint")
            values = tuple(float(value) for value in content.pop("values"))
            replicate = Replicate(values=values, **content)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise CaseError(
                f"{path}: not a replicate ({error}); delete it to have it made again"
            ) from None
        if fingerprint != self.fingerprint or replicate.index != index:
            raise CaseError(
                f"{path}: belongs to another bootstrap (other data, fit, seed or block length); "
                "give another folder"
            )
        return replicate


def fingerprint(arrays: Iterable[FloatArray], words: Iterable[object]) -> str:
    """Return a hash of numbers and words.

    Numbers count to nine digits: an optimum found again differs in the last ones.
    """
    digest = hashlib.sha256()
    for array in arrays:
        flat = np.asarray(array, dtype=float).ravel()
        digest.update("".join(f"{value:.8e};" for value in flat).encode())
    digest.update(repr(list(words)).encode())
    return digest.hexdigest()[:32]
