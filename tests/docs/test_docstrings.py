"""What a package exports is described: arguments, results and errors, as in its signature."""

import ast
import enum
import importlib
import inspect
import pkgutil
import re
import textwrap
from typing import Protocol

import pneumo_casadi
from pneumo_casadi import errors
from pneumo_casadi.errors import ModelError

PACKAGES = {
    info.name: module
    for info in pkgutil.walk_packages(pneumo_casadi.__path__, "pneumo_casadi.")
    if info.ispkg and hasattr(module := importlib.import_module(info.name), "__all__")
}
EXPORTED = {
    f"{package}.{name}": getattr(module, name)
    for package, module in PACKAGES.items()
    for name in module.__all__
    if inspect.isclass(getattr(module, name)) or inspect.isroutine(getattr(module, name))
}
ERRORS = {name for name, item in vars(errors).items() if inspect.isclass(item)}
SECTION = re.compile(r"^([A-Z][A-Za-z ]+)\n-{3,}$", re.MULTILINE)
#: Summaries that tell the result.
TELLS = re.compile(r"(Return|Yield|Tell)s? ")


def sections(item):
    """Return the parts of a docstring of its own, by heading; the first has none."""
    own = item.__dict__.get("__doc__") if inspect.isclass(item) else item.__doc__
    parts = SECTION.split(inspect.cleandoc(own or ""))
    return dict(zip(["", *parts[1::2]], parts[::2], strict=True))


def described(item):
    """Return the names that stand in the section of parameters."""
    lines = sections(item).get("Parameters", "").splitlines()
    heads = [line.split(" : ")[0] for line in lines if line[:1].strip()]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def arguments(item):
    """Return the arguments of a function, or of what makes an object of a class."""
    if inspect.isclass(item) and issubclass(item, enum.Enum | Warning | Protocol):
        return {}
    known = inspect.signature(item).parameters
    return {
        name: parameter.annotation for name, parameter in known.items() if not name.startswith("_")
    }


def speaks(annotation):
    """Tell whether a type is a class of the package, which is described in its own place."""
    return inspect.isclass(annotation) and annotation.__module__.startswith("pneumo_casadi")


def raised(item):
    """Return the errors of the package that a function, or the making of an object, names."""
    top = ast.parse(textwrap.dedent(inspect.getsource(item))).body[0]
    bodies = (
        [node for node in top.body if getattr(node, "name", "") in ("__init__", "__post_init__")]
        if isinstance(top, ast.ClassDef)
        else [top]
    )
    calls = [
        node.exc.func if isinstance(node.exc, ast.Call) else node.exc
        for body in bodies
        for node in ast.walk(body)
        if isinstance(node, ast.Raise)
    ]
    return {call.id for call in calls if isinstance(call, ast.Name)} & ERRORS


def missing(item):
    """Return what the docstring of a class or function leaves out."""
    parts, text, known = sections(item), item.__doc__ or "", arguments(item)
    lacks = [
        f"argument {name}"
        for name, kind in known.items()
        if not speaks(kind) and not re.search(rf"\b{name}\b", text)
    ]
    lacks += [f"{name}, which is no argument" for name in described(item) if name not in known]
    lacks += [f"error {name}" for name in sorted(raised(item)) if name not in text]
    if inspect.isroutine(item):
        result = inspect.signature(item).return_annotation
        nothing = result is None or result is inspect.Signature.empty
        told = {"Returns", "Yields"} & parts.keys() or TELLS.match(parts[""])
        if not (nothing or speaks(result) or told):
            lacks.append("result")
    return lacks


def members(item):
    """Return functions and properties that a class defines for others to use, by name."""
    plain = {
        name: getattr(value, "__func__", getattr(value, "fget", getattr(value, "func", value)))
        for name, value in vars(item).items()
        if not name.startswith("_") and not isinstance(value, type)
    }
    return {name: value for name, value in plain.items() if inspect.isfunction(value)}


def test_every_package_and_what_it_exports_has_a_summary():
    items = {**PACKAGES, **EXPORTED}
    for name, item in EXPORTED.items():
        protocol = inspect.isclass(item) and getattr(item, "_is_protocol", False)
        if inspect.isclass(item) and not protocol:
            items |= {f"{name}.{member}": value for member, value in members(item).items()}
    assert len(items) > 300
    silent = [name for name, item in items.items() if not sections(item)[""].strip()]
    assert not silent, silent


def test_arguments_results_and_errors_are_described():
    lacking = {name: missing(item) for name, item in EXPORTED.items()}
    assert not {name: lacks for name, lacks in lacking.items() if lacks}


def test_a_docstring_that_leaves_something_out_is_noticed():
    def halve(x, n) -> float:
        """Halve a number.

        Parameters
        ----------
        x, m : float
            Number [1].
        """
        if not n:
            raise ModelError("n is zero")
        return x / 2

    assert missing(halve) == [
        "argument n",
        "m, which is no argument",
        "error ModelError",
        "result",
    ]
