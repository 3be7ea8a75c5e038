"""`import pneumo_casadi as pc`: its names, imported lazily, documented with tested examples."""

import inspect
import json
import subprocess
import sys
from typing import get_args

import pytest

import pneumo_casadi as pc
from pneumo_casadi.cli import options
from pneumo_casadi.design import Criterion
from pneumo_casadi.export import Format
from pneumo_casadi.identification.trajectory_file import RecordSet
from pneumo_casadi.valve import FlowForm

DOCUMENTED = [
    name
    for name in pc.__all__
    if inspect.isfunction(getattr(pc, name)) or inspect.isclass(getattr(pc, name))
]
HEAVY = {"numpy", "casadi", "scipy", "pandas", "matplotlib"}


def loaded(code):
    """Return the heavy modules that a fresh interpreter has loaded after some code."""
    ask = f"{code}\nimport json, sys\nprint(json.dumps(sorted({HEAVY!r} & set(sys.modules))))"
    run = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    return set(json.loads(run.stdout.splitlines()[-1]))


def test_the_import_loads_no_numerical_library():
    assert loaded("import pneumo_casadi as pc; pc.errors.CaseError") == set()
    assert "numpy" in loaded("import pneumo_casadi as pc; pc.Parameter")


def test_help_loads_no_numerical_library():
    assert loaded("from pneumo_casadi.cli import app; app.run(['--help'])") == set()


def test_every_public_name_is_there_and_has_its_source():
    assert {*pc.__all__} <= {*dir(pc)}
    for name in pc.__all__:
        value = getattr(pc, name)
        if inspect.isfunction(value) or inspect.isclass(value):
            assert value.__name__ == name and value.__doc__, name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'identity'"):
        _ = pc.identity


def test_the_namespace_is_small():
    assert len(DOCUMENTED) <= 28 and {*pc.__all__} - {*DOCUMENTED} == {
        "EFFECTS",
        "__version__",
        "plot",
    }


@pytest.mark.parametrize("name", DOCUMENTED)
def test_a_public_name_has_an_example(name):
    assert ">>> " in getattr(pc, name).__doc__, f"{name} has no example"


def test_choices_of_the_command_line_are_those_of_the_library():
    forms = {item.value for item in options.FlowOption} - {"auto"}
    assert forms == {item.value for item in FlowForm}
    assert {*get_args(options.CriterionName)} == {item.value for item in Criterion}
    assert {*get_args(options.RecordSetName)} == {item.value for item in RecordSet}
    assert {*get_args(options.FormatName)} == {item.value for item in Format}


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_shell_completes_commands(shell, monkeypatch):
    script = subprocess.run(
        [sys.executable, "-m", "pneumo_casadi", "--show-completion", shell],
        capture_output=True,
        text=True,
        check=False,
        env={"PATH": "/usr/bin:/bin", "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
    )
    assert script.returncode == 0, script.stderr
    assert "_PNEUMO_CASADI_COMPLETE" in script.stdout


def test_bash_is_offered_the_commands():
    env = {
        "PATH": "/usr/bin:/bin",
        "_PNEUMO_CASADI_COMPLETE": "complete_bash",
        "COMP_WORDS": "pneumo-casadi dia",
        "COMP_CWORD": "1",
    }
    run = subprocess.run(
        [sys.executable, "-m", "pneumo_casadi"],
        capture_output=True,
        text=True,
        env=env,
        check=False,
    )
    assert run.stdout.split() == ["diagnose", "diagnose-many"], run.stderr
