"""The page on adding an effect: every block runs, the effect found is the one simulated."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from pneumo_casadi.data import FORCE_DRIVEN, PNEUMATIC
from pneumo_casadi.effects import EFFECTS, effect_row
from pneumo_casadi.model.effect import NOMINAL
from pneumo_casadi.model.junctions import JUNCTIONS
from pneumo_casadi.report.tables.effects import effect_markdown

_spec = importlib.util.spec_from_file_location("guide", Path(__file__).with_name("guide.py"))
guide = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(guide)

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "how_to" / "add_an_effect.md"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    return guide.run(PAGE, tmp_path_factory.mktemp("effect"))


@pytest.mark.slow
def test_the_fit_finds_the_effect_that_was_simulated(ran):
    for name, true in (("bellows.k", 300.0), ("bellows.tau", 0.2)):
        value, std = ran["fit"].parameters[name].value, ran["fit"].std(name, robust=True)
        assert abs(value - true) < 4 * std < 0.05 * true, (name, value, std)


@pytest.mark.slow
def test_the_effect_fades_at_rest_and_is_felt_in_motion(ran):
    z, v = ran["run"]["bellows.z"], ran["run"]["v"]
    assert np.abs(z).max() > 9.0  # N, of 300 N/m × 0.2 s times the speed
    _, solved, _ = lsim(([300.0], [1.0, 1 / 0.2]), v, np.arange(v.size) * ran["record"].dt)
    assert np.abs(z - solved).max() < 0.01 * np.abs(z).max()
    rate = np.gradient(z, ran["record"].dt)
    expected = 300.0 * v - z / 0.2
    assert np.abs(rate - expected)[5:-5].max() < 0.05 * np.abs(expected).max()


@pytest.mark.slow
def test_the_example_declares_what_the_catalogue_asks_for(ran):
    effect = ran["Bellows"]
    bellows = effect()
    assert all((bellows.equation, bellows.source, bellows.shows, bellows.separated_by))
    assert set(bellows.confused_with) <= {*EFFECTS, *NOMINAL}
    for item in bellows.parameters:
        assert item.description and item.source and item.value == item.null
        assert np.isfinite([item.lower, item.upper]).all()
    assert any(item.start != item.null for item in bellows.parameters)
    assert bellows.equation in effect_markdown(effect_row(effect))


def test_every_junction_is_told_with_what_passes_and_on_which_axis():
    text = PAGE.read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \| (.*?) ?\| (.*?) ?\|$", text, re.MULTILINE)
    assert [row[0] for row in rows] == list(JUNCTIONS)
    for name, passes, pneumatic, force_driven in rows:
        assert passes.replace("`", "") == JUNCTIONS[name]
        assert (bool(pneumatic), bool(force_driven)) == (
            name in PNEUMATIC.junctions,
            name in FORCE_DRIVEN.junctions,
        )


def test_the_files_and_commands_of_the_catalogue_are_there():
    root = PAGE.parents[2]
    text = PAGE.read_text("utf-8")
    assert (root / "pneumo_casadi/effects/__init__.py").is_file()
    for name in re.findall(r"tests/[\w/]+(?:\.py)?", text):
        assert (root / name).exists(), name
    line = "from pneumo_casadi.effects.load.spring_load import SpringLoad as SpringLoad"
    index = (root / "pneumo_casadi/effects/__init__.py").read_text("utf-8")
    assert (
        line in index
        and line.replace("spring_load", "bellows").replace("SpringLoad", "Bellows") in text
    )
