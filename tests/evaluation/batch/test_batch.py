"""Many cases: one row each, whatever fails, dies or is interrupted."""

import importlib.util
import json
import os
import shutil
import signal
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import forkserver, get_context
from pathlib import Path

import pandas as pd
import pytest

from pneumo_casadi.cli import app as cli
from pneumo_casadi.errors import CaseError, PneumoError
from pneumo_casadi.evaluation.batch import CSV, PARQUET, Row, case_folders, diagnose_many
from pneumo_casadi.evaluation.batch.run import diagnose_one
from pneumo_casadi.evaluation.batch.table import write_tables
from pneumo_casadi.runtime.interruption import interruptible
from pneumo_casadi.runtime.processes import processes

needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="dask.distributed is not installed: pip install 'pneumo-casadi[dask]'",
)


@pytest.fixture
def fakes(monkeypatch):
    """Diagnoses that worker processes can import too: they take over this one's path."""
    here = str(Path(__file__).parent)
    monkeypatch.syspath_prepend(here)
    monkeypatch.setenv("PYTHONPATH", here)
    yield importlib.import_module("batch_fakes")
    sys.modules.pop("batch_fakes")


@pytest.fixture(scope="module")
def copied():
    """Context of processes that are copies of one that has imported all: each saves seconds."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["pneumo_casadi.evaluation.batch", "distributed"])
    forkserver.ensure_running()  # Dask would ask for other modules
    return context


@pytest.fixture
def cases(tmp_path):
    return made_cases(tmp_path, 4)


def made_cases(folder, number):
    for i in range(1, number + 1):
        case = folder / "data" / f"c{i}"
        case.mkdir(parents=True)
        (case / "bench.json").write_text(f"{i}.5")
    return case_folders(folder / "data")


def marks(folder):
    """Names of the cases that were diagnosed, as often as they were."""
    return sorted(path.name.partition(".")[0] for path in (folder / "marks").glob("*"))


def without_time(rows):
    return [replace(row, seconds=None) for row in rows]


def test_each_case_gets_a_record_and_a_row_in_both_tables(tmp_path, cases, fakes):
    out, told = tmp_path / "out", []
    rows = diagnose_many(
        cases, keep=out, progress=lambda *step: told.append(step), diagnosing=fakes.verdict
    )
    assert [row.case for row in rows] == ["c1", "c2", "c3", "c4"]
    assert told == [(f"diagnosed {i} of 4", i / 4) for i in (1, 2, 3, 4)]
    tables = ["cases", "cases.csv", "cases.parquet"]
    assert sorted(path.name for path in out.iterdir()) == [".pneumo_casadi.json", *tables]
    assert json.loads((out / "cases" / "c2.json").read_text())["diagnosis"]["gap"]["before"] == 2.5
    text, table = pd.read_csv(out / "cases.csv"), pd.read_parquet(out / "cases.parquet")
    assert list(text.columns) == list(table.columns)
    for frame in (text, table):
        assert list(frame["case"]) == ["c1", "c2", "c3", "c4"]
        assert list(frame["gap_before_percent"]) == [1.5, 2.5, 3.5, 4.5]
        assert list(frame["shrink_lower"]) == [0.8] * 4
    assert text["effects"][0] == "hose + stribeck" and text["probabilities"][0] == "0.9 + 0.7"
    assert list(table["effects"][0]) == ["hose", "stribeck"]
    assert list(table["probabilities"][0]) == [0.9, 0.7]


def test_without_pyarrow_there_is_one_table_and_no_older_one(tmp_path, monkeypatch):
    write_tables([Row("a", "none")], tmp_path)
    assert (tmp_path / PARQUET).is_file()
    monkeypatch.setattr("pneumo_casadi.evaluation.batch.table.find_spec", lambda name: None)
    write_tables([Row("b", "none")], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [CSV]
    assert pd.read_csv(tmp_path / CSV)["case"].tolist() == ["b"]


def test_a_case_that_fails_is_a_row_and_the_others_go_on(tmp_path, cases, fakes):
    rows = diagnose_many(cases, keep=tmp_path / "out", diagnosing=fakes.broken)
    assert [row.verdict for row in rows] == ["failed", "failed", "failed", "effect"]
    assert rows[0].error == "FitError: no step was found; record more motion"
    assert rows[1].error.startswith("ValueError") and rows[2].error.startswith("KeyError")
    table = pd.read_parquet(tmp_path / "out" / "cases.parquet")
    assert list(table["error"]) == [row.error for row in rows]
    assert table["shrink"].isna().tolist() == [True, True, True, False]
    diagnose_many(cases, keep=tmp_path / "out", diagnosing=fakes.broken)
    assert marks(tmp_path) == ["c4"]


def test_what_is_finished_is_not_done_again_unless_its_data_change(tmp_path, cases, fakes):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        diagnose_many(cases, keep=out, diagnosing=fakes.interrupted)
    assert marks(tmp_path) == ["c1"] and not (out / "cases.csv").exists()
    (tmp_path / "mended").touch()
    rows = diagnose_many(cases, keep=out, diagnosing=fakes.interrupted)
    assert marks(tmp_path) == ["c1", "c2", "c3", "c4"]
    assert diagnose_many(cases, keep=out, diagnosing=fakes.interrupted) == rows
    (cases[0] / "bench.json").write_text("9.5")
    (cases[1] / "identify_2.csv").write_text("more")
    (cases[2] / "notes.txt").write_text("nobody reads this")
    (out / "cases" / "c4.json").write_text('{"case": "c4"')  # cut short
    again = diagnose_many(cases, keep=out, diagnosing=fakes.interrupted)
    assert marks(tmp_path) == ["c1", "c1", "c2", "c2", "c3", "c4", "c4"]
    assert again[0].gap_before_percent == 9.5
    diagnose_many(cases, keep=out, diagnosing=fakes.marked)  # another way to diagnose
    assert len(marks(tmp_path)) == 11


@pytest.mark.parametrize(
    "file", ["columns.json", "flow_map_P.csv", "flow_map_N.csv", "validate.mat"]
)
def test_another_file_that_a_diagnosis_reads_is_a_change_of_data(tmp_path, cases, fakes, file):
    (tmp_path / "mended").touch()
    for _ in range(2):
        diagnose_many(cases[:1], keep=tmp_path / "out", diagnosing=fakes.interrupted)
    assert marks(tmp_path) == ["c1"]
    (cases[0] / file).write_text("another one")
    diagnose_many(cases[:1], keep=tmp_path / "out", diagnosing=fakes.interrupted)
    assert marks(tmp_path) == ["c1", "c1"]


def test_an_interruption_that_comes_out_as_an_error_is_no_result(tmp_path, cases, fakes):
    with interruptible() as interruption, pytest.raises(NotImplementedError):
        diagnose_one(cases[0], tmp_path / "out", fakes.garbled)
    assert interruption.number == signal.SIGINT
    assert not (tmp_path / "out").exists()


def test_a_fault_of_the_machine_is_tried_again_by_the_next_call(tmp_path, cases, fakes):
    out = tmp_path / "out"
    rows = diagnose_many(cases, keep=out, diagnosing=fakes.out_of_disk)
    assert [row.error for row in rows] == ["OSError: disk full", "", "", ""]
    (tmp_path / "mended").touch()
    rows = diagnose_many(cases, keep=out, diagnosing=fakes.out_of_disk)
    assert not any(row.error for row in rows)
    assert marks(tmp_path) == ["c1", "c2", "c3", "c4"]


def test_threads_give_what_one_gives_and_an_interruption_leaves_the_rest_undone(tmp_path, fakes):
    cases = made_cases(tmp_path, 20)
    alone = diagnose_many(cases, keep=tmp_path / "alone", diagnosing=fakes.verdict)
    with ThreadPoolExecutor(3) as executor:
        rows = diagnose_many(cases, executor, keep=tmp_path / "out", diagnosing=fakes.verdict)
        assert without_time(rows) == without_time(alone)

    def stop(text, share):
        raise KeyboardInterrupt

    gate = threading.Event()
    with ThreadPoolExecutor(1) as executor, pytest.raises(KeyboardInterrupt):
        executor.submit(gate.wait, 0.05)
        diagnose_many(
            cases, executor, keep=tmp_path / "stopped", progress=stop, diagnosing=fakes.marked
        )
    assert len(marks(tmp_path)) < 20


@pytest.mark.slow
def test_processes_give_what_one_gives_and_one_that_dies_costs_its_case_only(
    tmp_path, fakes, copied, monkeypatch
):
    monkeypatch.setattr("pneumo_casadi.runtime.processes.get_context", lambda method: copied)
    cases, out = made_cases(tmp_path, 6), tmp_path / "out"
    alone = diagnose_many(cases, keep=tmp_path / "alone", diagnosing=fakes.verdict)
    with processes(2) as executor:
        rows = diagnose_many(cases, executor, keep=out, diagnosing=fakes.killed_once)
        assert (tmp_path / "killed").exists() and without_time(rows) == without_time(alone)
        rows = diagnose_many(cases, executor, keep=out, diagnosing=fakes.killed_always)
    assert [row.case for row in rows if row.verdict == "failed"] == ["c4"]
    assert "WorkerDiedError" in rows[3].error and "signal 9" in rows[3].error
    assert without_time(rows[:3] + rows[4:]) == without_time(alone[:3] + alone[4:])


@pytest.mark.slow
def test_the_end_of_a_foreign_pool_is_told_and_loses_nothing(tmp_path, fakes, copied):
    cases, out = made_cases(tmp_path, 6), tmp_path / "out"
    with (
        ProcessPoolExecutor(2, copied) as executor,
        pytest.raises(PneumoError, match=r"finished cases are in .*call it again"),
    ):
        diagnose_many(cases, executor, keep=out, diagnosing=fakes.killed_once)
    rows = diagnose_many(cases, keep=out, diagnosing=fakes.killed_once)
    assert [row.error for row in rows] == [""] * 6


@contextmanager
def cluster():
    """Two Dask workers in processes of their own; two that die are too many for a case."""
    import dask
    from distributed import Client, LocalCluster

    with (
        dask.config.set(
            {
                "distributed.scheduler.allowed-failures": 1,
                "distributed.worker.multiprocessing-method": "forkserver",
            }
        ),
        LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs="CRITICAL",
        ) as workers,
        Client(workers) as client,
    ):
        yield client


@pytest.mark.slow
@needs_dask
def test_a_killed_dask_worker_changes_no_result(tmp_path, fakes, copied):
    cases, out = made_cases(tmp_path, 6), tmp_path / "out"
    alone = diagnose_many(cases, keep=tmp_path / "alone", diagnosing=fakes.verdict)
    with cluster() as client:
        before = set(client.run(os.getpid).values())
        rows = diagnose_many(cases, client.get_executor(), keep=out, diagnosing=fakes.killed_once)
        assert int((tmp_path / "killed").read_text()) in before  # a worker it was, and it is dead
        assert without_time(rows) == without_time(alone)
        assert marks(tmp_path) == sorted(case.name for case in cases)  # none lost, none twice
        table = pd.read_csv(out / "cases.csv")
        assert list(table["case"]) == [case.name for case in cases]
        # Dask remembers results of equal calls, but not what lies on the disk.
        (cases[0] / "bench.json").write_text("77.5")
        rows = diagnose_many(cases, client.get_executor(), keep=out, diagnosing=fakes.killed_once)
        assert [row.gap_before_percent for row in rows][:2] == [77.5, alone[1].gap_before_percent]
        rows = diagnose_many(cases, client.get_executor(), keep=out, diagnosing=fakes.killed_always)
        failed = {row.case: row.error for row in rows if row.verdict == "failed"}
        assert list(failed) == ["c4"], failed
        assert "KilledWorker" in failed["c4"]


@pytest.mark.slow
def test_a_real_case_is_diagnosed_and_one_too_short_says_so(tmp_path, fakes):
    testbed = pytest.importorskip("pneumo_casadi.virtual_bench", exc_type=ImportError)
    for name, duration in (("good", 3.0), ("short", 0.5)):
        folder = tmp_path / "data" / name
        testbed.make_case(folder, 0, {"spring_load": "large"}, fs=500.0, duration=duration)
    good, short = diagnose_many(
        case_folders(tmp_path / "data"), keep=tmp_path / "out", diagnosing=fakes.spring_load
    )
    assert good.effects == ("spring_load",) and good.shrink_lower > 0.5
    assert good.gap_after_percent < 0.2 * good.gap_before_percent and good.where == "force"
    assert short.verdict == "failed" and short.error.startswith("CaseError")


def test_a_link_is_a_case_by_its_own_name(tmp_path, cases, fakes):
    (tmp_path / "data" / "link").symlink_to(cases[0], target_is_directory=True)
    rows = diagnose_many(
        case_folders(tmp_path / "data"), keep=tmp_path / "out", diagnosing=fakes.verdict
    )
    assert [row.case for row in rows] == ["c1", "c2", "c3", "c4", "link"]


def test_names_that_stand_for_two_cases_are_refused(tmp_path, cases, fakes):
    with pytest.raises(CaseError, match="c1"):
        diagnose_many([*cases, tmp_path / "c1"], keep=tmp_path / "out", diagnosing=fakes.verdict)
    with pytest.raises(CaseError, match="at least one"):
        diagnose_many([], keep=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_counts_verdicts_and_tells_of_failures(
    tmp_path, cases, fakes, monkeypatch, capsys
):
    def run(many, *arguments, **keywords):
        return diagnose_many(many, *arguments, **keywords, diagnosing=fakes.broken)

    monkeypatch.setattr("pneumo_casadi.evaluation.batch.diagnose_many", run)
    out = tmp_path / "out"
    assert cli.run(["diagnose-many", str(tmp_path / "data"), "-o", str(out), "--workers=1"]) == 1
    told = capsys.readouterr()
    assert "4 cases: failed 3, effect 1" in told.out and "cases.csv" in told.out
    assert told.err.count("\n") == 1 and "3 of 4 cases failed; c1: FitError" in told.err
    assert len(pd.read_csv(out / "cases.csv")) == 4
    for case in cases[:3]:
        shutil.rmtree(case)
    assert cli.run(["diagnose-many", str(tmp_path / "data"), "-o", str(out), "--workers=1"]) == 0


@pytest.mark.parametrize("where", ["data", "nowhere"])
def test_a_folder_without_cases_is_one_line(tmp_path, capsys, where):
    (tmp_path / "data" / "empty").mkdir(parents=True)
    assert cli.run(["diagnose-many", str(tmp_path / where), "-o", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1
    assert not (tmp_path / "out").exists()
