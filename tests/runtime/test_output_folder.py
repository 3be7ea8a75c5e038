"""What users put into output folders stays theirs."""

import json
from pathlib import Path

import pytest

from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.output_folder import (
    MANIFEST,
    OutputKind,
    check_replaceable,
    check_result_file,
    claim_names,
    output_folder,
    write_files,
)

KIND, OTHER = OutputKind.IDENTIFICATION, OutputKind.DESIGN


def write(folder, kind=KIND, **files):
    with output_folder(folder, kind) as draft:
        (draft / "figures").mkdir()
        (draft / "figures" / "flow.png").write_text(str(kind))
        for name, content in files.items():
            (draft / f"{name}.txt").write_text(content)


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_text() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
        if path.name != MANIFEST
    }


def test_an_output_is_replaced_by_one_of_its_kind_and_additions_stay(tmp_path):
    folder = tmp_path / "report"
    write(folder, table="old", gone="old")
    (folder / "figures" / "mine.svg").write_text("drawn for hours")
    (folder / "notes").mkdir()
    (folder / "notes" / "thesis.tex").write_text("years of work")
    (folder / "empty").mkdir()
    (folder / "link").symlink_to("notes")
    write(folder, table="new")
    assert contents(folder) == {
        "empty": None,
        "figures": None,
        "figures/flow.png": "identification",
        "figures/mine.svg": "drawn for hours",
        "link": None,
        "notes": None,
        "notes/thesis.tex": "years of work",
        "table.txt": "new",
    }
    assert (folder / "link").readlink() == Path("notes")
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_every_other_folder_is_refused_by_name(tmp_path):
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "thesis.tex").write_text("years of work")
    with pytest.raises(CaseError, match=r"report: holds thesis.tex and no earlier identification"):
        write(folder)
    (folder / "thesis.tex").unlink()
    write(folder, table="old")
    before = contents(folder)
    with pytest.raises(CaseError, match="no earlier design; choose another folder"):
        write(folder, OTHER)
    (folder / "figures" / "flow.png").write_text("retouched")
    with pytest.raises(CaseError, match=r"flow.png: was changed .* rename it"):
        check_replaceable(folder, KIND)
    (folder / "figures" / "flow.png").write_text("identification")
    (folder / "next.txt").write_text("mine")
    with pytest.raises(CaseError, match=r"next.txt: is no earlier output"):
        write(folder, next="a name that the next version writes")
    assert contents(folder) == before | {"next.txt": "mine"}
    (tmp_path / "file").write_text("")
    with pytest.raises(CaseError, match="file: is a file"):
        write(tmp_path / "file")


def test_an_export_replaces_its_own_files_and_no_others(tmp_path):
    write_files({"axis.c": "old"}, tmp_path / "a" / "b")
    write_files({"axis.c": "old"}, tmp_path / "out")
    write_files({"axis.fmu": b"zip"}, tmp_path / "out")
    (tmp_path / "out" / "axis.h").write_text("mine")
    write_files({"axis.c": "new"}, tmp_path / "out")
    assert contents(tmp_path / "out") == {"axis.c": "new", "axis.fmu": "zip", "axis.h": "mine"}
    with pytest.raises(CaseError, match=r"axis.h: is no earlier output"):
        write_files({"axis.c": "newer", "axis.h": "newer"}, tmp_path / "out")
    (tmp_path / "out" / "axis.c").write_text("mended by hand")
    with pytest.raises(CaseError, match=r"axis.c: was changed"):
        write_files({"axis.c": "newer"}, tmp_path / "out")
    write(tmp_path / "report", table="old")
    write_files({"axis.c": "new"}, tmp_path / "report")  # an export beside a report
    write(tmp_path / "report", table="new")
    write_files({"axis.c": "newer"}, tmp_path / "report")
    assert (tmp_path / "report" / "axis.c").read_text() == "newer"


def test_a_folder_that_is_filled_bit_by_bit_takes_no_name_of_the_user(tmp_path):
    claim_names(tmp_path / "out", OutputKind.CASES, ("cases", "cases.csv"))
    (tmp_path / "out" / "cases.csv").write_text("1")
    claim_names(tmp_path / "out", OutputKind.CASES, ("cases", "cases.csv"))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "cases.csv").write_text("years of work")
    with pytest.raises(CaseError, match=r"cases.csv: is no earlier output"):
        claim_names(tmp_path / "mine", OutputKind.CASES, ("cases", "cases.csv"))


def test_a_json_file_replaces_only_a_result_of_its_command(tmp_path):
    path = tmp_path / "bench.json"
    check_result_file(path, "wls")
    path.write_text(json.dumps({"stroke_m": 0.2}))
    with pytest.raises(CaseError, match=r"bench.json: is there and no earlier result"):
        check_result_file(path, "wls")
    path.write_text(json.dumps({"wls": {}}))
    check_result_file(path, "wls")
    path.write_text("no JSON")
    with pytest.raises(CaseError, match=r"bench.json: is there and no earlier result"):
        check_result_file(path, "wls")


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="a folder that nobody can write to")
def test_what_cannot_be_written_is_told_before_the_work():
    for path in ("/proc/nowhere/report", "/proc/report"):
        with pytest.raises(CaseError, match="/proc: cannot be written"):
            check_replaceable(path, KIND)
    with pytest.raises(CaseError, match="/proc: cannot be written"):
        check_result_file("/proc/result.json", "wls")


def test_a_manifest_that_is_none_is_refused(tmp_path):
    (tmp_path / MANIFEST).write_text(json.dumps({"outputs": ["identification"]}))
    with pytest.raises(CaseError, match="`outputs` is no list of files by kind"):
        check_replaceable(tmp_path, KIND)
