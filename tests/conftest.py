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


#: What stands for a figure where none is looked at, by the format that draws it.
BLANK = {
    "svg": b'<svg width="9pt" height="9pt"></svg>',
    "png": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\4\0\0\0\2\0",
    "pdf": b"%PDF-1.4",
}


@pytest.fixture(scope="session")
def leave_blank():
    """Return a function that leaves the figures of some formats blank, as long as a patch lasts."""

    def leave(patch, *formats):
        for name in formats:

            def draw(figure, content=BLANK[name]):
                return content

            draw.__name__ = name  # it tells the suffix of the file
            patch.setattr(f"pneumo_casadi.report.figures.style.{name}", draw)
            if name == "png":
                patch.setattr("pneumo_casadi.report.pages.identification_figures.png", draw)

    return leave


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
