"""Fixtures shared by all tests."""

import importlib.util
import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

# Machines are noisy: how long one example takes says nothing of what it claims.
settings.register_profile("claims", deadline=None)
settings.load_profile("claims")

# Tests share the processors: threads of linear algebra besides only wait for each other, and a
# product of small matrices takes a hundred times as long. They are counted when NumPy is loaded.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the development data, named by PNEUMO_CASADI_DATA."""
    folder = os.environ.get("PNEUMO_CASADI_DATA")
    if not folder:
        pytest.skip("PNEUMO_CASADI_DATA is not set: no development data")
    return Path(folder)


@pytest.fixture(scope="session")
def script():
    """Return a function that loads a script as a module, with those beside it importable."""

    def load(path):
        spec = importlib.util.spec_from_file_location(f"script_{path.stem}", path)
        module = importlib.util.module_from_spec(spec)
        sys.path.insert(0, str(path.parent))
        try:
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(path.parent))
        return module

    return load


@pytest.fixture(scope="session")
def made(script):
    """Module with small axes of known truth: tests need no import from each other."""
    return script(Path(__file__).parent / "model" / "made.py")


def svg(figure):
    """Return no drawing in the place of `style.svg`, whose name tells the file."""
    return b'<svg width="9pt" height="9pt"></svg>'


@pytest.fixture(scope="session")
def no_svg():
    """Return what stands for `style.svg` where a drawing of each figure is enough."""
    return svg


@pytest.fixture(scope="session")
def made_case(tmp_path_factory):
    """Return a function that records a case with hidden effects at 1 kHz, two seconds held out."""
    pytest.importorskip("numba")
    from pneumo_casadi.virtual_bench import make_case

    known = {}

    def make(seed, duration=4.0, **effects):
        key = (seed, duration, repr(sorted(effects.items())))
        if key not in known:
            folder = tmp_path_factory.mktemp("bench") / "case"
            case = make_case(folder, seed, effects, duration=duration).case
            held_out = tuple(record.window(0.0, 2.2) for record in case.validate)
            known[key] = replace(case, validate=held_out)
        return known[key]

    return make
