"""The key of the cache: of this user, made once."""

import os
import subprocess
import sys

import pytest

from pneumo_casadi.runtime import cache

FIRST, SECOND = b"1" * cache.LENGTH, b"2" * cache.LENGTH


@pytest.fixture
def key_file(tmp_path, monkeypatch):
    """Where the key is kept; nothing is there yet."""
    monkeypatch.setattr(cache, "user_data_path", lambda *name, **options: tmp_path / "data")
    cache._key.cache_clear()
    yield tmp_path / "data" / "cache.key"
    cache._key.cache_clear()


def test_the_key_is_kept_for_this_user_alone(key_file):
    made = cache._key()
    assert len(made) == cache.LENGTH and key_file.read_bytes() == made
    if os.name == "posix":
        assert key_file.stat().st_mode & 0o777 == 0o600
    cache._key.cache_clear()
    assert cache._key() == made


def test_of_two_processes_that_make_a_key_at_once_the_first_one_decides(key_file, monkeypatch):
    """With keys of their own each would build anew, over and over, what the other has built."""

    def another_is_faster(length):
        key_file.touch(mode=0o600)
        key_file.write_bytes(FIRST)
        return SECOND

    monkeypatch.setattr(cache.secrets, "token_bytes", another_is_faster)
    assert cache._key() == FIRST == key_file.read_bytes()


def test_where_files_cannot_be_linked_the_key_is_moved(key_file, monkeypatch):
    def refused(self, target):
        raise PermissionError("no links here")

    monkeypatch.setattr(cache.Path, "hardlink_to", refused)
    assert cache._key() == key_file.read_bytes()


posix = pytest.mark.skipif(os.name != "posix", reason="files have no mode")


@pytest.mark.parametrize("fault", ["short", pytest.param("open to others", marks=posix)])
def test_what_is_no_key_of_this_user_is_replaced(key_file, fault):
    key_file.parent.mkdir()
    key_file.touch(mode=0o600)
    key_file.write_bytes(FIRST[:5] if fault == "short" else FIRST)
    if fault == "open to others":
        key_file.chmod(0o644)
    made = cache._key()
    assert made == key_file.read_bytes() and made != FIRST and len(made) == cache.LENGTH


def test_processes_that_start_together_have_one_key(tmp_path):
    code = "from pneumo_casadi.runtime import cache; print(cache._key().hex())"
    given = os.environ | {"XDG_DATA_HOME": str(tmp_path), "HOME": str(tmp_path)}
    started = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=given)
        for _ in range(4)
    ]
    printed = [process.communicate()[0].decode().strip() for process in started]
    assert len(set(printed)) == 1 and len(bytes.fromhex(printed[0])) == cache.LENGTH
