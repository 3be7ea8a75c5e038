"""What ``simulate --bench`` does: a case folder from the virtual bench."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pneumo_casadi.errors import CaseError


def record_case(
    folder: Path,
    seed: int,
    effects: Sequence[str],
    severity: str,
    fs: float,
    duration: float,
    labels: Path | None,
) -> dict[str, Any]:
    """Write a case folder of the virtual bench and return its labels.

    Parameters
    ----------
    folder : path
        Case folder to make.
    seed : int
        Of axis, sizes, references and noise.
    effects : sequence of str
        Hidden effects, ``NAME`` or ``NAME:SEVERITY``.
    severity : str
        Of those that name none.
    fs, duration : float
        Sampling frequency [Hz] and length of each record [s].
    labels : path or None
        Where the labels will go: not into the folder, whose reader must not know them.

    Raises
    ------
    CaseError
        If the labels would land in the folder, or an effect is named twice.
    ModelError
        If an effect or a severity is unknown.
    MissingExtraError
        If numba is not installed.
    """
    from pneumo_casadi.virtual_bench import make_case  # needs the extra `bench`

    if labels is not None and folder.resolve() in labels.resolve().parents:
        raise CaseError(f"{labels}: the labels must not lie in the case folder; choose another")
    severities: dict[str, str] = {}
    for text in effects:
        name, _, own = text.partition(":")
        if name in severities:
            raise CaseError(f"effect {name} is given twice; give it once")
        severities[name] = own or severity
    made = make_case(folder, seed, severities, fs=fs, duration=duration)
    return {"folder": str(folder), **made.labels}
