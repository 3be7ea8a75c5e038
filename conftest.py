"""What tests and the examples of docstrings share."""

import gc
import os
import pickle
import re
import runpy
import signal
import sys

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # before any import of numpy
    os.environ.setdefault(_name, "1")
# What tests compile runs for milliseconds: compiling it quickly saves more than fast code would.
os.environ.setdefault("PNEUMO_CASADI_FLAGS", "-Og -march=native -fno-math-errno -fno-trapping-math")
# Little of what is made here is garbage, and hypothesis is told of every collection.
gc.set_threshold(100_000, 50, 50)

from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
import pytest  # noqa: E402
from filelock import FileLock  # noqa: E402

import pneumo_casadi as pc  # noqa: E402
from pneumo_casadi.valve import choose_flow_form  # noqa: E402

#: Holds a `sitecustomize` that forbids connections to other hosts.
NO_NETWORK = Path(__file__).parent / "tests" / "no_network"


def pytest_configure() -> None:
    """Allow no network, and hear signals as in a terminal.

    What runs in the background may ignore some signals.
    """
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [str(NO_NETWORK), *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    if not hasattr(sys.modules.get("sitecustomize"), "forbid"):  # inherited by this process
        runpy.run_path(str(NO_NETWORK / "sitecustomize.py"))
    usual = {"SIGINT": signal.default_int_handler, "SIGHUP": signal.SIG_DFL}
    for name, handler in usual.items():
        number = getattr(signal, name, None)  # not all are known everywhere
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)


@pytest.fixture(scope="session")
def embedded() -> Path:
    """Folder of the embedded record whose true parameters are known."""
    return pc.data.EXAMPLE


@pytest.fixture(scope="session")
def once_a_run(tmp_path_factory):
    """Return a function that makes a result once for all workers of a run."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:  # each worker has a folder in that of the run
        folder = folder.parent

    def get(name, make):
        path = folder / f"{name}.pickle"
        with FileLock(folder / f"{name}.lock"):
            if not path.exists():
                path.write_bytes(pickle.dumps(make()))
            return pickle.loads(path.read_bytes())

    return get


@pytest.fixture(scope="session")
def demo(once_a_run):
    """Return the identification of the example that the paper's table is compared with."""
    options = pc.IdentifyOptions(pc.valve.FlowForm.POLYNOMIALS, degrees=(7, 7, 4))
    return once_a_run("demo", lambda: pc.identify(pc.example_case(), options))


def _short_example():
    case = pc.example_case()
    fitted, held_out = case.identify[0].window(10.0, 13.0), case.validate[0].window(8.0, 10.0)
    return replace(case, identify=(fitted,), validate=(held_out,))


@pytest.fixture(scope="session")
def quick(once_a_run):
    """Return an identification of a few seconds of record: quick to make, not to be trusted."""

    def make():
        case = replace(pc.example_case(), validate=_short_example().validate)
        return pc.identify(
            case,
            pc.IdentifyOptions(pc.valve.FlowForm.POLYNOMIALS, start=10.0, end=13.0, windows=(0.5,)),
        )

    return once_a_run("quick", make)


@pytest.fixture(scope="session", autouse=True)
def flow_forms_compared_once():
    """Compare the forms of each flow map once: many tests identify on the same one."""
    known = {}

    def choose(table, **options):
        given = (table.u, table.p, table.q_m, np.asarray(table.p_supply))
        key = (*(a.tobytes() for a in given), table.p_ext, *sorted(options.items()))
        if key not in known:
            known[key] = choose_flow_form(table, **options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pneumo_casadi.identification.flow_form.choose_flow_form", choose)
        yield


@pytest.fixture
def without_figures(monkeypatch):
    """Write reports as where matplotlib is not installed: drawing takes longer than most fits."""
    monkeypatch.setattr("pneumo_casadi.report.pages.drawing.find_spec", lambda name: None)


@pytest.fixture
def without_pictures(without_figures, monkeypatch):
    """Write reports without curves to zoom either, as where bokeh is not installed."""
    monkeypatch.setattr("pneumo_casadi.report.interactive.time_plot.find_spec", lambda name: None)


def pdf(figure):
    """Return no drawing in the place of `style.pdf`, whose name tells the file."""
    return b"%PDF-1.4"


@pytest.fixture(autouse=True)
def no_pdf(request, monkeypatch):
    """Draw no PDF but where a test asks for `real_pdf`: it takes longer than both other formats."""
    style = sys.modules.get("pneumo_casadi.report.figures.style")
    if style is not None and "real_pdf" not in request.fixturenames:
        monkeypatch.setattr(style, "pdf", pdf)


@pytest.fixture
def real_pdf():
    """Draw PDF files as users get them."""


@pytest.fixture(scope="session")
def quick_diagnosis(once_a_run):
    """Return a diagnosis of a few seconds of record with two effects."""
    few = {name: pc.EFFECTS[name] for name in ("stribeck", "quadratic_drag")}
    return once_a_run("quick_diagnosis", lambda: pc.diagnose(_short_example(), few))


@pytest.fixture(scope="session")
def quick_comparison(once_a_run, quick):
    """Return the comparison of an identification with itself."""
    return once_a_run("quick_comparison", lambda: pc.compare(quick, quick))


#: Results that examples of docstrings may use by name, with the fixtures that make them.
_EXAMPLE_RESULTS = {
    "result": "quick",
    "diagnosis": "quick_diagnosis",
    "comparison": "quick_comparison",
}


#: Functions whose examples write a report and do not speak of its figures.
_WITHOUT_FIGURES = {"read_comparison", "read_diagnosis"}

#: Functions whose examples take more than a second.
_SLOW_EXAMPLES = {
    *("Comparison", "compare", "design_experiment", "diagnose", "diagnose_many"),
    *("read_comparison", "write_report"),
}


def _results_used(item):
    """Return the names of the shared results that an example reads and does not define."""
    source = "".join(example.source for example in item.dtest.examples)
    return {
        name
        for name in _EXAMPLE_RESULTS
        if re.search(rf"(?<![\w.]){name}\b", source)
        and not re.search(rf"^{name} = ", source, re.MULTILINE)
    }


def pytest_collection_finish():
    """Let the garbage collector pass over what the collection has made: it stays to the end."""
    gc.collect()
    gc.freeze()


def pytest_collection_modifyitems(items):
    """Mark the examples that take more than a second."""
    for item in items:
        if isinstance(item, pytest.DoctestItem):
            described = item.name.rpartition(".")[2]
            if described in _SLOW_EXAMPLES or "diagnosis" in _results_used(item):
                item.add_marker(pytest.mark.slow)


@pytest.fixture(autouse=True)
def names_of_examples(request, doctest_namespace):
    """Give `pc`, and the shared results that an example reads, to the docstrings."""
    if isinstance(request.node, pytest.DoctestItem):
        doctest_namespace["pc"] = pc
        if request.node.name.rpartition(".")[2] in _WITHOUT_FIGURES:
            request.getfixturevalue("without_figures")
        for name in _results_used(request.node):
            doctest_namespace[name] = request.getfixturevalue(_EXAMPLE_RESULTS[name])
