"""A discovered term as a file: JSON, which is data only, or Python source, which can be edited."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pneumo_casadi.effects.term.term import Term
from pneumo_casadi.errors import ModelError

#: Keys of a file; ``text`` and ``units`` are for the reader and are not read back.
KEYS = ("name", "balances", "factor", "driver", "formula", "parameters")


def term_as_dict(term: Term) -> dict[str, Any]:
    """Return a term as plain data, its text and units besides."""
    return {
        "name": term.name,
        "text": term.text,
        "balances": list(term.balances),
        "factor": term.factor,
        "driver": term.driver,
        "formula": term.formula,
        "parameters": dict(term.parameters),
        "units": term.units,
    }


def write_term(term: Term, path: str | Path) -> Path:
    """Write a term as JSON, which `read_term` reads back.

    Parameters
    ----------
    term : Term
        The term.
    path : path
        File to write.

    Returns
    -------
    path
        The file written.

    Examples
    --------
    >>> import tempfile
    >>> spring = Term("spring", ("force",), "1", "x", "line", {"slope": -150.0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_term(write_term(spring, Path(folder) / "spring.json")) == spring
    True
    """
    text = json.dumps(term_as_dict(term), indent=2, ensure_ascii=False) + "\n"
    path = Path(path)
    path.write_text(text, "utf-8")
    return path


def read_term(path: str | Path) -> Term:
    """Read a term that `write_term` has written; the file is data, nothing of it is executed.

    Parameters
    ----------
    path : path
        JSON file; `name` and `parameters` may have been edited.

    Returns
    -------
    Term

    Raises
    ------
    ModelError
        If the file is not one, or names what does not exist.
    """
    try:
        content = json.loads(Path(path).read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"{path}: no term can be read: {error}") from None
    missing = [key for key in KEYS if not isinstance(content, dict) or key not in content]
    if missing:
        raise ModelError(f"{path}: not a discovered term: no {', '.join(missing)}")
    parameters = content["parameters"]
    if not isinstance(parameters, Mapping) or not all(
        isinstance(value, int | float) and not isinstance(value, bool)
        for value in parameters.values()
    ):
        raise ModelError(f"{path}: `parameters` must hold a number for each name")
    try:
        return Term(
            str(content["name"]),
            tuple(content["balances"]),
            str(content["factor"]),
            str(content["driver"]),
            str(content["formula"]),
            {name: float(value) for name, value in parameters.items()},
        )
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def write_term_source(term: Term, path: str | Path) -> Path:
    """Write a term as Python source with a catalogue of this one effect.

    Parameters
    ----------
    term : Term
        The term.
    path : path
        File to write. ``EFFECTS`` in it maps the name to the class.

    Returns
    -------
    path
        The file written.
    """
    parameters = "".join(
        f"        {name!r}: {value!r},\n" for name, value in term.parameters.items()
    )
    text = (
        f'"""{term.text}: a term that a diagnosis discovered."""\n\n'
        "from pneumo_casadi.effects.term import Term, term_effect\n\n"
        f"TERM = Term(\n    name={term.name!r},\n    balances={tuple(term.balances)!r},\n"
        f"    factor={term.factor!r},\n    driver={term.driver!r},\n    formula={term.formula!r},\n"
        f"    parameters={{\n{parameters}    }},\n)\n"
        "EFFECTS = {TERM.name: term_effect(TERM)}\n"
    )
    path = Path(path)
    path.write_text(text, "utf-8")
    return path
