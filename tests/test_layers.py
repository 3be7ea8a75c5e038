"""The layers of the package, read from its source: who may import whom."""

import ast
from pathlib import Path

import pneumo_casadi

PACKAGE = Path(pneumo_casadi.__file__).parent
SOURCES = sorted(PACKAGE.rglob("*.py"))
LAYERS = [
    ["errors", "progress", "threads", "whole_file"],
    ["parameters"],
    ["recording"],
    ["testbed"],
    ["filtering"],
    ["flow"],
    ["effect"],
    ["effects"],
    ["balances"],
    ["axis"],
    ["servosystem"],
    ["compilation"],
    ["integration", "sampled", "simulation"],
    ["long_run"],
    ["statistics"],
    ["regression"],
    ["output_error"],
    ["uncertainty"],
    ["validation"],
    ["design"],
    ["flow_sensitivity"],
    ["caveats", "pipeline", "model_file", "result_file", "trajectory_file"],
    ["diagnosis"],
    ["batch", "withheld"],
    ["export"],
    ["report"],
    [
        "terminal",
        "batch_command",
        "bench_command",
        "design_command",
        "diagnose_command",
        "export_command",
        "withheld_command",
    ],
    ["cli", "__main__"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}


def layer_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    """Dotted names of the modules that a module imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            whole = node.module == "pneumo_casadi"
            found |= (
                {f"{node.module}.{alias.name}" for alias in node.names}
                if whole
                else {node.module or ""}
            )
    return found


def own_layers(path: Path) -> set[str]:
    names = {name.split(".")[1] for name in imports(path) if name.startswith("pneumo_casadi.")}
    return names - {"__version__"}


def test_every_module_belongs_to_a_layer():
    layers = {layer_of(path) for path in SOURCES} - {"__init__"}
    assert layers <= RANK.keys(), f"no layer is known for {layers - RANK.keys()}"


def test_a_module_imports_only_from_its_layer_and_those_before_it():
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in SOURCES
        if layer_of(path) != "__init__"
        for name in own_layers(path)
        if RANK.get(name, len(LAYERS)) > RANK.get(layer_of(path), 0)
    ]
    assert not wrong, wrong


def test_only_the_report_imports_matplotlib():
    users = {
        layer_of(path)
        for path in SOURCES
        if any(name.split(".")[0] == "matplotlib" for name in imports(path))
    }
    assert users <= {"report"}


def test_effects_know_nothing_of_the_model():
    allowed = {"effects", "effect", "flow", "parameters", "errors"}
    wrong = {
        path.name: own_layers(path) - allowed for path in SOURCES if layer_of(path) == "effects"
    }
    assert not any(wrong.values()), wrong


def test_the_model_names_no_effect():
    model = [path for path in SOURCES if layer_of(path) in {"balances", "servosystem"}]
    assert not [path.name for path in model if "effects" in own_layers(path)]


def test_the_bench_knows_nothing_of_the_model():
    allowed = {"testbed", "recording", "parameters", "errors"}
    bench = [path for path in SOURCES if layer_of(path) == "testbed"]
    assert bench
    wrong = {path.name: own_layers(path) - allowed for path in bench}
    assert not any(wrong.values()), wrong
    assert not [path.name for path in bench if any(n.startswith("casadi") for n in imports(path))]


def test_the_library_never_prints():
    printing = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert not printing, printing
