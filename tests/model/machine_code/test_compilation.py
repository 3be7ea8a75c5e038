"""Compiled functions are the interpreted ones, and nothing about the cache can change that."""

import logging
import multiprocessing
import os
import sys

import casadi as ca
import numpy as np
import pytest

from pneumo_casadi.model.machine_code import compilation
from pneumo_casadi.model.machine_code.compilation import compile_functions, compiler
from pneumo_casadi.runtime.cache import FOLDER, cache_folder


def function(name="curve", factor=1.0):
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    return ca.Function(
        name, [x, y], [factor * ca.sin(x) * y, ca.dot(x, x) + y], ["x", "y"], ["a", "b"]
    )


def outer():
    """An MX function that calls another one."""
    x, y = ca.MX.sym("x", 2), ca.MX.sym("y")
    return ca.Function("outer", [x, y], [ca.sum1(function()(x, y)[0])])


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache of its own, and a compiler that is looked for anew."""
    monkeypatch.setenv(FOLDER, str(tmp_path / "cache"))
    monkeypatch.delenv(compilation.SWITCH, raising=False)
    compiler.cache_clear()
    yield tmp_path / "cache"
    compiler.cache_clear()


def libraries(cache):
    return sorted(cache.glob("*.so"))


def compiled_once(cache):
    """Return what is kept of code without its constants."""
    return [path for path in cache.iterdir() if path.suffix in (".blank", ".o")]


needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def is_compiled(f):
    return f.class_name() == "GenericExternal" or "External" in f.class_name()


@needs_compiler
def test_compiled_functions_equal_the_interpreted_ones_and_keep_their_signature(cache):
    given = (function(), outer())
    rng = np.random.default_rng(0)
    for one, other in zip(given, compile_functions(given), strict=True):
        assert is_compiled(other) and not is_compiled(one)
        assert other.name() == one.name()
        assert [other.name_in(i) for i in range(2)] == [one.name_in(i) for i in range(2)]
        assert [other.size_in(i) for i in range(2)] == [one.size_in(i) for i in range(2)]
        for _ in range(10):
            x, y = rng.standard_normal(2), rng.standard_normal()
            for a, b in zip(one.call([x, y]), other.call([x, y]), strict=True):
                np.testing.assert_allclose(b.full(), a.full(), rtol=1e-14)


@needs_compiler
def test_the_same_function_is_built_once_and_a_changed_one_again(cache):
    compile_functions([function()])
    (first,) = libraries(cache)
    stamp = first.stat().st_mtime_ns
    compile_functions([function()])
    assert [p.stat().st_mtime_ns for p in libraries(cache)] == [stamp]
    (changed,) = compile_functions([function(factor=2.0)])
    assert len(libraries(cache)) == 2
    assert float(changed([1, 0], 1)[0][0]) == pytest.approx(2 * np.sin(1.0))
    (same,) = compile_functions([function()])
    assert float(same([1, 0], 1)[0][0]) == pytest.approx(np.sin(1.0))


@needs_compiler
@pytest.mark.parametrize("change", ["flags", "compiler"])
def test_other_flags_or_another_compiler_make_another_library(cache, monkeypatch, tmp_path, change):
    compile_functions([function()])
    if change == "flags":
        monkeypatch.setenv(compilation.FLAGS, "-O0 -g")
    else:
        link = tmp_path / "other-cc"
        link.symlink_to(compiler())
        monkeypatch.setenv("CC", str(link))
        compiler.cache_clear()
        assert compiler() == str(link)
    compile_functions([function()])
    assert len(libraries(cache)) == 2


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("flags", ["", "-O2 -flto"])
@pytest.mark.parametrize("systems", [compilation._FILLED, ()], ids=["filled", "linked"])
def test_functions_that_differ_in_constants_only_are_compiled_once(
    cache, monkeypatch, systems, flags
):
    """Also where the compiler is told to look at all files of a library at once."""
    monkeypatch.setenv(compilation.FLAGS, flags)
    monkeypatch.setattr(compilation, "_FILLED", systems)
    for factor in (0.3, 724100.0):
        (f,) = compile_functions([function("scaled", factor)])
        assert is_compiled(f)
        assert float(f([1, 0], 1)[0][0]) == pytest.approx(factor * np.sin(1.0), rel=1e-15)
    assert len(libraries(cache)) == 2
    assert len(compiled_once(cache)) == 1


@needs_compiler
@pytest.mark.slow
def test_code_with_damaged_instructions_is_compiled_again(cache, caplog):
    compile_functions([function("half", 0.3)])
    (path,) = compiled_once(cache)
    path.write_bytes(path.read_bytes()[:100])
    with caplog.at_level(logging.WARNING):
        (f,) = compile_functions([function("half", 0.4)])
    assert "building again" in caplog.text
    assert float(f([1, 0], 1)[0][0]) == pytest.approx(0.4 * np.sin(1.0))


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("damage", [b"", b"not a library", 0.3, 0.999])
def test_a_damaged_library_is_built_again_with_a_notice(cache, caplog, damage):
    """Cut short, a library would end the process that loads it."""
    # Never loaded before in this process, so that the loader has no copy of the good one.
    share = isinstance(damage, float)
    f = function(f"broken_{round(1e4 * damage) if share else 'b' + str(len(damage))}")
    compile_functions([f])
    (path,) = libraries(cache)
    good = path.read_bytes()
    path.unlink()
    path.write_bytes(good[: int(damage * len(good))] if share else damage)
    with caplog.at_level(logging.WARNING):
        (again,) = compile_functions([f])
    assert "building again" in caplog.text
    assert is_compiled(again) and path.read_bytes() == good
    assert float(again([1, 0], 1)[0][0]) == pytest.approx(np.sin(1.0))


def test_without_a_compiler_functions_are_interpreted_with_one_notice(cache, monkeypatch, caplog):
    monkeypatch.setattr(compilation.shutil, "which", lambda name: None)
    compiler.cache_clear()
    f = function()
    with caplog.at_level(logging.WARNING):
        assert compile_functions([f])[0] is f
        assert compile_functions([f])[0] is f
    notices = [r for r in caplog.records if "no C compiler found" in r.getMessage()]
    assert len(notices) == 1 and "install gcc" in notices[0].getMessage()
    assert not cache.exists()


def test_switched_off_functions_are_interpreted_in_silence(cache, monkeypatch, caplog):
    monkeypatch.setenv(compilation.SWITCH, "0")
    compiler.cache_clear()
    f = function()
    with caplog.at_level(logging.WARNING):
        assert compile_functions([f])[0] is f
    assert not caplog.records


@pytest.mark.skipif(sys.platform == "win32", reason="writes a shell script")
def test_a_compiler_that_fails_leaves_the_functions_as_they_are(
    cache, monkeypatch, tmp_path, caplog
):
    broken = tmp_path / "broken-cc"
    broken.write_text("#!/bin/sh\necho 'fatal: no disk' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    compiler.cache_clear()
    f = function()
    with caplog.at_level(logging.WARNING):
        assert compile_functions([f])[0] is f
    assert "fatal: no disk" in caplog.text and "interpreted" in caplog.text
    assert not list(cache.iterdir())


def test_a_cache_that_cannot_be_written_leaves_the_functions_as_they_are(
    cache, monkeypatch, tmp_path, caplog
):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv(FOLDER, str(blocked / "cache"))
    f = function()
    with caplog.at_level(logging.WARNING):
        assert compile_functions([f])[0] is f
    assert compiler() is None or "interpreted" in caplog.text


@needs_compiler
def test_the_cache_is_for_this_user_alone_and_holds_no_scratch(cache):
    compile_functions([function()])
    assert cache_folder() == cache
    if os.name == "posix":
        assert cache.stat().st_mode & 0o077 == 0
    assert {*libraries(cache), *compiled_once(cache)} == set(cache.iterdir())


def _build(queue, barrier):
    barrier.wait(timeout=30)
    (f,) = compile_functions([function("together")])
    queue.put((is_compiled(f), float(f([1, 0], 1)[0][0])))


@needs_compiler
@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_processes_that_build_at_once_both_get_a_library(cache):
    context = multiprocessing.get_context("fork")
    queue, barrier = context.Queue(), context.Barrier(2)
    workers = [context.Process(target=_build, args=(queue, barrier)) for _ in range(2)]
    for worker in workers:
        worker.start()
    found = [queue.get(timeout=60) for _ in workers]
    for worker in workers:
        worker.join(timeout=60)
        assert worker.exitcode == 0
    assert all(ok for ok, _ in found)
    np.testing.assert_allclose([value for _, value in found], np.sin(1.0))
    assert len(libraries(cache)) == 1


def test_a_cache_that_others_may_write_to_is_not_trusted(tmp_path, monkeypatch, caplog):
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o777)
    monkeypatch.setenv("PNEUMO_CASADI_CACHE", str(folder))
    x = ca.SX.sym("x")
    (f,) = compile_functions([ca.Function("cube", [x], [x**3])])
    assert float(f(2)) == 8.0 and not list(folder.iterdir())
    assert "others may write" in caplog.text
