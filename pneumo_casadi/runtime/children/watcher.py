"""Starts a program in this process' group, and ends the group when the parent is gone.

Run as a script, without the rest of the package and with few imports: it is started for every
compilation. A compiler is a driver with children, which the death of the driver alone would leave.
"""

import os
import sys
import time

#: How often, at most, the program and the parent are looked for [s]: far below the five seconds in
#: which all is to be gone; at first more often, by this share of the time that has passed.
PERIOD, SHARE = 0.2, 0.02
KILL = 9


def main() -> None:
    """Run the program that the arguments name, and end as it does."""
    parent, command = int(sys.argv[1]), sys.argv[2:]
    if not hasattr(os, "posix_spawnp"):  # Windows
        import subprocess

        sys.exit(subprocess.call(command))
    child = os.posix_spawnp(command[0], command, os.environ)
    began = time.monotonic()
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        if os.getppid() != parent:
            os.killpg(0, KILL)
        time.sleep(min(PERIOD, 1e-3 + SHARE * (time.monotonic() - began)))
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        os.kill(os.getpid(), -code)
    sys.exit(code)


if __name__ == "__main__":
    main()
