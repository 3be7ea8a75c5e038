"""The page on data of one's own: every block runs, every field of a bench is named and needed."""

import importlib.util
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io

from pneumo_casadi.data import read_bench, read_case
from pneumo_casadi.data.bench.bench_file import BENCH_KEYS
from pneumo_casadi.data.bench.bench_sections import (
    CONTROLLERS,
    LOAD_KEYS,
    NOISE_KEYS,
    VALVE_KEYS,
)
from pneumo_casadi.data.readers.units import SI_FACTORS
from pneumo_casadi.data.recording.channels import UNITS, column_name

_spec = importlib.util.spec_from_file_location("guide", Path(__file__).with_name("guide.py"))
guide = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(guide)

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "how_to" / "your_data.md"


def logged(record):
    """Return a record as the page's logger writes it: bar gauge, mm from the end, one command."""
    return pd.DataFrame(
        {
            "ms": np.round(1e3 * (record.t - record.t[0]), 3),
            "valve": record["u_P"].round(4),
            "pA": (record["p_P"] / 1e5 - 1).round(5),
            "pB": (record["p_N"] / 1e5 - 1).round(5),
            "pos": (1e3 * record["x"] + 250).round(3),
            "ref": (1e3 * record["x_ref"] + 250).round(4),
        }
    )


@pytest.fixture(scope="module")
def logs(embedded, tmp_path_factory):
    """Folder with the files that the page begins with, cut from the embedded record."""
    folder = tmp_path_factory.mktemp("logs")
    case = read_case(embedded, check=False)
    commands = ("u_P", "u_N")
    first = case.identify[0].window(10.0, 14.0).decimate(5, commands)
    logged(first).to_csv(folder / "run_1.csv", index=False)
    held_out = case.validate[0].window(8.0, 10.0).decimate(5, commands)
    logged(held_out).to_csv(folder / "run_2.csv", index=False)
    pressures = {"A": first["p_P"] / 1e5, "B": first["p_N"] / 1e5}
    late = {"t": first.t, "u": np.roll(first["u_P"], 1), "x": first["x"], "ref": first["x_ref"]}
    scipy.io.savemat(folder / "run_3.mat", {"log": late | {"p": pressures}})
    table = pd.read_csv(embedded / "flow_map.csv")
    litres = (table["q_m_kg_per_s"] / 1.185 * 60e3).round(6)
    valve = {"u": table["u_V"], "bar": table["p_Pa"] / 1e5 - 1, "litres": litres}
    pd.DataFrame(valve).to_csv(folder / "valve.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def ran(logs):
    with pytest.MonkeyPatch.context() as patch:  # no figures: they have tests of their own
        for module in ("pages.drawing", "interactive.time_plot"):
            patch.setattr(f"pneumo_casadi.report.{module}.find_spec", lambda name: None)
        return guide.run(PAGE, logs)


@pytest.mark.slow
def test_every_block_runs_and_the_axis_is_identified(ran, logs):
    result = json.loads((logs / "report" / "my_axis" / "result.json").read_text("utf-8"))
    assert result["output_error"]["status"] == "converged"
    assert result["output_error"]["parameters"]["M"]["value"] == pytest.approx(16.9, rel=0.01)
    assert (logs / "report" / "my_axis" / "report.html").is_file()


@pytest.mark.slow
def test_the_late_command_was_brought_back(ran):
    first, second = ran["case"].identify[0], ran["on_time"]
    assert np.abs(first["u_P"][: second.N] - second["u_P"]).max() < 1e-4
    assert np.abs(first["p_P"][: second.N] - second["p_P"]).max() < 1.0


def test_the_log_shown_is_the_beginning_of_the_file(logs):
    lines = (logs / "run_1.csv").read_text("utf-8").splitlines()
    shown = next(block.text for block in guide.blocks(PAGE) if block.text.startswith("ms,"))
    assert shown.splitlines() == lines[:2]


@pytest.mark.slow
def test_the_bench_shown_is_minimal_but_for_what_is_called_optional(logs, ran):
    path = logs / "my_axis" / "bench.json"
    content = json.loads(path.read_text("utf-8"))
    optional = {"sensor_noise", "datasheet"}
    assert optional < content.keys()
    for key in content:
        less = {name: value for name, value in content.items() if name != key}
        (logs / "less.json").write_text(json.dumps(less), "utf-8")
        if key in optional:
            read_bench(logs / "less.json")
        else:
            with pytest.raises(ValueError, match=f"missing key `{key}`"):
                read_bench(logs / "less.json")
    assert read_bench(logs / "force" / "bench.json").stroke is None


def test_every_field_channel_and_unit_is_named():
    text = PAGE.read_text("utf-8")
    laws = (key for _, *keys in CONTROLLERS.values() for part in keys for key in part)
    fields = {*BENCH_KEYS, *NOISE_KEYS, *LOAD_KEYS, *VALVE_KEYS, *laws}
    assert not [name for name in fields if name not in text]
    assert not [name for name in UNITS if f"`{column_name(name)}`" not in text]
    listed = re.search(r"^Units: (.+?)\.", text, re.MULTILINE | re.DOTALL)[1]
    known = [unit for units in SI_FACTORS.values() for unit in units]
    assert sorted(re.findall(r"[\w/]+", listed)) == sorted(known)
