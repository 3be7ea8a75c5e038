"""CasADi functions as files, with a sidecar that says what their numbers are."""

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import casadi as ca
import numpy as np
from msgspec import Meta

from pneumo_casadi.errors import CaseError
from pneumo_casadi.export.function_check import CLASSES, refusal
from pneumo_casadi.export.model import FORMAT, IdentifiedModel, description
from pneumo_casadi.model.integration import step_function
from pneumo_casadi.model.stepping import Stepping
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.runtime.input_files import read_bytes, shown
from pneumo_casadi.runtime.json_files import json_text
from pneumo_casadi.runtime.json_input import Section, check_format, read_json, typed
from pneumo_casadi.runtime.output_folder import write_files

SIDECAR = "functions.json"
_KIND = "pneumo_casadi functions"
#: Output of each function, and which quantities it consists of.
_RESULTS = {"rhs": ("dx", "states"), "step": ("x_next", "states"), "output": ("y", "outputs")}
#: Names of classes as CasADi writes them, length first: a closed list, since many load a library.
_CLASS = re.compile(rb"(?=([\x03-\xff]\x00{3})([A-Z][A-Za-z0-9]{2,}))")
#: The option to compile on loading, as CasADi writes it: flag, clean-up, length of "source".
_COMPILE = re.compile(rb"([\x00-\xff])[\x00-\xff]\x06\x00{3}source")
#: Other values of that option: a library, or code within the file.
_LIBRARY = re.compile(rb"\x04\x00{3}link|\x05\x00{3}embed")
#: Largest file of functions that is read [bytes]; that of an axis with all effects is 1 MB.
LARGEST = 64 * 2**20


class _Sampling(Section):
    dt_s: Annotated[float, Meta(gt=0)]


class _File(Section):
    sha256: str


class _Sidecar(Section):
    kind: str
    states: dict[str, str]
    inputs: dict[str, str]
    outputs: dict[str, str]
    sampling: _Sampling
    start: dict[str, float]
    functions: dict[str, _File]


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
    sidecar = _read_sidecar(folder / SIDECAR)
    texts = {name: _checked(folder, name, sidecar.functions[name].sha256) for name in _RESULTS}
    refused = refusal(list(texts.values()))
    if refused:
        raise CaseError(
            f"{folder}: {', '.join(f'{name}.casadi' for name in _RESULTS)}: not read, "
            f"{refused}; export again with this version"
        )
    functions = {name: _rebuilt(name, text) for name, text in texts.items()}
    names = {kind: getattr(sidecar, kind) for kind in ("states", "inputs", "outputs")}
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
        dt=sidecar.sampling.dt_s,
        start=np.array([sidecar.start[name] for name in sidecar.states]),
    )


def _bound(model: IdentifiedModel) -> dict[str, ca.Function]:
    """Return the functions of (x, u) with the parameters put in, without calls of others."""
    axis = model.axis
    x, u = axis.symbol.sym("x", len(axis.states)), axis.symbol.sym("u", len(axis.inputs))
    step = step_function(axis, Stepping(model.dt, substeps=model.substeps), inline=True)
    # What runs on between samples is held too, as the documentation of `step` says.
    held = ca.vertcat(u, u[len(axis.kind.commands) :, :])
    theta = axis.symbol(ca.DM(axis.parameters.values))
    return {
        name: ca.Function(
            name, [x, u], f.call([x, w, theta], True, False), ["x", "u"], [_RESULTS[name][0]]
        )
        for name, f, w in (("rhs", axis.rhs, u), ("step", step, held), ("output", axis.output, u))
    }


def _saved(f: ca.Function) -> bytes:
    with draft_folder() as scratch:
        path = scratch / "f.casadi"
        f.save(str(path))
        return path.read_bytes()


def _read_sidecar(path: Path) -> _Sidecar:
    content = read_json(path, "export again")
    try:
        check_format(content, FORMAT)
        sidecar = typed(content, _Sidecar)
        if sidecar.kind != _KIND:
            raise CaseError(f"`kind`: expected {_KIND!r}, got {shown(sidecar.kind)}")
        for name in _RESULTS:
            typed(sidecar.functions.get(name), _File, f"functions.{name}")
        missing = sorted(sidecar.states.keys() - sidecar.start.keys())
        if missing or not sidecar.states:
            raise CaseError(f"`start`: no value of {', '.join(missing) or 'any state'}")
    except CaseError as error:
        raise CaseError(
            f"{path}: not a sidecar of exported functions: {error}; export again"
        ) from None
    return sidecar


def _checked(folder: Path, name: str, expected: str) -> str:
    """Return the content of a file, refused if CasADi would load a library or call a compiler.

    CasADi writes each byte as two letters from a to p, low half first.
    """
    path = folder / f"{name}.casadi"
    data = read_bytes(path, "export again", LARGEST)
    if hashlib.sha256(data).hexdigest() != expected:
        raise CaseError(f"{path}: not the file that {SIDECAR} was written with; export again")
    if len(data) % 2 or not re.fullmatch(rb"[a-p]+", data):
        raise CaseError(f"{path}: no file of CasADi functions; export again")
    letters = np.frombuffer(data, dtype=np.uint8) - ord("a")
    content = (letters[0::2] | (letters[1::2] << 4)).tobytes()
    names = [
        match[2][: match[1][0]].decode()
        for match in _CLASS.finditer(content)
        if match[1][0] <= len(match[2])
    ]
    options = _COMPILE.findall(content)
    compiling = any(flag != b"\x00" for flag in options) or len(options) != len(names)
    if not set(names) <= set(CLASSES) or compiling or _LIBRARY.search(content):
        raise CaseError(
            f"{path}: asks for a library or a compiler when it is read; such a file is not "
            "loaded, export the model again"
        )
    return data.decode()


def _rebuilt(name: str, text: str) -> ca.Function:
    """Return the function of a checked file, made anew of its expressions.

    A file may set options: to write arguments to files, to compile derivatives. They stay behind.
    """
    f = ca.StringDeserializer(text).unpack()
    symbol: Any = ca.MX if f.is_a("MXFunction") else ca.SX
    given = [symbol.sym(f.name_in(i), f.sparsity_in(i)) for i in range(f.n_in())]
    return ca.Function(name, given, f.call(given, True, False), f.name_in(), f.name_out())
