"""Workers, children and drafts end with their process, whatever ends that."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pneumo_casadi.runtime.atomic_files import atomic_file, atomic_folder, draft_folder
from pneumo_casadi.runtime.children import end_group, run_child
from pneumo_casadi.runtime.children.serving import ChildEndedError, ServingChild
from pneumo_casadi.runtime.processes import worker_pool

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

#: A command with workers, a child, a draft and a main thread that no handler interrupts for long:
#: what a compiled function is. Each tells its process by a file.
COMMAND = """
import ctypes, os, subprocess, sys, threading
from pathlib import Path
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.runtime.children import run_child
from pneumo_casadi.runtime.interruption import interruptible
from pneumo_casadi.runtime.processes import worker_pool

SLEEP = "import os, sys, time; open(sys.argv[1], 'w').write(str(os.getpid())); time.sleep(60)"

def stuck(folder):
    with draft_folder(folder, "of_worker"):
        Path(folder, "worker.pid").write_text(str(os.getpid()))
        ctypes.CDLL(None).usleep(60_000_000)

def child(folder):
    shell = f"{sys.executable} -c \\"{SLEEP}\\" {folder}/child.pid; true"
    run_child(["sh", "-c", shell])

if __name__ == "__main__":
    folder, compiled = sys.argv[1], sys.argv[2] == "compiled"
    with (
        interruptible() as interruption,
        draft_folder(folder, "of_command"),
        worker_pool(2) as pool,
    ):
        job = pool.submit(stuck, folder)
        thread = threading.Thread(target=child, args=(folder,), daemon=True)
        thread.start()
        while not all(Path(folder, f"{n}.pid").exists() for n in ("worker", "child")):
            thread.join(0.01)
        Path(folder, "ready").touch()
        try:
            if compiled:
                ctypes.CDLL(None).sleep(60)
            job.result()
        except KeyboardInterrupt:
            sys.exit(interruption.exit_code)
"""


def wait_until(holds, seconds):
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        time.sleep(0.01)
    return holds()


def gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] == "Z"
    except OSError:
        return True


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are listed by Linux")
@pytest.mark.parametrize(
    ("number", "how"),
    [
        *((n, "python") for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)),
        *((n, "compiled") for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)),
        (signal.SIGKILL, "compiled"),  # whatever the command is at, it hears nothing of it
    ],
)
def test_nothing_is_left_of_a_command_that_ends(tmp_path, number, how):
    script, folder = tmp_path / "command.py", tmp_path / "out"
    script.write_text(COMMAND)
    folder.mkdir()
    command = subprocess.Popen(
        [sys.executable, str(script), str(folder), how], stderr=subprocess.DEVNULL
    )
    try:
        assert wait_until((folder / "ready").exists, 60)
        command.send_signal(number)
        code = command.wait(20)
        # Orderly or hard: both give the code of the signal.
        assert code == (-number if number == signal.SIGKILL else 128 + number)
        pids = [int((folder / f"{name}.pid").read_text()) for name in ("worker", "child")]
        assert wait_until(lambda: all(map(gone, pids)), 20)
    finally:
        command.kill()
    if number != signal.SIGKILL:
        assert not [path for path in folder.iterdir() if path.name.startswith(".")]
    with draft_folder(folder):  # the next run cleans
        pass
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_draft_in_work_is_left_alone_and_one_of_a_dead_process_is_not(tmp_path):
    lines = (
        "import os, sys",
        "from pneumo_casadi.runtime.atomic_files import draft_folder",
        "with draft_folder(sys.argv[1], 'dead'): os._exit(0)",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines), str(tmp_path)], check=True)
    (tmp_path / ".mine.pneumo_casadi-notes").mkdir()  # no name of a draft
    assert len(list(tmp_path.iterdir())) == 2
    with draft_folder(tmp_path, "live") as live, draft_folder(tmp_path, "other") as other:
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
            [live.name, other.name, ".mine.pneumo_casadi-notes"]
        )
    assert [path.name for path in tmp_path.iterdir()] == [".mine.pneumo_casadi-notes"]


def test_a_folder_that_was_about_to_be_replaced_comes_back(tmp_path):
    lines = (
        "import os, sys",
        "from pathlib import Path",
        "from pneumo_casadi.runtime.atomic_files import draft_folder",
        "folder = Path(sys.argv[1])",
        "with draft_folder(folder, 'report') as draft:",
        "    (folder / 'report').replace(draft / 'replaced')",
        "    os._exit(0)",
    )
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "mine").write_text("precious")
    subprocess.run([sys.executable, "-c", "\n".join(lines), str(tmp_path)], check=True)
    assert not (tmp_path / "report").exists()
    with atomic_file(tmp_path / "other.txt") as draft:
        draft.write_text("new")
    assert (tmp_path / "report" / "mine").read_text() == "precious"
    with pytest.raises(RuntimeError), atomic_folder(tmp_path / "report"):
        raise RuntimeError
    assert (tmp_path / "report" / "mine").read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.txt", "report"]


def test_workers_start_and_import_modules_before_the_first_task_comes(tmp_path, monkeypatch):
    (tmp_path / "leaves_a_mark.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w').close()")
    (tmp_path / "breaks.py").write_text("raise RuntimeError('cannot be imported')")
    monkeypatch.syspath_prepend(tmp_path)
    with worker_pool(1, ["breaks", "leaves_a_mark"]) as pool:
        assert wait_until((tmp_path / "mark").exists, 60.0)
        assert pool.submit(abs, -1).result(60.0) == 1


@pytest.mark.slow
def test_a_program_that_crashes_or_stalls_is_told():
    crash = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    assert run_child([sys.executable, "-c", crash]).returncode == -signal.SIGSEGV
    assert run_child([sys.executable, "-c", "raise SystemExit(7)"]).returncode == 7
    with pytest.raises(subprocess.TimeoutExpired):
        run_child(["sleep", "60"], timeout=0.5)


def test_temporary_files_of_a_program_lie_in_the_folder_given(tmp_path):
    asked = [sys.executable, "-c", "import tempfile; print(tempfile.gettempdir())"]
    assert Path(run_child(asked, scratch=tmp_path).stdout.decode().strip()) == tmp_path
    assert Path(run_child(asked).stdout.decode().strip()) != tmp_path


def test_a_program_that_serves_is_started_anew_where_it_has_ended():
    child = ServingChild(["cat"])
    assert child.ask(b"one", 20.0) == b"one"
    first = child._process
    assert child.ask(b"two", 20.0) == b"two" and child._process is first
    end_group(first)
    first.wait()
    assert child.ask(b"three", 20.0) == b"three" and child._process is not first
    child.end()
    assert child._process is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "error"), [(["true"], ChildEndedError), (["sleep", "60"], TimeoutError)]
)
def test_a_program_that_does_not_answer_is_told(command, error):
    with pytest.raises(error):
        ServingChild(command).ask(b"one", 0.3)
