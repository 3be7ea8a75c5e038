"""One function for all forms in which a model leaves the package."""

from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path

from pneumo_casadi.errors import ModelError
from pneumo_casadi.export.c_code import write_c
from pneumo_casadi.export.casadi_functions import write_functions
from pneumo_casadi.export.fmu import write_fmu
from pneumo_casadi.export.linear import write_state_space
from pneumo_casadi.export.model import IdentifiedModel, identified_model, read_model, write_model
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.runtime.output_folder import OutputKind, check_writable_files


class Format(Enum):
    """What an identified model is written as."""

    JSON = "json"
    """Model and provenance; read back by `read_model`."""
    CASADI = "casadi"
    """Functions rhs, step and output of CasADi with a sidecar."""
    C = "c"
    """Self-contained C with an example."""
    FMU = "fmu"
    """FMI 3.0, co-simulation and model exchange."""
    SS = "ss"
    """Linear state space, JSON and MAT."""


def export_model(
    model: Identification | IdentifiedModel | str | Path,
    folder: str | Path,
    format: Format | str = Format.JSON,
    at: Mapping[str, float] | None = None,
) -> tuple[Path, ...]:
    """Write an identified model for other tools.

    Parameters
    ----------
    model : Identification, IdentifiedModel or path
        What to write; a path is that of a result folder, ``result.json`` or ``axis.json``.
    folder : path
        Where the files go; made where it is missing. Files of an earlier export are replaced.
    format : Format or str
        ``"json"``, ``"casadi"``, ``"c"``, ``"fmu"`` or ``"ss"`` (linear state space).
    at : mapping of str to float, optional
        Operating point of ``"ss"``: states and inputs in SI units, by name. The others are computed
        such that the axis is at equilibrium.

    Returns
    -------
    tuple of Path
        The files written.

    Raises
    ------
    CaseError
        If a path holds no model, or `folder` is a file.
    ModelError
        If the format is unknown, `at` is given for another format than ``"ss"``, or the format
        cannot hold an effect of your own.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in pc.export_model(result, folder, "ss", at={"x": 0.1})]
    ['axis_ss.json', 'axis_ss.mat']
    """
    try:
        chosen = Format(format)
    except ValueError:
        known = ", ".join(item.value for item in Format)
        raise ModelError(f"no export format {format!r}; there are {known}") from None
    if at and chosen is not Format.SS:
        raise ModelError(f"`at` is for the format ss alone, not for {chosen.value}")
    check_writable_files(folder, OutputKind.EXPORT, ())
    if isinstance(model, Identification):
        model = identified_model(model)
    elif not isinstance(model, IdentifiedModel):
        model = read_model(model)
    writers: dict[Format, Callable[[IdentifiedModel, str | Path], Path | tuple[Path, ...]]] = {
        Format.JSON: write_model,
        Format.CASADI: write_functions,
        Format.C: write_c,
        Format.FMU: write_fmu,
        Format.SS: lambda model, folder: write_state_space(model, folder, at),
    }
    written = writers[chosen](model, folder)
    return written if isinstance(written, tuple) else (written,)
