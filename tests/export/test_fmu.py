"""The FMU is valid and simulates in fmpy as the package does."""

import importlib.util
import io
import shutil
import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from pneumo_casadi.errors import MissingExtraError
from pneumo_casadi.export import IdentifiedModel, write_fmu
from pneumo_casadi.export.fmi_xml import model_description
from pneumo_casadi.export.fmu import fmu_files
from pneumo_casadi.model.simulation import simulate

fmpy = pytest.importorskip("fmpy", reason="needs the extra `export` (fmpy)")
validation = pytest.importorskip("fmpy.validation")
needs_compiler = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="no C compiler: the FMU has no binary"
)


@pytest.fixture(scope="module")
def fmus(models, tmp_path_factory):
    """Path of the FMU of each model, made once."""
    made = {}

    def path(model):
        if model.name not in made:
            made[model.name] = str(write_fmu(model, tmp_path_factory.mktemp(model.name)))
        return made[model.name]

    return path


def signals(model, u):
    dtype = [("time", float), *((name, float) for name in model.axis.inputs)]
    computed = np.zeros(len(u), dtype=dtype)
    computed["time"] = model.dt * np.arange(len(u))
    for i, name in enumerate(model.axis.inputs):
        computed[name] = u[:, i]
    return computed


def stepped(path, model, u, **start_values):
    names = [*model.axis.outputs, *(f"state.{name}" for name in model.axis.states)]
    return fmpy.simulate_fmu(
        path,
        fmi_type="CoSimulation",
        start_time=0.0,
        stop_time=model.dt * (len(u) - 1),
        output_interval=model.dt,
        input=signals(model, u),
        output=names,
        start_values=start_values,
    )


@pytest.mark.slow
def test_the_description_is_valid(model, fmus):
    assert validation.validate_fmu(fmus(model)) == []
    read = fmpy.read_model_description(fmus(model), validate=True, validate_model_structure=True)
    assert read.fmiVersion == "3.0" and read.coSimulation and read.modelExchange
    starts = {v.name: float(v.start) for v in read.modelVariables if v.causality == "parameter"}
    assert starts == model.axis.parameters.as_dict()


@pytest.mark.slow
@needs_compiler
def test_co_simulation_gives_the_trajectory_of_the_package(model, fmus, inputs, deviation):
    u = inputs(model)
    result = stepped(fmus(model), model, u)
    expected = simulate(model.axis, u, model.dt, model.start[: len(model.axis.motion_states)])
    for name in model.axis.outputs:
        assert deviation(result[name], expected[name]) < 1e-6
    for name, values in zip(model.axis.states, expected.x, strict=True):
        if np.ptp(values) > 0:
            assert deviation(result[f"state.{name}"], values) < 1e-6


@pytest.mark.slow
@needs_compiler
def test_model_exchange_gives_the_same_motion_to_an_integrator(models, fmus, made, deviation):
    model = models["spline"]
    given = dict(zip(model.axis.inputs, (0.5, -0.4), strict=True))
    result = fmpy.simulate_fmu(
        fmus(model),
        fmi_type="ModelExchange",
        stop_time=0.2,
        output_interval=1e-3,
        relative_tolerance=1e-10,
        start_values=given,
        output=list(model.axis.outputs),
    )
    x = made.steps(model.axis, np.tile([0.5, -0.4], (len(result), 1)), model.start)
    for name in model.axis.outputs:
        assert deviation(result[name], x[model.axis.states.index(name)]) < 1e-6


@pytest.mark.slow
@needs_compiler
def test_parameters_and_start_can_be_set(models, fmus, inputs, deviation):
    model = models["effects"]
    heavier = model.axis.with_parameters({"M": 25.0, "valve_dynamics.tau": 5e-3})
    motion = [3.5e5, 4.8e5, 0.02, 0.1]
    names = [f"state.{name}" for name in model.axis.motion_states]
    changed = {"M": 25.0, "valve_dynamics.tau": 5e-3} | dict(zip(names, motion, strict=True))
    u = inputs(model)
    result = stepped(fmus(model), model, u, **changed)
    # The states of effects, which nobody has set, start at rest with motion and first input.
    assert deviation(result["x"], simulate(heavier, u, model.dt, motion)["x"]) < 1e-6


@pytest.mark.slow
@needs_compiler
def test_its_state_can_be_taken_and_given_back(models, fmus, tmp_path):
    model = models["effects"]
    path = fmus(model)
    folder = fmpy.extract(path, str(tmp_path))
    read = fmpy.read_model_description(path)
    by_name = {v.name: v.valueReference for v in read.modelVariables}
    fmu = fmpy.instantiate_fmu(folder, read, "CoSimulation")
    try:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.setFloat64([by_name["u_P"]], [0.4])
        fmu.doStep(0.0, 0.01)
        saved = fmu.getFMUState()
        kept = fmu.deserializeFMUState(fmu.serializeFMUState(saved))
        ends = []
        for state in (saved, kept):
            fmu.setFMUState(state)
            fmu.doStep(0.01, 0.05)
            ends.append(fmu.getFloat64([by_name["x"]])[0])
            fmu.freeFMUState(state)
        assert ends[0] == ends[1] != 0.0
        with pytest.raises(fmpy.fmi1.FMICallException):
            fmu.doStep(0.06, -0.01)
    finally:
        fmu.freeInstance()


@pytest.mark.slow
def test_equal_models_give_equal_files(models, fmus, tmp_path):
    model = models["force"]
    assert write_fmu(model, tmp_path).read_bytes() == Path(fmus(model)).read_bytes()


@pytest.mark.slow
@needs_compiler
def test_the_sources_compile_as_the_build_description_says(models, fmus, tmp_path):
    path = fmus(models["spline"])
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    build = fmpy.model_description.read_build_description(path, validate=True)
    (configuration,) = build
    (files,) = configuration.sourceFileSets
    command = ["gcc", "-std=c99", "-Wall", "-Werror", "-fPIC", "-shared", *files.sourceFiles]
    done = subprocess.run(
        [*command, "-o", "axis.so", "-lm"],
        cwd=tmp_path / "sources",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_without_a_compiler_the_sources_remain_and_it_is_said(
    models, tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr("pneumo_casadi.export.fmu.compiler", lambda: None)
    path = write_fmu(models["force"], tmp_path)
    with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
        names = archive.namelist()
    assert "sources/axis.c" in names and not [n for n in names if n.startswith("binaries/")]
    assert "holds sources only" in caplog.text
    assert validation.validate_fmu(str(path)) == []


def test_without_fmpy_the_message_names_the_extra(models, tmp_path, monkeypatch):
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "fmpy" else find_spec(name)
    )
    with pytest.raises(MissingExtraError, match=r"pneumo-casadi\[export\]"):
        write_fmu(models["force"], tmp_path)
    assert not list(tmp_path.iterdir())


def test_outputs_do_not_claim_to_hang_on_inputs(models, fmus):
    read = fmpy.read_model_description(fmus(models["spline"]))
    inputs = {v.name for v in read.modelVariables if v.causality == "input"}
    for unknown in read.outputs:
        assert not inputs & {v.name for v in unknown.dependencies}
    (p_P,) = [u for u in read.derivatives if u.variable.name == "der(state.p_P)"]
    assert "u_P" in {v.name for v in p_P.dependencies}
    assert "u_N" not in {v.name for v in p_P.dependencies}


def test_a_supply_pressure_that_nobody_connects_is_that_of_the_bench(made):
    model = IdentifiedModel(made.supplied_axis(), 1e-3)
    found = ET.fromstring(model_description(model, "token"))
    starts = {v.get("name"): v.get("start") for v in found.iter("Float64")}
    given = {name: float(starts[name]) for name in model.axis.inputs}
    assert given == {"u_P": 0.0, "u_N": 0.0, "p_supply": made.P_SUPPLY}
    (source,) = (text for name, text in fmu_files(model).items() if name.endswith("fmi3.c"))
    assert "memcpy(axis->now.u, axis_inputs_at_rest" in source
