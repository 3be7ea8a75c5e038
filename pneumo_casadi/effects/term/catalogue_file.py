"""Effects of a file for a catalogue: a discovered term as data, or Python source, executed."""

import runpy
from collections.abc import Mapping
from pathlib import Path

from pneumo_casadi.effects.term.term import term_effect
from pneumo_casadi.effects.term.term_file import read_term
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.effect import Effect


def read_catalogue(path: str | Path) -> dict[str, type[Effect]]:
    """Read effects to be added to a catalogue.

    Parameters
    ----------
    path : path
        ``*.json``: a term as `write_term` writes it; nothing of it is executed. ``*.py``: source
        whose ``EFFECTS`` maps names to classes of effects. **It is executed with your rights**:
        read a file before you pass it.

    Returns
    -------
    dict of str to effect class

    Raises
    ------
    ModelError
        If the file is neither, cannot be read, or has no ``EFFECTS``.
    """
    path = Path(path)
    if path.suffix == ".json":
        term = read_term(path)
        return {term.name: term_effect(term)}
    if path.suffix != ".py":
        raise ModelError(f"{path}: a catalogue is a *.json of a discovered term or a *.py file")
    try:
        effects = runpy.run_path(str(path)).get("EFFECTS")
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error}") from None
    if not isinstance(effects, Mapping) or not effects:
        raise ModelError(f"{path}: define EFFECTS, a mapping of names to classes of effects")
    for name, effect in effects.items():
        if not (isinstance(effect, type) and issubclass(effect, Effect)) or effect.name != name:
            raise ModelError(f"{path}: EFFECTS[{name!r}] must be an effect class of that name")
    return dict(effects)
