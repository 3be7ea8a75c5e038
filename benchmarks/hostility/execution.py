"""Files that try to run code."""

import contextlib
import hashlib
import json
import os
import pickle
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import scipy.io

from hostility.attack import Attack, run_forked

READ_CASE = "import pneumo_casadi as pc; pc.check('.')"
READ_FUNCTIONS = "from pneumo_casadi.export import read_functions; f = read_functions('.'); f.step"
READ_MODEL = "import pneumo_casadi as pc; pc.read_model('result.json')"
EXPORT_C = "import pneumo_casadi as pc; pc.export_model('result.json', 'out', 'c')"
COMPILE = """
import pneumo_casadi as pc, subprocess, ctypes
pc.export_model('result.json', 'out', 'c')
subprocess.run(['cc', '-trigraphs', '-shared', '-fPIC', 'axis.c', '-o', 'axis.so', '-lm'],
               cwd='out', check=True, capture_output=True)
ctypes.CDLL('./out/axis.so')
"""
COMPILED = """
import casadi as ca
from pneumo_casadi.model.machine_code.compilation import compile_functions
x = ca.SX.sym('x')
(f,) = compile_functions([ca.Function('square', [x], [x**2])])
assert float(f(3)) == 9
"""


class Payload:
    """An object whose unpickling makes the canary."""

    def __init__(self, canary: Path) -> None:
        self.canary = str(canary)

    def __reduce__(self) -> tuple[Any, ...]:
        return open, (self.canary, "w")


def library(path: Path, canary: Path) -> None:
    """Build a library that makes the canary when it is loaded."""
    code = (
        "#include <stdio.h>\n__attribute__((constructor)) static void f(void) "
        f'{{ FILE *g = fopen("{canary}", "w"); if (g) fclose(g); }}\n'
    )
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", str(path)],
        input=code.encode(),
        check=True,
        capture_output=True,
    )


def functions(make: Callable[[Path, Path], ca.Function]) -> Callable[[Path, Path], None]:
    """Return what puts a function in place of the exported step, with its hash."""

    def write(folder: Path, canary: Path) -> None:
        with contextlib.chdir(folder.parent):  # CasADi's compiler leaves files where it runs
            f = make(folder, canary)
        f.save(str(folder / "step.casadi"))
        canary.unlink(missing_ok=True)
        seal(folder)

    return write


def seal(folder: Path) -> None:
    """Write the hash of the step into the sidecar, as a forger would."""
    content = json.loads((folder / "functions.json").read_text("utf-8"))
    digest = hashlib.sha256((folder / "step.casadi").read_bytes()).hexdigest()
    content["functions"]["step"]["sha256"] = digest
    (folder / "functions.json").write_text(json.dumps(content))


def symbols() -> tuple[ca.MX, ca.MX]:
    """Return a state and an input of the sizes of the exported step."""
    return ca.MX.sym("x", 4), ca.MX.sym("u", 2)


def external(folder: Path, canary: Path) -> ca.Function:
    """Return a function of a library."""
    x, u = symbols()
    f = ca.Function("step", [x, u], [x + u[0]])
    generator = ca.CodeGenerator("step.c")
    generator.add(f)
    (folder / "evil.c").write_text(
        generator.dump() + "\n#include <stdio.h>\n__attribute__((constructor)) static void f(void)"
        f'{{ FILE *g = fopen("{canary}", "w"); if (g) fclose(g); }}\n'
    )
    path = folder / "evil.so"
    subprocess.run(["cc", "-shared", "-fPIC", folder / "evil.c", "-o", path], check=True)
    return ca.external("step", str(path))


def nested(folder: Path, canary: Path) -> ca.Function:
    """Return a function that calls one of a library."""
    x, u = symbols()
    f = external(folder, canary)
    return ca.Function("step", [x, u], [f(x, u)])


def with_options(**options: Any) -> Callable[[Path, Path], ca.Function]:
    """Return a function with options that act when it is read, evaluated or differentiated."""

    def make(folder: Path, canary: Path) -> ca.Function:
        x, u = symbols()
        chosen = json.loads(json.dumps(options).replace("CANARY", str(canary)))
        return ca.Function("step", [x, u], [x + u[0]], chosen)

    return make


def plugin(kind: str, name: str) -> Callable[[Path, Path], None]:
    """Return what names a plug-in in a file, whose library lies in the current folder."""

    def write(folder: Path, canary: Path) -> None:
        x, u = symbols()
        if kind == "rootfinder":
            inner = ca.Function("inner", [x, u], [x - u[0]])
            f = ca.Function("step", [x, u], [ca.rootfinder("r", "newton", inner)(x, u)])
            known = "newton"
        elif kind == "linsol":
            f = ca.Function("step", [x, u], [ca.solve(ca.diag(x) + u[0], x, "ldl")])
            known = "ldl"
        else:
            table = ca.interpolant("t", "linear", [[0.0, 1.0, 2.0]], [1.0, 2.0, 3.0])
            f = ca.Function("step", [x, u], [x + table(u[0])])
            known = "linear"
        f.save(str(folder / "step.casadi"))
        text = (folder / "step.casadi").read_text()
        there, wanted = (encoded(word) for word in (known, name))
        (folder / "step.casadi").write_text(text.replace(there, wanted))
        seal(folder)
        library(folder / f"libcasadi_{kind}_{name}.so", canary)

    return write


def encoded(word: str) -> str:
    """Return a word as CasADi writes it: its length and its letters, half bytes as a to p."""
    content = len(word).to_bytes(4, "little") + word.encode()
    return "".join(chr(97 + (b & 15)) + chr(97 + (b >> 4)) for b in content)


def named(text: str) -> Callable[[Path, Path], None]:
    """Return what gives the result a name that would end a comment of C."""

    def write(folder: Path, canary: Path) -> None:
        content = json.loads((folder / "result.json").read_text("utf-8"))
        code = (
            "\n#include <stdio.h>\n__attribute__((constructor)) static void evil(void)"
            f'{{ FILE *g = fopen("{canary}", "w"); if (g) fclose(g); }}\n/*'
        )
        content["case"] = f"{text}{code}"
        (folder / "result.json").write_text(json.dumps(content))

    return write


def in_result(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path, Path], None]:
    """Return what changes a result."""

    def write(folder: Path, canary: Path) -> None:
        content = json.loads((folder / "result.json").read_text("utf-8"))
        change(content)
        text = json.dumps(content).replace("CANARY", str(canary))
        (folder / "result.json").write_text(text)

    return write


CODE = "__import__('pathlib').Path('CANARY').touch()"


#: Modules that reading a case imports, or would.
MODULES = ("numpy", "scipy", "json", "casadi", "pneumo_casadi", "sitecustomize", "h5py")


def modules(folder: Path, canary: Path) -> None:
    """Put modules of known names into the current folder, beside a record in a MAT file."""
    for name in MODULES:
        (folder / f"{name}.py").write_text(f"open({str(canary)!r}, 'w')\nraise ImportError\n")
    (folder / "identify.csv").unlink(missing_ok=True)
    scipy.io.savemat(folder / "identify.mat", {"t_s": np.arange(100.0)})


def pickled_parquet(folder: Path, canary: Path) -> None:
    """Write Parquet whose schema names an extension type with a pickled object."""
    import pyarrow
    import pyarrow.parquet

    metadata = {
        b"ARROW:extension:name": b"arrow.py_extension_type",
        b"ARROW:extension:metadata": pickle.dumps(Payload(canary)),
    }
    field = pyarrow.field("t_s", pyarrow.float64(), metadata=metadata)
    table = pyarrow.table([pyarrow.array([0.0, 1.0])], schema=pyarrow.schema([field]))
    (folder / "identify.csv").unlink()
    pyarrow.parquet.write_table(table, folder / "identify.parquet")


def cached(forge: Callable[[Path, Path, Path], None]) -> Callable[[Path, Path], None]:
    """Return what forges a library in the cache, where a sound one lay."""

    def write(folder: Path, canary: Path) -> None:
        cache = folder.parent / "cache"
        done = run_forked(COMPILED, folder, {"PNEUMO_CASADI_CACHE": str(cache)})
        assert done is not None and done[0] == 0, done
        path = max(cache.glob("*.so"), key=lambda p: p.stat().st_mtime)
        forge(path, folder, canary)

    return write


def replaced(path: Path, folder: Path, canary: Path) -> None:
    """Put a library of one's own with the hash of its content in place."""
    library(folder / "evil.so", canary)
    content = (folder / "evil.so").read_bytes()
    path.write_bytes(content + hashlib.sha256(content).digest())
    path.chmod(0o600)


def linked(path: Path, folder: Path, canary: Path) -> None:
    """Put a link to a library of one's own in place."""
    replaced(folder / "forged.so", folder, canary)
    path.unlink()
    path.symlink_to(folder / "forged.so")


def open_folder(path: Path, folder: Path, canary: Path) -> None:
    """Let others write to the cache, and put a library there."""
    replaced(path, folder, canary)
    path.parent.chmod(0o777)


def swapped(folder: Path, canary: Path) -> None:
    """Make the step a pipe, whose content differs from reading to reading."""
    (folder / "step.casadi").unlink()
    os.mkfifo(folder / "step.casadi")


def pickled_columns(folder: Path, canary: Path) -> None:
    """Write a pickle in place of a record."""
    (folder / "identify.csv").write_bytes(pickle.dumps(Payload(canary)))


def pickled_cells(folder: Path, canary: Path) -> None:
    """Write an array of objects in place of a MAT file."""
    (folder / "identify.csv").unlink()
    with (folder / "identify.mat").open("wb") as file:
        np.save(file, np.array([Payload(canary)], dtype=object), allow_pickle=True)


def attacks() -> Iterator[Attack]:
    """Yield the attacks that would run code."""
    for name, make in {
        "a library": external,
        "a library in a call": nested,
        "a compiler": with_options(jit=True, compiler="shell"),
        "a compiler of derivatives": with_options(
            jacobian_options={
                "jit": True,
                "compiler": "shell",
                "jit_options": {"compiler": "touch CANARY; cc"},
            }
        ),
        "arguments written to a file": with_options(dump_in=True, dump_dir="."),
    }.items():
        read = f"{READ_FUNCTIONS}(f.start, [0, 0]); f.step.jacobian()"
        yield Attack(
            f"functions: {name}",
            functions(make),
            read,
            lambda folder, printed: any(folder.glob("step.0*")),
        )
    for kind, name in (("rootfinder", "evil"), ("linsol", "e"), ("interpolant", "evils")):
        yield Attack(f"functions: {kind} {name}", plugin(kind, name), READ_FUNCTIONS)
    yield Attack("functions: a pipe", swapped, READ_FUNCTIONS)
    for name, text in {
        "the end": "*/",
        "a line continued": "*\\\n/",
        "a trigraph": "*??/\n/",
        "a line end": "\n",
        "a quote": '"; */',
    }.items():
        yield Attack(f"C: {name} of a comment", named(text), COMPILE)
    yield Attack(
        "C: code as unit",
        in_result(lambda c: c["model"]["parameters"]["M"].update(unit="*/ int x; /*")),
        COMPILE,
        lambda folder, printed: (folder / "out").exists(),
    )
    yield Attack(
        "result: an effect", in_result(lambda c: c["model"]["effects"].append(CODE)), READ_MODEL
    )
    yield Attack(
        "result: a form", in_result(lambda c: c["model"]["flow"].update(form=CODE)), READ_MODEL
    )
    yield Attack(
        "result: a parameter",
        in_result(lambda c: c["model"]["parameters"].update({CODE: c["model"]["parameters"]["M"]})),
        READ_MODEL,
    )
    yield Attack(
        "result: a law",
        in_result(lambda c: c["model"]["bench"]["controller"].update(law=CODE)),
        READ_MODEL,
    )
    beside = f"modules {', '.join(MODULES)} beside the records"
    yield Attack(beside, modules, READ_CASE, fresh=True, files=len(MODULES))
    yield Attack("a pickle for a record", pickled_columns, READ_CASE)
    yield Attack("a pickle in a MAT file", pickled_cells, READ_CASE)
    yield Attack("a pickle in a Parquet file", pickled_parquet, READ_CASE)
    yield Attack("cache: a library replaced", cached(replaced), COMPILED)
    yield Attack("cache: a link", cached(linked), COMPILED)
    yield Attack("cache: open to others", cached(open_folder), COMPILED)
