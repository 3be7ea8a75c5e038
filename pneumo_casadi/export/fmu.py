"""FMU of FMI 3.0: co-simulation and model exchange, with sources and a binary for this platform."""

import hashlib
import importlib.util
import io
import logging
import platform
import zipfile
from collections.abc import Mapping
from pathlib import Path
from string import Template

from pneumo_casadi.errors import MissingExtraError
from pneumo_casadi.export.c_code import NAME, c_sources, template, values
from pneumo_casadi.export.fmi_xml import build_description, model_description
from pneumo_casadi.export.model import IdentifiedModel, description
from pneumo_casadi.model.machine_code.compilation import compiler
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.runtime.children import last_line, run_child
from pneumo_casadi.runtime.json_files import json_text
from pneumo_casadi.runtime.output_folder import write_files

logger = logging.getLogger(__name__)

_HEADERS = ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h")
#: For any machine of this kind: an FMU is passed on.
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden")
_ARCHITECTURES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
_SYSTEMS = {"Linux": ("linux", "so"), "Darwin": ("darwin", "dylib"), "Windows": ("windows", "dll")}


def write_fmu(model: IdentifiedModel, folder: str | Path) -> Path:
    """Write ``axis.fmu``.

    Inputs are the commands, outputs what the sensors show without noise; all parameters can be
    tuned, states are named ``state.p_P`` and so on and can be given a start. A communication
    step holds the inputs and takes the Runge-Kutta steps of the package's own simulation.

    Parameters
    ----------
    model : IdentifiedModel
        What to write; effects and their states are in it.
    folder : path
        Where the file goes; an earlier one is replaced.

    Returns
    -------
    Path
        The FMU. Without a C compiler it holds sources only, and a warning is logged. Equal
        models, compilers and versions give equal files.

    Raises
    ------
    MissingExtraError
        If the package `fmpy` is not installed; it supplies the headers of the FMI standard.
    """
    content = fmu_files(model)
    binary = _binary({name: text for name, text in content.items() if name.startswith("sources/")})
    packed = _zipped({**{k: v.encode("utf-8") for k, v in content.items()}, **binary})
    (path,) = write_files({f"{NAME}.fmu": packed}, folder)
    return path


def fmu_files(model: IdentifiedModel) -> dict[str, str]:
    """Return the text files of the FMU by their path in it, without any binary.

    Raises
    ------
    MissingExtraError
        If the package `fmpy` is not installed.
    """
    substitutions = values(model)
    substitutions["nominals"] = ", ".join(repr(value) for value in model.axis.state_scales.tolist())
    sources = c_sources(model)
    content = model_description(model, "") + "".join(sources.values())
    token = hashlib.sha256(content.encode("utf-8")).hexdigest()
    glue = Template(template("fmi3.c.in")).substitute(substitutions, token=token)
    sources = {**sources, "fmi3.c": glue, **fmi_headers()}
    return {
        "modelDescription.xml": model_description(model, token),
        "resources/model.json": json_text(description(model)),
        "sources/buildDescription.xml": build_description([f"{NAME}.c", "fmi3.c"]),
        **{f"sources/{name}": text for name, text in sources.items()},
    }


def fmi_headers() -> dict[str, str]:
    """Return the C headers of FMI 3.0 by name, as the installed package `fmpy` holds them.

    Raises
    ------
    MissingExtraError
        If the package is not installed, or comes without the headers.
    """
    package = importlib.util.find_spec("fmpy")  # looked up, not imported: it is slow to load
    folders = package.submodule_search_locations if package is not None else None
    files = [Path(folder) / "c-code" / name for folder in folders or () for name in _HEADERS]
    if not files or not all(file.is_file() for file in files):
        raise MissingExtraError(
            "an FMU needs the C headers of the FMI standard, which the package fmpy supplies: "
            "pip install 'pneumo-casadi[export]'"
        )
    return {file.name: file.read_text("utf-8") for file in files}


def _binary(sources: Mapping[str, str]) -> dict[str, bytes]:
    """Compile the sources; nothing where that is not possible."""
    cc = compiler()
    architecture = _ARCHITECTURES.get(platform.machine().lower())
    system, suffix = _SYSTEMS.get(platform.system(), (None, ""))
    if cc is None or architecture is None or system is None:
        logger.warning("no C compiler for %s: the FMU holds sources only", platform.platform())
        return {}
    with draft_folder() as scratch:
        for name, text in sources.items():
            (scratch / Path(name).name).write_text(text, "utf-8")
        library = f"{NAME}.{suffix}"
        command = [cc, *_FLAGS, f"{NAME}.c", "fmi3.c", "-o", library, "-lm"]
        done = run_child(command, cwd=scratch, scratch=scratch)
        if done.returncode:
            logger.warning("%s failed (%s): the FMU holds sources only", cc, last_line(done.stderr))
            return {}
        return {f"binaries/{architecture}-{system}/{library}": (scratch / library).read_bytes()}


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """Pack files, with a fixed time stamp: equal content gives equal files."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
