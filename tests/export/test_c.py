"""The C code compiles without a warning and gives the package's own trajectory."""

import io
import shutil
import subprocess

import numpy as np
import pandas as pd
import pytest

from pneumo_casadi.errors import CaseError
from pneumo_casadi.export import IdentifiedModel, write_c
from pneumo_casadi.export.c_code import c_sources
from pneumo_casadi.model.simulation import simulate

CC = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(CC is None, reason="no C compiler on this machine")
STRICT = ("-std=c99", "-Wall", "-Werror", "-pedantic", "-O1")


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """Path of the compiled example of each model, made once."""
    known = {}

    def path(model):
        if model.name not in known:
            known[model.name] = built(model, tmp_path_factory.mktemp(model.name))
        return known[model.name]

    return path


def built(model, folder):
    write_c(model, folder)
    command = [CC, *STRICT, "axis.c", "main.c", "-o", "simulate", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "simulate"


def table(model, u):
    units = model.units["inputs"]
    columns = {f"{name}_{units[name]}": u[:, i] for i, name in enumerate(units)}
    return pd.DataFrame({"t_s": model.dt * np.arange(len(u))} | columns)


def run(program, frame, *motion):
    path = program.with_name("inputs.csv")
    frame.to_csv(path, index=False, float_format="%.17g")
    command = [str(program), str(path), *(repr(float(value)) for value in motion)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
@needs_compiler
def test_compiled_c_gives_the_trajectory_of_the_package(model, inputs, deviation, programs):
    u, motion = inputs(model), model.start[: len(model.axis.motion_states)] * 1.01
    done = run(programs(model), table(model, u), *motion)
    assert done.returncode == 0, done.stderr
    result = pd.read_csv(io.StringIO(done.stdout))
    expected = simulate(model.axis, u, model.dt, motion)
    assert list(result) == ["t_s", *(f"{n}_{unit}" for n, unit in model.units["outputs"].items())]
    for name, unit in model.units["outputs"].items():
        assert deviation(result[f"{name}_{unit}"], expected[name]) < 1e-6


@pytest.mark.slow
@needs_compiler
def test_a_stiff_axis_takes_the_same_steps_between_samples(models, inputs, deviation, tmp_path):
    stiff = models["nominal"].axis.with_parameters({"v_s": 1e-4})
    model = IdentifiedModel(stiff, 1e-3)
    assert model.substeps > 1
    u = inputs(model)
    done = run(built(model, tmp_path), table(model, u))
    expected = simulate(stiff, u, model.dt, model.start[:4])
    result = pd.read_csv(io.StringIO(done.stdout))
    assert deviation(result["x_m"], expected["x"]) < 1e-6


@pytest.mark.slow
@needs_compiler
def test_the_example_says_which_line_it_cannot_use(models, inputs, programs):
    model = models["effects"]
    program = programs(model)
    frame = table(model, inputs(model)).iloc[:5]
    done = run(program, frame.rename(columns={"u_P_V": "u"}))
    assert done.returncode == 2 and "line 1: expected t_s,u_P_V,u_N_V" in done.stderr
    done = run(program, frame.astype(object).replace(frame.iloc[2, 1], "fast"))
    assert done.returncode == 2 and "line 4: expected numbers" in done.stderr
    done = run(program, frame.iloc[[0, 2, 1]])
    assert done.returncode == 2 and "line 4: time does not rise" in done.stderr


def test_the_header_names_all_quantities_with_units(models, tmp_path):
    write_c(models["effects"], tmp_path)
    text = (tmp_path / "axis.h").read_text("utf-8")
    for letter, kind in (("x", "states"), ("u", "inputs"), ("y", "outputs"), ("p", "parameters")):
        for i, (name, unit) in enumerate(models["effects"].units[kind].items()):
            assert f"{letter}[{i}]  {name} [{unit}]" in text


def test_the_code_holds_the_inputs_that_go_with_the_start(made):
    sources = c_sources(IdentifiedModel(made.supplied_axis(), 1e-3))
    at_rest = f"inputs_at_rest[AXIS_NU] = {{0.0, 0.0, {made.P_SUPPLY!r}}}"
    assert at_rest in sources["axis.c"]
    assert "extern const double axis_inputs_at_rest[AXIS_NU]" in sources["axis.h"]


def test_other_files_in_the_folder_stay(models, tmp_path):
    (tmp_path / "controller.c").write_text("mine")
    write_c(models["force"], tmp_path)
    first = (tmp_path / "axis.c").read_text("utf-8")
    write_c(models["force"], tmp_path)
    assert (tmp_path / "controller.c").read_text() == "mine"
    assert "CasADi" in first and (tmp_path / "axis.c").read_text("utf-8") == first
    files = {"controller.c", "axis.c", "axis.h", "main.c", ".pneumo_casadi.json"}
    assert {p.name for p in tmp_path.iterdir()} == files
    (tmp_path / "axis.c").write_text("mine too")
    with pytest.raises(CaseError, match=r"axis.c: was changed"):
        write_c(models["force"], tmp_path)
    assert (tmp_path / "axis.c").read_text() == "mine too"
