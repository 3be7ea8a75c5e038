"""Forbids connections to other hosts, in every Python that finds this folder on its path.

Python imports a module of this name at its start. The tests put the folder on the path of all
processes that they start, and load the module in their own.
"""

import ipaddress
import socket
import sys

#: Events of the interpreter (PEP 578) that lead to another host, and where their host is named.
EVENTS = {
    "socket.connect": lambda args: (args[0], args[1]),
    "socket.sendto": lambda args: (args[0], args[1]),
    "socket.getaddrinfo": lambda args: (None, args),
    "socket.gethostbyname": lambda args: (None, args),
}


class NetworkError(RuntimeError):
    """A connection to another host."""


def is_local(host):
    """Tell whether a host is this machine."""
    if host in (None, "", "localhost", socket.gethostname()):
        return True
    try:
        address = ipaddress.ip_address(host.decode() if isinstance(host, bytes) else host)
    except ValueError:
        return False
    return address.is_loopback or address.is_unspecified


def forbid(event, args):
    """Raise where an event of the interpreter leads to another host."""
    if event not in EVENTS:
        return
    used, address = EVENTS[event](args)
    if isinstance(address, (str, bytes)):  # the path of a socket of this machine
        return
    if event == "socket.connect" and used.type == socket.SOCK_DGRAM:
        return  # sends nothing: the usual way to ask for this machine's own address
    if not is_local(address[0]):
        raise NetworkError(f"{event} {address[0]!r}: no network access is allowed")


sys.addaudithook(forbid)
