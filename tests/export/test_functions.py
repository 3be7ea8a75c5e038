"""CasADi functions survive their files; files that would run foreign code are refused."""

import hashlib
import json
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.errors import CaseError
from pneumo_casadi.export import read_functions, write_functions
from pneumo_casadi.model.simulation import simulate


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folder with the functions of each model, written once."""
    known = {}

    def folder(model):
        if model.name not in known:
            known[model.name] = tmp_path_factory.mktemp(model.name)
            write_functions(model, known[model.name])
        return known[model.name]

    return folder


@pytest.fixture
def of_force(models, folders, tmp_path):
    """A copy of the functions by force, which may be changed."""
    return shutil.copytree(folders(models["force"]), tmp_path / "force")


@pytest.mark.slow
def test_the_step_gives_the_trajectory_of_the_package(model, inputs, deviation, folders):
    read = read_functions(folders(model))
    u = inputs(model)
    expected = simulate(model.axis, u, model.dt, model.start)
    x = np.hstack([model.start[:, None], read.step.mapaccum(999)(model.start, u[:-1].T).full()])
    y = read.output.map(1000)(x, u.T).full()
    for i, name in enumerate(model.axis.outputs):
        assert deviation(y[i], expected[name]) < 1e-6
    theta = model.axis.parameters.values
    result, wanted = read.rhs(x[:, 500], u[500]), model.axis.rhs(x[:, 500], u[500], theta)
    assert np.allclose(result.full(), wanted.full(), rtol=1e-12, atol=0.0)


def test_the_sidecar_names_what_the_numbers_are(models, folders):
    model = models["effects"]
    read = read_functions(folders(model))
    assert tuple(read.states) == model.axis.states and read.states["hose.q_P"] == "kg/s"
    assert read.inputs == {"u_P": "V", "u_N": "V"}
    assert read.outputs == {"p_P": "Pa", "p_N": "Pa", "x": "m"}
    assert read.dt == model.dt and np.array_equal(read.start, model.start)


def test_casadi_alone_reads_the_files(models, folders):
    step = ca.Function.load(str(folders(models["effects"]) / "step.casadi"))
    assert step.name_in() == ["x", "u"] and step.name_out() == ["x_next"]


def put(folder, name, content):
    """Put a file in place of another and its hash into the sidecar, as a forger would."""
    (folder / name).write_bytes(content)
    sidecar = json.loads((folder / "functions.json").read_text())
    told = sidecar["functions"][name.removesuffix(".casadi")]
    told["sha256"] = hashlib.sha256(content).hexdigest()
    (folder / "functions.json").write_text(json.dumps(sidecar))


def foreign(folder, kind):
    """A function that has the sizes of the step and asks for a library or a compiler."""
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u", 1)
    options = {"compiling": {"jit": True}, "linked": {"jit": True, "jit_serialize": "link"}}
    f = ca.Function("step", [x, u], [x * u], {"compiler": "shell", **options.get(kind, {})})
    if kind in ("library", "nested"):
        code, library = folder / "step.c", folder / "step.so"
        generator = ca.CodeGenerator("step")
        generator.add(f)
        code.write_text(generator.dump())
        subprocess.run(["gcc", "-shared", "-fPIC", str(code), "-o", str(library)], check=True)
        f = ca.external("step", str(library))
    if kind == "nested":
        x, u = ca.MX.sym("x", 2), ca.MX.sym("u", 1)
        f = ca.Function("step", [x, u], [f(x, u)])
    f.save(str(folder / "foreign"))
    return (folder / "foreign").read_bytes()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler to make a forgery with")
@pytest.mark.parametrize("kind", ["library", "nested", "compiling", "linked"])
def test_a_file_that_would_run_foreign_code_is_not_read(
    of_force, kind, monkeypatch, tmp_path_factory
):
    monkeypatch.chdir(of_force)  # where CasADi's compiler leaves its scratch files
    put(of_force, "step.casadi", foreign(tmp_path_factory.mktemp("foreign"), kind))

    def deserialize(text):
        raise AssertionError("CasADi was given the file")

    monkeypatch.setattr(ca, "StringDeserializer", deserialize)
    with pytest.raises(CaseError, match=r"step\.casadi: asks for a library or a compiler"):
        read_functions(of_force)


def test_a_changed_or_damaged_file_is_refused(of_force):
    whole = (of_force / "rhs.casadi").read_bytes()
    (of_force / "rhs.casadi").write_bytes(whole[:-2])
    with pytest.raises(CaseError, match=r"rhs\.casadi: not the file that functions\.json"):
        read_functions(of_force)
    put(of_force, "rhs.casadi", b"import os")
    with pytest.raises(CaseError, match=r"rhs\.casadi: no file of CasADi functions"):
        read_functions(of_force)
    (of_force / "rhs.casadi").unlink()
    with pytest.raises(CaseError, match=r"rhs\.casadi: no such file; export again"):
        read_functions(of_force)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "something"}, "not a sidecar"),
        ({"states": ["x", "v"]}, "not a sidecar"),
        ({"states": {"x": 1, "v": 2}}, "`states.x`: expected text, got 1"),
        ({"sampling": {"dt_s": -1.0}}, "`sampling.dt_s`: expected a number > 0.0, got -1.0"),
        ({"functions": {}}, "`functions.rhs`: expected a JSON object"),
        ({"inputs": {"F": "N", "G": "N"}}, r"sizes of x, u and result are \[2, 1, 2\]"),
    ],
)
def test_a_sidecar_that_does_not_fit_is_refused(of_force, change, message):
    path = of_force / "functions.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(CaseError, match=message) as caught:
        read_functions(of_force)
    assert str(of_force) in str(caught.value)
