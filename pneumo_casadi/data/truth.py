"""The true parameters of a case, where they are known."""

from pathlib import Path

from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.input_files import is_named
from pneumo_casadi.runtime.json_input import read_json, typed


def read_truth(folder: Path) -> dict[str, float] | None:
    """Read the true parameters of a case where they are known (``truth.json``).

    Raises
    ------
    CaseError
        If the file is no JSON object of numbers.
    """
    path = folder / "truth.json"
    if not is_named(path):
        return None
    content = read_json(path, 'write one as {"M": 16.9}')
    try:
        return typed(content, dict[str, float])
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from None
