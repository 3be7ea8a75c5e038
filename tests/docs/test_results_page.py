"""The page on results: its commands and Python run, its table of limits is that of the package."""

import importlib
import importlib.util
import json
import re
from math import isfinite
from pathlib import Path

import pytest

import pneumo_casadi as pc
from pneumo_casadi.identification.warnings import LIMITS

_spec = importlib.util.spec_from_file_location("guide", Path(__file__).with_name("guide.py"))
guide = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(guide)

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "how_to" / "results.md"


#: The module; as an attribute of its package the name is the function's.
COMPARE = importlib.import_module("pneumo_casadi.identification.compare")


def cache_first(function):
    """Return a function that computes its first result only, and gives that ever after."""
    results = []

    def call(*given):
        if not results:
            results.append(function(*given))
        return results[0]

    return call


def limits():
    """Return the table of limits as the page shows it."""
    rows = ["| quantity | note | caution | severe |", "| --- | --- | --- | --- |"]
    for limit in LIMITS.values():
        sizes = (limit.note, limit.caution, limit.severe)
        shown = " | ".join(f"{size:.3g}" if isfinite(size) else "" for size in sizes)
        rows.append(f"| {limit.quantity} | {shown} |")
    return "\n".join(re.sub(r" +\|", " |", row) for row in rows)


def test_the_table_of_limits_is_that_of_the_package():
    (shown,) = re.findall(r"<!-- table: limits -->\n(.*?)\n<!-- end -->", PAGE.read_text(), re.S)
    assert shown == limits()


@pytest.mark.slow
def test_the_page_runs(without_pictures, tmp_path, monkeypatch):
    pytest.importorskip("numba")
    # The command and the function compare the same two results: they are simulated once.
    monkeypatch.setattr(COMPARE, "_simulate_all", cache_first(COMPARE._simulate_all))
    # Less of a record than users get: what is claimed is that the blocks work together.
    whole = pc.make_case
    monkeypatch.setattr(
        pc,
        "make_case",
        lambda *given, **options: whole(*given, **options | {"duration": 0.75, "fs": 500.0}),
    )
    names = guide.run(PAGE, tmp_path)
    assert names["nominal"].usability.usable.value in ("yes", "with care")
    result = json.loads((tmp_path / "report/stribeck/result.json").read_text("utf-8"))
    assert result["output_error"]["parameters"]["M"] == {
        "value": 13.26,
        "std": None,
        "std_robust": None,
        "unit": "kg",
        "note": "held fixed",
        "status": "held",
    }
    compared = json.loads((tmp_path / "compared.json").read_text("utf-8"))
    assert len(compared["simulations"]) == 4
