"""No test and no process that a test starts reaches another host."""

import socket
import subprocess
import sys

import pytest

#: Addresses that are kept for documentation (RFC 5737): nobody answers there.
ELSEWHERE = "192.0.2.1"
CONNECT = f"import socket; socket.create_connection(({ELSEWHERE!r}, 80), 0.01)"


def test_a_connection_to_another_host_is_an_error():
    with pytest.raises(RuntimeError, match="no network access"):
        socket.create_connection((ELSEWHERE, 80), 0.01)
    with pytest.raises(RuntimeError, match="no network access"):
        socket.getaddrinfo("example.org", 80)


def test_the_same_holds_in_processes_that_tests_start():
    done = subprocess.run([sys.executable, "-c", CONNECT], capture_output=True, text=True)
    assert done.returncode == 1
    assert "NetworkError" in done.stderr


def test_this_machine_can_be_reached():
    with socket.create_server(("127.0.0.1", 0)) as server:
        socket.create_connection(server.getsockname(), 1.0).close()
