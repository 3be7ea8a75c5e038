"""CasADi functions as files, with a sidecar that says what their numbers are."""

import hashlib
import json
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from pneumo_casadi.errors import CaseError
from pneumo_casadi.export.folder import write_files
from pneumo_casadi.export.model import FORMAT, IdentifiedModel, description
from pneumo_casadi.model.integration import Stepping, step_function
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.json_files import json_text

SIDECAR = "functions.json"
_KIND = "pneumo_casadi functions"
#: Output of each function, and which quantities it consists of.
_RESULTS = {"rhs": ("dx", "states"), "step": ("x_next", "states"), "output": ("y", "outputs")}
#: What a file may not hold: classes that load a library, or values of an option to compile.
_LIBRARY = re.compile(rb"External|Importer|DllLibrary|\x04\x00{3}link|\x05\x00{3}embed")
#: The option to compile on loading, as CasADi writes it: flag, clean-up, length of "source".
_COMPILE = re.compile(rb"([\x00-\xff])[\x00-\xff]\x06\x00{3}source")


@dataclass(frozen=True, slots=True, eq=False)
class ExportedFunctions:
    """The functions of an axis as read from files.

    Parameters
    ----------
    rhs : casadi.Function
        ẋ = f(x, u).
    step : casadi.Function
        x[k+1] = F(x[k], u[k]), u held for `dt`.
    output : casadi.Function
        y = h(x, u), what the sensors show.
    states, inputs, outputs : dict of str to str
        Names with their SI units, in order.
    dt : float
        Sampling period of `step` [s].
    start : (nx,) array
        A state to start from: mid-stroke, at rest, forces balanced.
    """

    rhs: ca.Function
    step: ca.Function
    output: ca.Function
    states: dict[str, str]
    inputs: dict[str, str]
    outputs: dict[str, str]
    dt: float
    start: FloatArray


def write_functions(model: IdentifiedModel, folder: str | Path) -> tuple[Path, ...]:
    """Write ``rhs.casadi``, ``step.casadi``, ``output.casadi`` and ``functions.json``.

    All are functions of (x, u), the parameters are in them. CasADi reads them in any of its
    languages: ``casadi.Function.load("step.casadi")``.

    Parameters
    ----------
    model : IdentifiedModel
        What to write; effects and their states are in it.
    folder : path
        Where the files go; those of an earlier export are replaced.

    Returns
    -------
    tuple of Path
        The four files.
    """
    files: dict[str, str | bytes] = {}
    entries: dict[str, Any] = {}
    for name, f in _bound(model).items():
        content = _saved(f)
        files[f"{name}.casadi"] = content
        entries[name] = {
            "file": f"{name}.casadi",
            "sha256": hashlib.sha256(content).hexdigest(),
            "arguments": {"x": "states", "u": "inputs"},
            "result": dict([_RESULTS[name]]),
        }
    sidecar = {"kind": _KIND, **description(model), "functions": entries}
    files[SIDECAR] = json_text(sidecar)
    return write_files(files, folder)


def read_functions(folder: str | Path) -> ExportedFunctions:
    """Read what `write_functions` has written.

    The sidecar is checked, and each file against its hash in the sidecar. A file that would load
    a library or compile code is refused before CasADi reads it; reading the others only builds
    expressions.

    Parameters
    ----------
    folder : path
        Where `write_functions` has put them.

    Raises
    ------
    CaseError
        If a file is missing, changed, of another shape than the sidecar says, or would run
        foreign code.
    """
    folder = Path(folder)
    path = folder / SIDECAR
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: not a readable JSON file ({error}); export again") from None
    try:
        if content["kind"] != _KIND or content["format"] != FORMAT:
            raise ValueError(f"kind {content['kind']!r}, format {content['format']!r}")
        names = {kind: _names(content[kind]) for kind in ("states", "inputs", "outputs")}
        dt = float(content["sampling"]["dt_s"])
        start = np.array([float(content["start"][name]) for name in names["states"]])
        if not (dt > 0 and np.isfinite([dt, *start]).all()):
            raise ValueError(f"dt_s {dt}, start {start.tolist()}")
        entries = {name: content["functions"][name] for name in _RESULTS}
        hashes = {name: str(item["sha256"]) for name, item in entries.items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CaseError(
            f"{path}: not a sidecar of exported functions ({type(error).__name__}: {error}); "
            "export again"
        ) from None
    functions = {name: _load(folder / f"{name}.casadi", hashes[name]) for name in _RESULTS}
    for name, f in functions.items():
        expected = [len(names["states"]), len(names["inputs"]), len(names[_RESULTS[name][1]])]
        shape = [f.numel_in(i) for i in range(f.n_in())] + [f.numel_out(0)]
        if shape != expected:
            raise CaseError(
                f"{folder / name}.casadi: sizes of x, u and result are {shape}, {SIDECAR} names "
                f"{expected}; export again"
            )
    return ExportedFunctions(
        rhs=functions["rhs"],
        step=functions["step"],
        output=functions["output"],
        states=names["states"],
        inputs=names["inputs"],
        outputs=names["outputs"],
        dt=dt,
        start=start,
    )


def _bound(model: IdentifiedModel) -> dict[str, ca.Function]:
    """Return the functions of (x, u) with the parameters put in."""
    axis = model.axis
    x, u = axis.symbol.sym("x", len(axis.states)), axis.symbol.sym("u", len(axis.inputs))
    step = step_function(axis, Stepping(model.dt, substeps=model.substeps))
    theta = axis.symbol(ca.DM(axis.parameters.values))
    return {
        name: ca.Function(name, [x, u], [f(x, u, theta)], ["x", "u"], [_RESULTS[name][0]])
        for name, f in (("rhs", axis.rhs), ("step", step), ("output", axis.output))
    }


def _saved(f: ca.Function) -> bytes:
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "f.casadi"
        f.save(str(path))
        return path.read_bytes()


def _names(content: Any) -> dict[str, str]:
    names = {str(name): unit for name, unit in content.items()}
    if not names or not all(isinstance(unit, str) for unit in names.values()):
        raise ValueError(f"names with units expected, got {content!r}")
    return names


def _load(path: Path, expected: str) -> ca.Function:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CaseError(f"{path}: cannot be read ({error}); export again") from None
    if hashlib.sha256(data).hexdigest() != expected:
        raise CaseError(f"{path}: not the file that {SIDECAR} was written with; export again")
    _refuse_foreign_code(path, data)
    try:
        return ca.Function.load(str(path))
    except Exception as error:  # CasADi raises what it likes on a damaged file
        raise CaseError(
            f"{path}: CasADi {ca.CasadiMeta.version()} cannot read it "
            f"({str(error).strip()[:200]}); export again with this version"
        ) from None


def _refuse_foreign_code(path: Path, data: bytes) -> None:
    """Refuse a file that would make CasADi load a library or call a compiler.

    CasADi writes each byte as two letters from a to p, low half first.
    """
    if len(data) % 2 or not re.fullmatch(rb"[a-p]+", data):
        raise CaseError(f"{path}: no file of CasADi functions; export again")
    letters = np.frombuffer(data, dtype=np.uint8) - ord("a")
    content = (letters[0::2] | (letters[1::2] << 4)).tobytes()
    compiling = [match for match in _COMPILE.finditer(content) if match[1] != b"\x00"]
    functions = len(re.findall(rb"[A-Z]+Function", content))
    if _LIBRARY.search(content) or compiling or functions != len(_COMPILE.findall(content)):
        raise CaseError(
            f"{path}: asks for a library or a compiler when it is read; such a file is not "
            "loaded, export the model again"
        )
