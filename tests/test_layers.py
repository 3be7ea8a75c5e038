"""The layers of the package, read from its source: who may import whom."""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pneumo_casadi

PACKAGE = Path(pneumo_casadi.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
#: Rooms and the modules beside them, from the ground up. Those of one line may use each other.
LAYERS = [
    ["errors"],
    ["parameters"],
    ["runtime"],
    ["data"],
    ["virtual_bench"],
    ["signals"],
    ["valve"],
    ["model"],
    ["effects"],
    ["estimation"],
    ["metrics"],
    ["validation"],
    ["sensitivity"],
    ["identification"],
    ["design"],
    ["diagnosis"],
    ["evaluation"],
    ["export"],
    ["report"],
    ["cli"],
    ["__main__"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
#: What the house may hold before it needs another room.
MOST_TOP_LEVEL_MODULES = 8
MOST_FILES_IN_A_FOLDER = 14


def dotted(path: Path) -> str:
    """Return the dotted name of a module; a package's is that of its folder."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {dotted(path): path for path in SOURCES}


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(path.read_text("utf-8"))


def layer_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def imports(path: Path) -> frozenset[str]:
    """Dotted names of what a module imports, each traced to the module that defines it."""
    names = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {origin(node.module or "", alias.name) for alias in node.names}
    return frozenset(names)


@cache
def origin(module: str, name: str) -> str:
    """Return the module that defines a name which another module or package hands on."""
    if f"{module}.{name}" in MODULES:
        return f"{module}.{name}"
    path = MODULES.get(module)
    if path is None or path.name != "__init__.py":
        return module
    for node in parsed(path).body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return origin(node.module or "", alias.name)
    return module


def own(path: Path) -> set[str]:
    """Modules of this package that a module imports, without the package's name."""
    prefix = f"{pneumo_casadi.__name__}."
    return {name.removeprefix(prefix) for name in imports(path) if name.startswith(prefix)}


def test_every_module_belongs_to_a_layer():
    layers = {layer_of(path) for path in SOURCES} - {"__init__"}
    assert layers == RANK.keys()


def test_a_module_imports_only_from_its_layer_and_those_before_it():
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in SOURCES
        if layer_of(path) != "__init__"
        for name in own(path)
        if RANK[name.split(".")[0]] > RANK[layer_of(path)]
    ]
    assert not wrong, wrong


def test_no_folder_imports_in_a_circle():
    def folder(name: str) -> str:
        return name.rsplit(".", 1)[0] if "." in name else name

    graph: dict[str, set[str]] = defaultdict(set)
    for module, path in MODULES.items():
        if path.name == "__init__.py":
            continue  # it only hands on
        here = folder(module.removeprefix(f"{pneumo_casadi.__name__}."))
        graph[here] |= {folder(name) for name in own(path)} - {here}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(f"folders import in a circle: {error.args[1]}") from None


def test_no_room_is_crowded():
    top = [path.name for path in PACKAGE.glob("*.py")]
    assert len(top) <= MOST_TOP_LEVEL_MODULES, top
    crowded = {
        str(folder.relative_to(PACKAGE)): len(list(folder.glob("*.py")))
        for folder in (PACKAGE, *PACKAGE.rglob("*"))
        if folder.is_dir() and len(list(folder.glob("*.py"))) > MOST_FILES_IN_A_FOLDER
    }
    assert not crowded, crowded


def test_only_the_report_imports_matplotlib():
    users = {
        layer_of(path)
        for path in SOURCES
        if any(name.split(".")[0] == "matplotlib" for name in imports(path))
    }
    assert users <= {"report"}


def test_effects_know_nothing_of_the_model_but_what_an_effect_is():
    base = ("model.effect", "model.junctions", "model.absorption", "model.friction_law")
    allowed = ("effects", *base, "valve", "parameters", "errors")
    wrong = {
        path.name: {name for name in own(path) if not name.startswith(allowed)}
        for path in SOURCES
        if layer_of(path) == "effects"
    }
    assert not any(wrong.values()), wrong


def test_the_model_names_no_effect():
    model = [path for path in SOURCES if layer_of(path) == "model"]
    assert model
    assert not [p.name for p in model if any(n.startswith("effects") for n in own(p))]


def test_the_bench_knows_nothing_of_the_model():
    allowed = ("virtual_bench", "data", "parameters", "errors", "runtime")
    bench = [path for path in SOURCES if layer_of(path) == "virtual_bench"]
    assert bench
    wrong = {
        path.name: {name for name in own(path) if not name.startswith(allowed)} for path in bench
    }
    assert not any(wrong.values()), wrong
    assert not [path.name for path in bench if any(n.startswith("casadi") for n in imports(path))]


def test_the_library_never_prints():
    printing = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in SOURCES
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert not printing, printing
